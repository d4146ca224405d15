"""The commands ``paxisim scene compose``, ``paxisim scene init`` and ``paxisim scene make``."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Annotated, Literal

import tyro

from paxisim.cli.output import TERMINAL_COLUMNS, check_output, progress, write_output
from paxisim.cli.taxels import Taxels


def scene_init(
    model: Annotated[Path, tyro.conf.Positional],
    *,
    recording: Path,
    opening: str = "",
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    force: bool = False,
) -> None:
    """Write a first version of the scene file for a recording.

    A scene file states which recorded stream moves which joint, body or actuator of a model with pads. The command
    guesses this from the names, ranges and encoder steps of the streams. It prints what to check, and repeats the list
    at the top of the file.

    For example:

    paxisim scene init gripper.xml --recording squeeze.mcap -o squeeze.toml

    Args:
        model: MJCF file with pads, as `paxisim attach` writes it.
        recording: Recording to replay.
        opening: Stream that is the opening of the gripper, the distance between its pads; default: as its name says.
        output: Output file, .toml; default: the name of the model, with .toml.
        force: Overwrite the output if it exists.
    """
    import os

    from paxisim.recording import Recording
    from paxisim.scene.guess import guess_scene
    from paxisim.scene.toml import format_scene

    path = model.with_suffix(".toml") if output is None else output
    check_output(path, force, ".toml")
    progress(f"reading {recording}")
    guessed = guess_scene(model, Recording.load(recording), _raw_covariates(recording), opening)
    relative = Path(os.path.relpath(model.absolute(), path.absolute().parent)).as_posix()
    comments = [f"# {line}" for line in ("Which recorded stream moves what. To check:", *guessed.open)]
    write_output(path, "\n".join(comments) + "\n" + format_scene(guessed.scene, relative), force)
    for line in guessed.found:
        print(textwrap.fill(line, TERMINAL_COLUMNS, subsequent_indent="  "))
    for line in guessed.open:
        print(textwrap.fill(f"to check: {line}", TERMINAL_COLUMNS, subsequent_indent="  "))
    print(f"{path}: {len(guessed.scene.drives)} drives")


def _raw_covariates(path: Path):
    """Return the covariates of an MCAP file on their own clocks; None for other files, whose streams share one."""
    if path.suffix.lower() != ".mcap":
        return None
    from paxisim.logs import schemas
    from paxisim.logs.mcap_reader import read_log

    streams = read_log(path).streams
    return {
        name.removeprefix(schemas.COVARIATE): stream.values
        for name, stream in streams.items()
        if name.startswith(schemas.COVARIATE)
    }


def scene_make(
    kind: Annotated[Literal["indenter", "gripper", "peg"], tyro.conf.Positional],
    taxels: tyro.conf.OmitArgPrefixes[Taxels],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
    *,
    force: bool = False,
) -> None:
    """Write a ready-made scene: an indenter on one pad, a gripper in the air, or a gripper with a peg.

    For example:

    paxisim scene make indenter --sensor paxini-gen1-l4629 --pool 2 -o press.toml

    Args:
        kind: Kind of scene: indenter is moved by the streams x, y and depth, gripper and peg by the stream opening.
        taxels: The pad's taxels.
        output: Output file, .toml; the MJCF gets the same name, with .xml.
        force: Overwrite both files if they exist.
    """
    from paxisim.scene import ready

    check_output(output, force, ".toml")
    check_output(output.with_suffix(".xml"), force)
    layout = taxels.layout()
    scene = ready.indenter(layout) if kind == "indenter" else ready.gripper(layout, peg=kind == "peg")
    scene.save(output)
    streams = ", ".join(dict.fromkeys(drive.stream for drive in scene.drives))
    print(f"{output} and {output.with_suffix('.xml')}: moved by {streams} (m)")


def scene_compose(
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
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
        object: An object that is free to move, once per object: box:AxBxCmm:MASSkg, cylinder:DIAMETERxHEIGHTmm:MASSkg
            or ball:DIAMETERmm:MASSkg. Objects stand in a row on the table; @X,Y,Z behind one is its centre in m.
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
