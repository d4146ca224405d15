"""The ``paxisim attach`` command."""

from __future__ import annotations

import textwrap
import warnings
from pathlib import Path
from typing import Annotated, Literal

import tyro

from paxisim.cli.mounts import format_mount, parse_mount
from paxisim.cli.output import TERMINAL_COLUMNS, check_output, png, progress, write_output
from paxisim.cli.taxels import Taxels
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout

_INDENTED = "\n" + " " * len("  --mount '")


def attach(
    gripper: Annotated[Path, tyro.conf.Positional],
    taxels: tyro.conf.OmitArgPrefixes[Taxels],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
    *,
    mount: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    picture: Path | None = None,
    thickness_mm: float = 1.0,
    sensors: Literal["none", "contact", "touch_grid"] = "none",
    force: bool = False,
) -> None:
    """Put tactile pads on a gripper and write the result as MJCF.

    The command recognises robosuite's grippers by their file name. On any other gripper, it closes the actuators and
    puts the pads where the fingers meet. It prints the mounts it chose and draws a picture of the result.

    For example:

    paxisim attach my_gripper.xml --sensor paxini-gen1-l4629 --pool 2 -o tactile_gripper.xml

    Args:
        gripper: The gripper's MJCF file.
        taxels: The pad's taxels.
        output: Output MJCF file, .xml.
        mount: Where to put a pad, once per pad, in the format that this command prints:
            'BODY pos-mm=X,Y,Z quat=W,X,Y,Z replaces=GEOM,GEOM name=NAME'.
        picture: Picture of the gripper with its pads, .png; default: the name of the output, with .png.
        thickness_mm: Thickness of the taxels in mm.
        sensors: MuJoCo sensors to embed; paxisim's own reader needs none.
        force: Overwrite the outputs if they exist.
    """
    import paxisim

    picture = output.with_suffix(".png") if picture is None else picture
    check_output(output, force, ".xml")
    check_output(picture, force, ".png")
    layout = taxels.layout()
    _refuse_other_pads(gripper, layout)
    pad = paxisim.Pad(
        layout,
        thickness=thickness_mm * 1e-3,
        mass=taxels.mass,
        sensors=None if sensors == "none" else sensors,
    )
    progress("attaching" if mount else "closing the gripper to see where its fingers meet")
    tactile = paxisim.attach(gripper, pad, [parse_mount(text) for text in mount] or None)
    model = tactile.to_xml(output.absolute().parent)
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
        print("\nTo change the mounts, edit these options and run the command with them:")
        for chosen in tactile.mounts:
            line = f"  --mount '{format_mount(chosen)}'"
            print(line if len(line) <= TERMINAL_COLUMNS else f"  --mount '{format_mount(chosen, _INDENTED)}'")
        print()
    pads = len(tactile.pad_names)
    print(f"{output}: {pads} pad{'s' * (pads > 1)} of {pad.layout.rows}x{pad.layout.cols} taxels")
    if missing is not None:
        print(f"no picture: {missing}")
        return
    write_output(picture, drawn, force)
    print(f"{picture}: the gripper with its pads, taxel (0, 0) of each pad white")


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
