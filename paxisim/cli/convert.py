"""``paxisim convert``."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro

from paxisim.cli.output import WIDTH, check_output, progress


def convert(
    recording: Annotated[Path, tyro.conf.Positional],
    output: Annotated[Path, tyro.conf.Positional],
    *,
    align: Literal["linear", "nearest", "previous"] = "linear",
    missing: Literal["nan", "drop"] = "nan",
    profile: str | None = None,
    pads: tuple[str, ...] = (),
    streams: tuple[Path, ...] = (),
    force: bool = False,
) -> None:
    """Write a recording as Parquet, npz or MCAP, by the suffix of the output.

    Streams at other times than the measured tensors are interpolated between their own samples, never beyond them.
    Parquet has a column a number: tactile.PAD.ROW_COL.AXIS, timestamp, frame_index, episode_index ...

    For example:

    paxisim convert press.mcap press.parquet

    paxisim convert press.mcap paired.mcap --streams joints.mcap

    Args:
        recording: An .mcap, .npz, .parquet or .hdf5 file (robosuite, robomimic), or a board's or a plain .csv.
        output: The file to write: .parquet, .npz or .mcap.
        align: How streams at other times are interpolated.
        missing: Where a stream is not known: write NaN, or leave the sample out.
        profile: For a board's CSV: the sensor's profile, by its name or file; it says the taxels' order and signs.
        pads: Only these pads, by their names in the file.
        streams: Files with more streams of the same motion, such as joint positions: an .mcap of ROS 2 or with JSON,
            a .csv, LeRobot's .parquet, an .hdf5.
        force: Overwrite the output if it exists.
    """
    from paxisim.errors import InvalidValueError
    from paxisim.recording import Recording

    if output.suffix.lower() not in (".parquet", ".npz", ".mcap"):
        raise InvalidValueError(f"a recording is converted to .parquet, .npz or .mcap, got {output}")
    check_output(output, force)
    if output.suffix.lower() == ".parquet":
        from paxisim.logs.parquet import require_pyarrow

        require_pyarrow()
    known: Any = None
    if profile is not None:
        from paxisim.hw.profile import load_profile

        known = load_profile(profile)
    progress(f"reading {recording}")
    loaded = Recording.load(recording, align=align, missing=missing, profile=known, pads=pads or None, streams=streams)
    progress(f"writing {output}")
    if output.suffix.lower() == ".parquet":
        from paxisim.logs.parquet import write_parquet

        write_parquet(output, loaded.to_aligned())
    else:
        loaded.save(output)
    print(textwrap.fill(f"{output}: {loaded!r}", WIDTH, subsequent_indent="  ", break_on_hyphens=False))
