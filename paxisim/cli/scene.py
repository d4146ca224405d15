"""The commands ``paxisim scene compose``, ``paxisim scene make`` and ``paxisim scene object``."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Annotated, Literal

import tyro

from paxisim.cli.output import TERMINAL_COLUMNS, check_output, write_output
from paxisim.cli.taxels import Taxels


def scene_make(
    kind: Annotated[Literal["indenter", "gripper", "peg"], tyro.conf.Positional],
    taxels: tyro.conf.OmitArgPrefixes[Taxels],
    *,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    force: bool = False,
) -> None:
    """Write a ready-made scene: an indenter on one pad, a gripper in the air, or a gripper with a peg.

    For example:

    paxisim scene make indenter --sensor paxini-gen1-l4629 --pool 2 -o press.toml

    Args:
        kind: Kind of scene: indenter is moved by the streams x, y and depth, gripper and peg by the stream opening.
        taxels: The pad's taxels.
        output: Output file, .toml; default: the kind, with .toml. The MJCF gets the same name, with .xml.
        force: Overwrite both files if they exist.
    """
    from paxisim.scene import ready

    output = Path(f"{kind}.toml") if output is None else output
    check_output(output, force, ".toml")
    check_output(output.with_suffix(".xml"), force)
    layout = taxels.layout()
    scene = ready.indenter(layout) if kind == "indenter" else ready.gripper(layout, peg=kind == "peg")
    scene.save(output)
    streams = ", ".join(dict.fromkeys(drive.stream for drive in scene.drives))
    print(f"{output} and {output.with_suffix('.xml')}: moved by {streams} (m)")


def scene_compose(
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("scene.xml"),
    arm: Path | None = None,
    at: str = "",
    hand: Path | None = None,
    table: str | None = None,
    object: tyro.conf.UseAppendAction[tuple[str, ...]] = (),
    force: bool = False,
) -> None:
    """Compose the model of a scene from the files of an arm and a hand, with a table and objects.

    All names stay as they are in the files. If the arm and the hand share one, all names of the hand get a prefix, and
    the command says so. Put pads on the result with `paxisim attach`, or give a hand that has them.

    For example:

    paxisim scene compose --arm arm.xml --at flange --hand hand.xml --table 0.4,0,0 --object box:9x9x9mm:1kg -o a.xml

    paxisim scene compose --hand hand.xml --table 0,0,-0.3 --object ball:40mm:0.1kg@0,0,-0.15 -o scene.xml

    Args:
        arm: MJCF or URDF file of the arm, which may have a hand already.
        at: Body or site of the arm that carries the hand.
        hand: MJCF or URDF file of the hand or gripper; without an arm it is where its file puts it.
        table: Middle of the table's top, X,Y,Z in m. The table is 0.6 m x 0.6 m.
        object: An object that is free to move, once per object: box:AxBxCmm:MASSkg, cylinder:DIAMETERxHEIGHTmm:MASSkg,
            ball:DIAMETERmm:MASSkg or mesh:FILE:MASSkg (.stl, .obj, .ply). Objects stand in a row on the table; @X,Y,Z
            behind one is its centre in m.
        output: Output MJCF file, .xml.
        force: Overwrite the output if it exists.
    """
    import paxisim
    from paxisim.models.tabletop import parse_point

    check_output(output, force, ".xml")
    top = None if table is None else parse_point(table, table)
    scene = paxisim.compose_scene(arm, hand, at=at, table=top, objects=object)
    write_output(output, scene.to_xml(output.absolute().parent), force)
    for line in scene.report.splitlines():
        print(textwrap.fill(line, TERMINAL_COLUMNS, subsequent_indent="  ", break_on_hyphens=False))
    print(f"{output} is written; next: paxisim attach {output} --help")


def scene_object(
    recording: Annotated[Path, tyro.conf.Positional],
    *,
    opening: str,
    unit: Literal["m", "mm", "um"] = "m",
    modulus_kpa: float | None = None,
) -> None:
    """Find out which shape a hand holds, and how thick it is: a start for --object of `paxisim scene compose`.

    The opening of the gripper gives the thickness. With it as diameter, the command compares how a box, a cylinder and
    a ball would distribute the force over the taxels with what both pads measured while they held the object.

    For example:

    paxisim scene object grasps.mcap --opening gripper_width

    Args:
        recording: Recording of two opposite pads with at least one grasp (.mcap, .npz, .csv).
        opening: Covariate with the distance between the surfaces of the pads.
        unit: Unit of the opening.
        modulus_kpa: Modulus of the pads' soft layer in kPa; default: that of a scene.
    """
    import paxisim
    from paxisim.recording import Recording

    modulus = None if modulus_kpa is None else 1e3 * modulus_kpa
    found = paxisim.fit_object(Recording.load(recording), opening, unit=unit, modulus=modulus)
    for line in str(found).splitlines():
        print(textwrap.fill(line, TERMINAL_COLUMNS, subsequent_indent="  ", break_on_hyphens=False))
