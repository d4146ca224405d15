"""The ``paxisim plot`` command."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from paxisim.cli.output import check_output, named_after, progress, size_text
from paxisim.cli.stages import Stages

if TYPE_CHECKING:
    from paxisim.recording import Recording


def plot(
    recording: Annotated[Path, tyro.conf.Positional],
    *,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    force: bool = False,
) -> None:
    """Film a recording: its pads, and the total normal force over time.

    Normal force is colour and shear is arrows; measured and simulated pads have the same scale. The film runs in real
    time, for up to 60 s. To see the scene as well, use `paxisim replay --film`.

    For example:

    paxisim plot press.mcap -o press.gif

    Args:
        recording: Recording: .mcap, .npz, .parquet, .csv or .hdf5.
        output: Output file, .mp4, .gif or .webp; default: the name of the recording, with .gif.
        force: Overwrite the output if it exists.
    """
    from paxisim.recording import Recording
    from paxisim.viz.film import check_film, film_recording

    output = named_after(recording, ".gif") if output is None else output
    check_film(output)
    check_output(output, force)
    progress(f"reading {recording}")
    loaded = Recording.load(recording)
    with Stages() as stages:
        seconds = film_recording(output, loaded, progress=lambda share: stages("filming", share))
    print_film(output, loaded, seconds)


def print_film(path: Path, recording: Recording, seconds: float) -> None:
    """Print the length and the size of a film, and whether it shows the whole recording."""
    from paxisim.viz.film import LONGEST

    part = f", the first of {recording.duration:.0f} s" if recording.duration > LONGEST else ""
    print(f"{path}: {seconds:.1f} s{part}, {size_text(path.stat().st_size)}")
