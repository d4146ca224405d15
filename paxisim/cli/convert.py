"""The ``paxisim convert`` command."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from paxisim.cli.output import TERMINAL_COLUMNS, check_folder, check_output, progress

if TYPE_CHECKING:
    from paxisim.recording import Recording

_SUFFIXES = (".parquet", ".npz", ".mcap", ".csv")


def convert(
    recording: Annotated[Path, tyro.conf.Positional],
    output: Annotated[Path | None, tyro.conf.Positional] = None,
    *,
    align: Literal["linear", "nearest", "previous"] = "linear",
    missing: Literal["nan", "drop"] = "nan",
    profile: str | None = None,
    axes: tuple[str, ...] = (),
    pads: tuple[str, ...] = (),
    topics: tuple[str, ...] = (),
    names: tuple[str, ...] = (),
    rate: float | None = None,
    start: str | None = None,
    streams: tuple[Path, ...] = (),
    lerobot: Path | None = None,
    task: str | None = None,
    fps: int | None = None,
    state: tuple[str, ...] = (),
    action: tuple[str, ...] = (),
    force: bool = False,
) -> None:
    """Convert a recording to Parquet, CSV, npz or MCAP, or to a LeRobotDataset.

    The suffix of the output file selects the format. Streams with their own clock are interpolated between their
    samples, never extrapolated. Parquet and CSV store one column per value: tactile.PAD.ROW_COL.AXIS, timestamp,
    frame_index, episode_index and so on.

    For example:

    paxisim convert press.mcap press.parquet

    paxisim convert press.mcap paired.mcap --streams joints.mcap

    paxisim convert press.mcap --lerobot press-lerobot --task "press the ball"

    Args:
        recording: Recording: .mcap, .npz, .parquet, .csv, .txt (AnySkin) or .hdf5 (robosuite, robomimic, ACT).
            Or a bag of ROS (.bag, .db3, .mcap or folder), or the folder of a LeRobotDataset (v3).
        output: Output file: .parquet, .csv, .npz or .mcap.
        align: Interpolation of streams with their own clock.
        missing: What to do with unknown values: write NaN, or drop the sample.
            In a LeRobotDataset, a dropped frame ends the episode.
        profile: Profile of the sensor (name or file), needed for a CSV file of a board.
            It holds the order and the signs of the taxels.
        axes: Axes of features of a LeRobotDataset, topics or arrays as NAME=AXES, e.g. observation.touch=rows,cols,xyz.
            Words: rows,cols or taxels, with xyz and pads if the feature has them. Makes pads of any feature.
        pads: Names of the pads to keep; default: all.
        topics: Tactile topics of a bag of ROS, if they cannot be recognised.
        names: Keys of an npz archive of another program as NAME=KEY, e.g. measured=tactile time=t.
            NAME is time, measured, simulated, episode or that of a covariate.
        rate: Samples per second of a recording that has no times.
        start: Date and time of the first sample, e.g. 2026-10-04T23:15:05+02:00, if the recording does not state it.
            Needed to add streams with absolute times.
        streams: Files with more streams of the same motion, such as joint positions.
            Possible are .mcap (ROS 2 or JSON messages), bags of ROS, .csv, .hdf5, and LeRobot's .parquet or folder.
        lerobot: Folder for a LeRobotDataset (v3.0); it must not exist yet.
        task: Task description in the LeRobotDataset; default: the recording's own.
        fps: Frames per second of the LeRobotDataset; default: the recording's rate, rounded.
            A recording with another rate, or an irregular one, is resampled.
        state: Covariates that make up observation.state.
            Default: all covariates with one number or one row of numbers per sample, except those in action.
        action: Covariates that make up action; default: action, actions and action.NAME.
        force: Overwrite the output file if it exists. A folder is never overwritten.
    """
    from paxisim.errors import InvalidValueError
    from paxisim.recording import Recording

    if (output is None) == (lerobot is None):
        raise InvalidValueError(
            "the output is either a file or, with --lerobot DIR, a LeRobotDataset: expected one of the two, "
            + ("got neither" if output is None else f"got {output} and {lerobot}")
        )
    for_lerobot = {"task": task, "fps": fps, "state": state, "action": action}
    if output is not None:
        _check_file(output, force, [name for name, value in for_lerobot.items() if value not in (None, ())])
    if lerobot is not None:
        _check_dataset(lerobot)
    known: Any = None
    if profile is not None:
        from paxisim.hw.profiles.load import load_profile

        known = load_profile(profile)
    progress(f"reading {recording}")
    loaded = Recording.load(
        recording,
        align=align,
        missing="nan" if lerobot else missing,
        profile=known,
        axes=_pairs("--axes", "FEATURE=AXES, e.g. observation.touch=rows,cols,xyz", axes),
        pads=pads or None,
        topics=topics,
        names=_pairs("--names", "NAME=KEY, e.g. measured=tactile", names),
        rate=rate,
        start=start,
        streams=streams,
    )
    progress(f"writing {output or lerobot}")
    if lerobot is not None:
        from paxisim.logs.lerobot_writer import write_lerobot

        said = write_lerobot(lerobot, loaded.to_arrays(), align=align, drop=missing == "drop", **for_lerobot)
    else:
        assert output is not None
        _write_file(output, loaded)
        said = repr(loaded)
    print(
        textwrap.fill(f"{output or lerobot}: {said}", TERMINAL_COLUMNS, subsequent_indent="  ", break_on_hyphens=False)
    )


def _pairs(option: str, form: str, words: tuple[str, ...]) -> dict[str, str]:
    from paxisim.errors import InvalidValueError

    pairs = {name: value for name, _, value in (word.rpartition("=") for word in words)}
    if len(pairs) < len(words) or "" in pairs:
        raise InvalidValueError(f"{option} must be {form}, with different names; got {' '.join(words)}")
    return pairs


def _check_file(output: Path, force: bool, not_for_it: list[str]) -> None:
    from paxisim.errors import InvalidValueError

    if not_for_it:
        raise InvalidValueError(f"--{not_for_it[0]} is for a LeRobotDataset, give --lerobot DIR; {output} is a file")
    if output.suffix.lower() not in _SUFFIXES:
        raise InvalidValueError(f"the output must end in .parquet, .csv, .npz or .mcap, got {output}")
    check_output(output, force)
    if output.suffix.lower() == ".parquet":
        from paxisim.logs.parquet import require_pyarrow

        require_pyarrow()


def _check_dataset(folder: Path) -> None:
    from paxisim.files import refuse_existing
    from paxisim.logs.parquet import require_pyarrow

    refuse_existing(folder)
    check_folder(folder)
    require_pyarrow()


def _write_file(output: Path, recording: Recording) -> None:
    if output.suffix.lower() == ".parquet":
        from paxisim.logs.parquet import write_parquet

        write_parquet(output, recording.to_arrays())
    elif output.suffix.lower() == ".csv":
        from paxisim.logs.csv_writer import write_csv

        write_csv(output, recording.to_arrays())
    else:
        recording.save(output)
