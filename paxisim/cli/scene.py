"""The ``paxisim scene init`` and ``paxisim scene make`` commands."""

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
    guessed = guess_scene(model, Recording.load(recording), _raw_covariates(recording))
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
