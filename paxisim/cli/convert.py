"""``paxisim convert``."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from paxisim.cli.output import WIDTH, check_folder, check_output, progress

if TYPE_CHECKING:
    from paxisim.recording import Recording

_SUFFIXES = (".parquet", ".npz", ".mcap")


def convert(
    recording: Annotated[Path, tyro.conf.Positional],
    output: Annotated[Path | None, tyro.conf.Positional] = None,
    *,
    align: Literal["linear", "nearest", "previous"] = "linear",
    missing: Literal["nan", "drop"] = "nan",
    profile: str | None = None,
    pads: tuple[str, ...] = (),
    streams: tuple[Path, ...] = (),
    lerobot: Path | None = None,
    task: str | None = None,
    fps: int | None = None,
    state: tuple[str, ...] = (),
    action: tuple[str, ...] = (),
    force: bool = False,
) -> None:
    """Write a recording as Parquet, npz or MCAP, by the suffix of the output, or as a LeRobotDataset.

    Streams at other times than the measured tensors are interpolated between their own samples, never beyond them.
    Parquet has a column a number: tactile.PAD.ROW_COL.AXIS, timestamp, frame_index, episode_index ...

    For example:

    paxisim convert press.mcap press.parquet

    paxisim convert press.mcap paired.mcap --streams joints.mcap

    paxisim convert press.mcap --lerobot press-lerobot --task "press the ball"

    Args:
        recording: An .mcap, .npz, .parquet or .hdf5 file (robosuite, robomimic), a board's or a plain .csv, or the
            folder of a LeRobotDataset (v3).
        output: The file to write: .parquet, .npz or .mcap.
        align: How streams at other times are interpolated.
        missing: Where a stream is not known: write NaN, or leave the sample out. In a LeRobotDataset, what follows a
            frame that is left out is an episode of its own.
        profile: For a board's CSV: the sensor's profile, by its name or file; it says the taxels' order and signs.
        pads: Only these pads, by their names in the file.
        streams: Files with more streams of the same motion, such as joint positions: an .mcap of ROS 2 or with JSON,
            a .csv, LeRobot's .parquet or folder, an .hdf5.
        lerobot: Write a LeRobotDataset (v3.0) into this new folder: observation.tactile.PAD, observation.state, action.
        task: For LeRobot: what is done, in words; default: the recording's own task, if it has one.
        fps: For LeRobot: frames a second; default: the recording's rate, rounded. A recording that is not as regular
            is resampled.
        state: For LeRobot: the covariates of observation.state; default: every one that is a number or a row of
            numbers and not in action.
        action: For LeRobot: the covariates of action; default: action, actions and action.NAME.
        force: Overwrite the output file if it exists; a folder never is.
    """
    from paxisim.errors import InvalidValueError
    from paxisim.recording import Recording

    if (output is None) == (lerobot is None):
        raise InvalidValueError(
            "a recording is converted to a file or, with --lerobot DIR, to a LeRobotDataset: expected one of the two, "
            + ("got neither" if output is None else f"got {output} and {lerobot}")
        )
    for_lerobot = {"task": task, "fps": fps, "state": state, "action": action}
    if output is not None:
        _check_file(output, force, [name for name, value in for_lerobot.items() if value not in (None, ())])
    if lerobot is not None:
        _check_dataset(lerobot)
    known: Any = None
    if profile is not None:
        from paxisim.hw.profile import load_profile

        known = load_profile(profile)
    progress(f"reading {recording}")
    loaded = Recording.load(
        recording,
        align=align,
        missing="nan" if lerobot else missing,
        profile=known,
        pads=pads or None,
        streams=streams,
    )
    progress(f"writing {output or lerobot}")
    if lerobot is not None:
        from paxisim.logs.lerobot_writer import write_lerobot

        said = write_lerobot(lerobot, loaded.to_aligned(), align=align, drop=missing == "drop", **for_lerobot)
    else:
        assert output is not None
        _write_file(output, loaded)
        said = repr(loaded)
    print(textwrap.fill(f"{output or lerobot}: {said}", WIDTH, subsequent_indent="  ", break_on_hyphens=False))


def _check_file(output: Path, force: bool, not_for_it: list[str]) -> None:
    from paxisim.errors import InvalidValueError

    if not_for_it:
        raise InvalidValueError(f"--{not_for_it[0]} is for a LeRobotDataset, give --lerobot DIR; {output} is a file")
    if output.suffix.lower() not in _SUFFIXES:
        raise InvalidValueError(f"a recording is converted to .parquet, .npz or .mcap, got {output}")
    check_output(output, force)
    if output.suffix.lower() == ".parquet":
        from paxisim.logs.parquet import require_pyarrow

        require_pyarrow()


def _check_dataset(folder: Path) -> None:
    from paxisim.logs.atomic import refuse_existing
    from paxisim.logs.parquet import require_pyarrow

    refuse_existing(folder)
    check_folder(folder)
    require_pyarrow()


def _write_file(output: Path, recording: Recording) -> None:
    if output.suffix.lower() == ".parquet":
        from paxisim.logs.parquet import write_parquet

        write_parquet(output, recording.to_aligned())
    else:
        recording.save(output)
