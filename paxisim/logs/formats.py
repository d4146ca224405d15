"""The file formats of recordings: how each is recognised, and what reads it.

A new format is a function that reads a `RecordingArrays` from a path, one that reads its streams, and a line in
`FORMATS`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs import schemas
from paxisim.logs.about import covariate_shapes
from paxisim.logs.add_streams import Streams, streams_of_table
from paxisim.logs.clock import put_in_order, timed
from paxisim.logs.columns import from_columns, streams_from_columns, take_covariates
from paxisim.logs.recording_arrays import CountsToForce, Method, RecordingArrays

if TYPE_CHECKING:
    from paxisim.logs.topic_streams import TopicStreams


@dataclass(frozen=True)
class Options:
    """How to read a recording; see `paxisim.Recording.load`."""

    align: Method | Mapping[str, Method] = "linear"
    max_gap: float | None = None
    layout: TaxelLayout | None = None
    pads: tuple[str, ...] | None = None
    profile: CountsToForce | None = None
    axes: Mapping[str, str] = field(default_factory=dict)
    topics: tuple[str, ...] = ()
    names: Mapping[str, str] = field(default_factory=dict)
    rate: float | None = None
    start: float | None = None


@dataclass(frozen=True)
class Format:
    """A file format.

    Attributes:
        name: What it is called in messages.
        is_of: Whether a path has this format, by its name or kind.
        read: Reads a recording. A result whose fields are not checked yet may hold more than the requested pads.
        streams: Reads the streams to add to another recording; None if such files have none.
        has_counts: Whether it may hold a board's counts, which a profile converts.
        has_features: Whether it consists of named arrays, whose axes the caller may state.
        has_topics: Whether it has topics, among which the caller may choose the tactile ones.
        may_be_renamed: Whether its arrays may have other names, which the caller states.
        may_lack_times: Whether it may have samples without times, whose rate the caller then states.
    """

    name: str
    is_of: Callable[[Path], bool]
    read: Callable[[Path, Options], RecordingArrays]
    streams: Callable[[Path], Streams] | None
    has_counts: bool = False
    has_features: bool = False
    has_topics: bool = False
    may_be_renamed: bool = False
    may_lack_times: bool = False


def format_of(path: Path, *, streams: bool = False) -> Format:
    """Return the format of a file or folder.

    Args:
        path: The file or folder; it need not exist.
        streams: Whether streams are to be read from it.

    Raises:
        InvalidValueError: There is no such format.
    """
    known = [form for form in FORMATS if form.streams is not None or not streams]
    found = next((form for form in known if form.is_of(path)), None)
    if found is None:
        what = "streams must come from" if streams else "a recording must be"
        *names, last = (form.name for form in known)
        raise InvalidValueError(f"{what} a {', '.join(names)} or {last}, got {path}")
    return found


def _with_suffix(*suffixes: str) -> Callable[[Path], bool]:
    return lambda path: path.suffix.lower() in suffixes


def _read_lerobot(path: Path, options: Options) -> RecordingArrays:
    from paxisim.logs.lerobot_pads import features_in_words
    from paxisim.logs.lerobot_reader import read_lerobot

    found = read_lerobot(path, options.pads, options.axes, options.layout)
    if found.measured is None and found.simulated is None:
        raise InvalidValueError(
            f"{path} has no tactile feature{'' if options.pads is None else ' of those pads'}: expected one such as "
            f"observation.tactile.PAD of shape (3, rows, cols) or components such as PAD.f0.p00.fx, got "
            f"{features_in_words(path)}; choose one with axes (paxisim convert --axes FEATURE=rows,cols,xyz), or add "
            "them to another recording with streams (paxisim convert --streams)"
        )
    return _laid_out(found, options)


def _lerobot_streams(path: Path) -> Streams:
    from paxisim.logs.lerobot_reader import read_lerobot

    return streams_of_table(path, read_lerobot(path, pads=()), restarts=True)


def _read_eflesh(path: Path, options: Options) -> RecordingArrays:
    from paxisim.logs.eflesh import read_eflesh

    return _laid_out(read_eflesh(path, options.align, options.max_gap), options)


def _read_anyskin(path: Path, options: Options) -> RecordingArrays:
    from paxisim.logs.anyskin import read_anyskin

    return _laid_out(read_anyskin(path, options.rate), options)


def _read_csv(path: Path, options: Options) -> RecordingArrays:
    from paxisim.logs.csv import read_csv

    found, is_cut = read_csv(
        path, layout=options.layout, pads=options.pads, profile=options.profile, start=options.start
    )
    if is_cut:
        _warn_of_part(path, "cut off: its last line is incomplete", found)
    return found


def _csv_streams(path: Path) -> Streams:
    from paxisim.logs.csv_table import CsvTable

    csv = CsvTable(path)
    columns = csv.columns()
    if csv.is_cut:
        warnings.warn(f"{path} is cut off: its last line is incomplete and was skipped", stacklevel=4)
    known = take_covariates(columns, covariate_shapes(csv.comment)) if csv.is_ours else {}
    table = _table(path, columns)
    table = replace(table, covariates={**table.covariates, **known})
    return streams_of_table(path, table, restarts="time" not in columns)


def _read_npz(path: Path, options: Options) -> RecordingArrays:
    from paxisim.logs.npz import read_npz

    return _laid_out(read_npz(path, options.names, options.axes, options.rate, options.layout), options)


def _parquet_table(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    from paxisim.logs.parquet import read_parquet

    columns, about = read_parquet(path)
    return (columns if about else put_in_order(path, timed(path, columns))), about


def _read_parquet(path: Path, options: Options) -> RecordingArrays:
    columns, about = _parquet_table(path)
    try:
        found = from_columns(columns)
    except InvalidValueError as error:
        dataset = path.absolute().parent.parent.parent
        is_part = (dataset / "meta/info.json").is_file()
        advice = f"; it is a part of the LeRobotDataset {dataset}, load that folder" if is_part else ""
        raise InvalidValueError(f"{path}: {error}{advice}") from error
    covariates = {**found.covariates, **about.get("covariates", {})}
    return _laid_out(replace(found, **about | {"covariates": covariates}), options)


def _parquet_streams(path: Path) -> Streams:
    columns, about = _parquet_table(path)
    table = _table(path, columns)
    table = replace(table, covariates={**table.covariates, **about.get("covariates", {})})
    return streams_of_table(path, table, restarts="time" not in columns)


def _read_hdf5(path: Path, options: Options) -> RecordingArrays:
    from paxisim.logs.hdf5 import read_hdf5

    found = read_hdf5(path, options.axes, options.rate, options.layout)
    if found.measured is None and found.simulated is None:
        raise InvalidValueError(
            f"{path} has no tensor: expected a dataset of shape (T, pads, 3, rows, cols) in obs, or one with 'tactile' "
            "in its name in observations; to add the other streams to a recording that has one, use streams (paxisim "
            "convert --streams)"
        )
    return _laid_out(found, options)


def _hdf5_streams(path: Path) -> Streams:
    from paxisim.logs.hdf5 import read_hdf5

    return streams_of_table(path, read_hdf5(path), restarts=True)


def _read_mcap(path: Path, options: Options) -> RecordingArrays:
    from paxisim.logs.mcap_reader import is_recording, read_log
    from paxisim.logs.mcap_topics import read_topics
    from paxisim.logs.resample import resample_log

    if not is_recording(path):
        return _read_topics(read_topics(path), options)
    if options.topics or options.axes:
        raise InvalidValueError(f"{path} is a recording of paxisim, whose tactile topics and axes are known")
    log = read_log(path)
    found = resample_log(log, options.align, options.max_gap)
    if not log.complete:
        _warn_of_part(path, "cut off or damaged", found)
    return _laid_out(found, options)


def _read_bag(path: Path, options: Options) -> RecordingArrays:
    from paxisim.logs.ros_bags import read_bag

    return _read_topics(read_bag(path), options)


def _read_topics(found: TopicStreams, options: Options) -> RecordingArrays:
    from paxisim.logs.resample import resample_log
    from paxisim.logs.ros_tactile import tactile_log

    log = tactile_log(found, options.topics, options.axes, options.pads, options.layout, options.max_gap)
    return _laid_out(resample_log(log, options.align, options.max_gap), options)


def _bag_streams(path: Path) -> Streams:
    from paxisim.logs.ros_bags import read_bag

    return Streams({name: {None: stream} for name, stream in read_bag(path).streams().items()})


def _is_bag(path: Path) -> bool:
    from paxisim.logs.ros_bags import is_bag

    return is_bag(path)


def _mcap_streams(path: Path) -> Streams:
    from paxisim.logs.mcap_reader import is_recording, read_log
    from paxisim.logs.mcap_topics import read_topics

    if not is_recording(path):
        return Streams({name: {None: stream} for name, stream in read_topics(path).streams().items()})
    log = read_log(path)
    if not log.complete:
        warnings.warn(f"{path} is cut off or damaged; the intact part was read", stacklevel=4)
    prefix = schemas.COVARIATE
    found = {name.removeprefix(prefix): stream for name, stream in log.streams.items() if name.startswith(prefix)}
    if not found:
        raise InvalidValueError(f"{path} is a recording without covariates, so there is no stream to add")
    return Streams({name: {None: stream} for name, stream in found.items()})


def _is_eflesh(path: Path) -> bool:
    from paxisim.logs.eflesh import is_eflesh

    return is_eflesh(path)


def _laid_out(found: RecordingArrays, options: Options) -> RecordingArrays:
    return found if options.layout is None else replace(found, layout=options.layout)


def _table(path: Path, columns: dict[str, NDArray[Any]]) -> RecordingArrays:
    try:
        return streams_from_columns(columns)
    except InvalidValueError as error:
        raise InvalidValueError(f"{path}: {error}") from error


def _warn_of_part(path: Path, what: str, found: RecordingArrays) -> None:
    samples = f"{len(found.time)} sample{'s' * (len(found.time) != 1)}"
    text = f"{path} is {what}; the intact part was read: {samples}, the last at {found.time[-1]:.3f} s"
    warnings.warn(text, stacklevel=5)  # at the caller of Recording.load


FORMATS = (
    Format("bag of ROS (.bag, .db3 or folder)", _is_bag, _read_bag, _bag_streams, has_features=True, has_topics=True),
    Format("LeRobotDataset folder", Path.is_dir, _read_lerobot, _lerobot_streams, has_features=True),
    Format("sensor.csv beside states.csv (eFlesh)", _is_eflesh, _read_eflesh, None),
    Format(".txt (AnySkin)", _with_suffix(".txt"), _read_anyskin, None, may_lack_times=True),
    Format(".csv", _with_suffix(".csv", ".tsv"), _read_csv, _csv_streams, has_counts=True),
    Format(".npz", _with_suffix(".npz"), _read_npz, None, has_features=True, may_be_renamed=True, may_lack_times=True),
    Format(".parquet", _with_suffix(".parquet"), _read_parquet, _parquet_streams),
    Format(".hdf5", _with_suffix(".h5", ".hdf5"), _read_hdf5, _hdf5_streams, has_features=True, may_lack_times=True),
    Format(".mcap file", _with_suffix(".mcap"), _read_mcap, _mcap_streams, has_features=True, has_topics=True),
)
"""All formats; the first that recognises a path reads it."""
