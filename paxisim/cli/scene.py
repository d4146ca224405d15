"""``paxisim scene``."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Annotated, Literal

import tyro

from paxisim.cli.output import WIDTH, check_output, progress, write_output
from paxisim.cli.taxels import Taxels


def scene_init(
    model: Annotated[Path, tyro.conf.Positional],
    *,
    recording: Path,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    force: bool = False,
) -> None:
    """Write a first version of a recording's scene: which stream moves what in a model with pads.

    The command compares names, ranges and encoder steps of streams and joints. It prints what you should check, and
    writes it at the top of the file.

    For example:

    paxisim scene init gripper.xml --recording squeeze.mcap -o squeeze.toml

    Args:
        model: MJCF file with pads, as `paxisim attach` writes it.
        recording: Recording to be replayed.
        output: Output file, .toml; default: beside the model.
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
    comments = [f"# {line}" for line in ("Which recorded streams move what. To check:", *guessed.open)]
    write_output(path, "\n".join(comments) + "\n" + format_scene(guessed.scene, relative), force)
    for line in guessed.found:
        print(textwrap.fill(line, WIDTH, subsequent_indent="  "))
    for line in guessed.open:
        print(textwrap.fill(f"to check: {line}", WIDTH, subsequent_indent="  "))
    print(f"{path}: {len(guessed.scene.drives)} drives")


def _raw_covariates(path: Path):
    """The covariates of an MCAP file on their own clocks; nothing for other files, whose streams share one."""
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
        kind: indenter (streams x, y, depth), gripper or peg (stream opening).
        taxels: The pad's taxels.
        output: Output TOML file; the MJCF is written beside it, as .xml.
        force: Overwrite both if they exist.
    """
    from paxisim.scene import ready

    check_output(output, force, ".toml")
    check_output(output.with_suffix(".xml"), force)
    layout = taxels.layout()
    scene = ready.indenter(layout) if kind == "indenter" else ready.gripper(layout, peg=kind == "peg")
    scene.save(output)
    streams = ", ".join(dict.fromkeys(drive.stream for drive in scene.drives))
    print(f"{output} and {output.with_suffix('.xml')}: moved by {streams} (m)")
