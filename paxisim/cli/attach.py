"""The ``paxisim attach`` command."""

from __future__ import annotations

import textwrap
import warnings
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from paxisim.cli.mounts import format_mount, parse_mount
from paxisim.cli.output import TERMINAL_COLUMNS, check_output, named_after, png, progress, write_output
from paxisim.cli.taxels import Taxels
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.models.mount import Mount

if TYPE_CHECKING:
    from paxisim.models.sensor_modules import SensorModule

_INDENTED = "\n" + " " * len("  --mount '")


def attach(
    gripper: Annotated[Path, tyro.conf.Positional],
    taxels: tyro.conf.OmitArgPrefixes[Taxels],
    *,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    fingers: tuple[str, ...] = (),
    close: tuple[str, ...] = (),
    under: str = "",
    mount: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    conform: bool = False,
    check: bool = False,
    xacro: Annotated[Path | None, tyro.conf.arg(metavar="FILE")] = None,
    link: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    picture: Path | None = None,
    thickness_mm: float = 1.0,
    sensors: Literal["none", "contact", "touch_grid"] = "none",
    force: bool = False,
) -> None:
    """Put tactile pads on a gripper, a hand or a whole robot and write the result as MJCF.

    The command recognises robosuite's grippers by their file name. On any other robot, it finds the hands, closes them
    and puts a pad on each fingertip, facing the way it closes. It prints the mounts it chose and draws a picture of the
    result. If it finds no hand whose pads would be right, it writes nothing and says why. Then tell it where to look
    with --fingers, --close or --under, or place each pad by hand with --mount.

    With --xacro, the pads go where the maker of a covered hand has its sensors. --sensor then selects the kind, since
    one tensor holds pads of one kind.

    For example:

    paxisim attach my_gripper.xml --sensor paxini-gen1-l4629 --pool 2 -o tactile_gripper.xml

    paxisim attach right_hand.xml --sensor xela-uscuah --xacro allegro_hand_right_curved.xacro -o tactile_hand.xml

    paxisim attach arm.xml --rows 4 --cols 3 --pitch-mm 4 --fingers jaw_left jaw_right -o tactile_arm.xml

    Args:
        gripper: The robot's MJCF or URDF file.
        taxels: The pad's taxels.
        output: Output MJCF file, .xml; default: the name of the gripper, with _with_pads.xml.
        fingers: Bodies that are the fingertips; a jaw that does not move is one of them.
        close: Actuators, or joints that have none, that close the hand.
        under: Body that carries the hand, such as the last link of an arm.
        mount: Where to put a pad, once per pad, in the format that this command prints:
            'BODY pos-mm=X,Y,Z quat=W,X,Y,Z replaces=GEOM,GEOM name=NAME'.
        check: Squeeze objects between the pads, print which share of the load these carry, and end with status 1 if
            a pad carries less than 95 %.
        conform: Lay each pad onto its finger if that is curved under it.
        xacro: Your copy of the maker's model of the hand with its sensors, .xacro or .urdf, such as XELA's xela_models.
        link: With --xacro, a link of that model and the body of the gripper that it is, if attach asks for it, as
            LINK=BODY.
        picture: Picture of the gripper with its pads, .png; default: the name of the output, with .png.
        thickness_mm: Thickness of the taxels in mm.
        sensors: MuJoCo sensors to embed; paxisim's own reader needs none.
        force: Overwrite the outputs if they exist.
    """
    import paxisim
    from paxisim.models.load import check_model_file

    check_model_file(gripper)  # before options are judged: a mistyped name is the likeliest mistake
    output = named_after(gripper, "_with_pads.xml") if output is None else output
    picture = output.with_suffix(".png") if picture is None else picture
    check_output(output, force, ".xml")
    check_output(picture, force, ".png")
    mounts = [parse_mount(text) for text in mount]
    modules = _modules(gripper, taxels, xacro, link, mounts)
    layouts = [module.layout for module in modules] or [taxels.layout()]
    mounts = mounts or [module.mount for module in modules]
    _refuse_other_pads(gripper, layouts[0])
    pads = [
        paxisim.Pad(
            layout,
            thickness=thickness_mm * 1e-3,
            mass=taxels.mass,
            sensors=None if sensors == "none" else sensors,
        )
        for layout in layouts
    ]
    progress("attaching" if mounts else "closing the robot's hands to see where their fingers meet")
    tactile = paxisim.attach(
        gripper,
        pads if modules else pads[0],
        mounts or None,
        fingers=fingers,
        close=close,
        under=under,
        conform=conform,
    )
    model = tactile.to_xml(output.absolute().parent)
    if check:
        progress("squeezing objects between the pads")
    checked = paxisim.squeeze(tactile) if check else None
    progress("drawing")
    try:
        drawn, missing = png(paxisim.plot_mounts(tactile)), None
    except paxisim.MissingExtraError as error:
        drawn, missing = b"", error
    # write nothing until both outputs are ready
    write_output(output, model, force)
    if tactile.report:
        for line in tactile.report.splitlines():
            indent = line[: len(line) - len(line.lstrip())] + "  "
            print(textwrap.fill(line, TERMINAL_COLUMNS, subsequent_indent=indent, break_on_hyphens=False))
    if not mount and not modules:
        print("\nTo change the mounts, edit these options and run the command with them:")
        for chosen in tactile.mounts:
            line = f"  --mount '{format_mount(chosen)}'"
            print(line if len(line) <= TERMINAL_COLUMNS else f"  --mount '{format_mount(chosen, _INDENTED)}'")
        print()
    count, layout = len(tactile.pad_names), tactile.layout
    print(f"{output}: {count} pad{'s' * (count > 1)} of {layout.rows}x{layout.cols} taxels")
    if missing is None:
        write_output(picture, drawn, force)
        print(f"{picture}: the gripper with its pads, taxel (0, 0) of each pad white")
    else:
        print(f"no picture: {missing}")
    if checked is not None:
        print(f"\n{checked}")
        if not checked.passed:
            raise SystemExit(1)


def _modules(
    gripper: Path, taxels: Taxels, xacro: Path | None, link: tuple[str, ...], mounts: list[Mount]
) -> list[SensorModule]:
    """Return the modules of the chosen kind in the maker's model of the hand; none without such a model.

    Raises:
        InvalidValueError: The options contradict one another, or the model does not have modules of one chosen kind.
    """
    if xacro is None:
        if link:
            raise InvalidValueError("--link pairs a link of the model that --xacro names: expected --xacro too")
        return []
    import paxisim

    pairs = {name: body for name, _, body in (pair.partition("=") for pair in link)}
    if (
        mounts
        or (taxels.rows, taxels.cols, taxels.pitch_mm) != (None, None, None)
        or ((taxels.pool, taxels.subdivide) != (1, 1))
    ):
        raise InvalidValueError(
            "--xacro says where the taxels are: expected no --mount, grid, --pool or --subdivide with it"
        )
    if not all(pairs.values()):
        raise InvalidValueError(f"--link must be LINK=BODY, got {' '.join(link)!r}")
    modules = paxisim.sensor_modules(gripper, xacro, pairs)
    kinds = {(module.layout.rows, module.layout.cols) for module in modules}
    if taxels.sensor is not None:
        product = paxisim.sensor(taxels.sensor)
        kinds &= {(product.rows, product.cols)}
    if len(kinds) != 1:
        found = Counter(f"{module.layout.rows}x{module.layout.cols}" for module in modules)
        there = ", ".join(f"{count} modules of {kind} taxels" for kind, count in found.items())
        raise InvalidValueError(
            f"{xacro} has {there}, and one tensor holds one kind: choose one of these with --sensor (`paxisim sensors` "
            "lists the products)"
        )
    return [module for module in modules if (module.layout.rows, module.layout.cols) in kinds]


def _refuse_other_pads(gripper: Path, layout: TaxelLayout) -> None:
    """Refuse a gripper that already has pads of another shape, before the slow search for mounts.

    Raises:
        InvalidValueError: The gripper has such pads, or its file cannot be read.
    """
    from paxisim.models import names
    from paxisim.models.load import load_spec

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # `attach` reads the file again and warns then
        spec = load_spec(gripper)  # keep a reference: its elements do not outlive it
    shapes: dict[str, tuple[int, int]] = {}
    for match in filter(None, (names.TAXEL.match(geom.name) for geom in spec.geoms)):
        shape = (int(match["row"]) + 1, int(match["col"]) + 1)
        shapes[match["pad"]] = max(shape, shapes.get(match["pad"], shape))
    others = ", ".join(f"{pad} {r}x{c}" for pad, (r, c) in shapes.items() if (r, c) != (layout.rows, layout.cols))
    if others:
        raise InvalidValueError(
            f"{gripper} has pads of another shape already ({others}), and one tensor cannot hold them together with "
            f"pads of {layout.rows}x{layout.cols}: use the gripper without pads, or choose taxels of that shape"
        )
