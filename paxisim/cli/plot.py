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
    pads: tuple[str, ...] = (),
    force: bool = False,
) -> None:
    """Film a recording, or draw its strongest moment: its pads, and the total normal force over time.

    Normal force is colour and shear is arrows; measured and simulated pads have the same scale. The film runs in real
    time, for up to 60 s. A picture (.png) shows the sample with the largest total normal force. To see the scene as
    well, use `paxisim replay --film`.

    For example:

    paxisim plot press.mcap -o press.gif

    paxisim plot press.mcap -o press.png --pads left

    Args:
        recording: Recording: .mcap, .npz, .parquet, .csv or .hdf5.
        output: Output file, .mp4, .gif, .webp or .png; default: the name of the recording, with .gif.
        pads: Names of the pads to show; default: all.
        force: Overwrite the output if it exists.
    """
    from paxisim.recording import Recording
    from paxisim.viz.film import PICTURE, check_film, film_recording, picture_recording

    output = named_after(recording, ".gif") if output is None else output
    is_picture = output.suffix.lower() == PICTURE
    if not is_picture:
        check_film(output, PICTURE)
    check_output(output, force)
    progress(f"reading {recording}")
    loaded = Recording.load(recording)
    loaded = loaded.select(pads=pads) if pads else loaded
    if is_picture:
        at = picture_recording(output, loaded)
        print(f"{output}: the sample at {at:.2f} s, {size_text(output.stat().st_size)}")
        return
    with Stages() as stages:
        seconds = film_recording(output, loaded, progress=lambda share: stages("filming", share))
    print_film(output, loaded, seconds)


def print_film(path: Path, recording: Recording, seconds: float) -> None:
    """Print the length and the size of a film, and whether it shows the whole recording."""
    from paxisim.viz.film import LONGEST

    part = f", the first of {recording.duration:.0f} s" if recording.duration > LONGEST else ""
    print(f"{path}: {seconds:.1f} s{part}, {size_text(path.stat().st_size)}")
