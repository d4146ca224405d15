"""Loading and saving of recordings, with the format chosen by the file suffix."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.add_streams import Streams, add_streams
from paxisim.logs.checks import check_fields, check_rate
from paxisim.logs.clock import UNIX_FROM, start_time
from paxisim.logs.formats import Options, format_of
from paxisim.logs.recording_arrays import CountsToForce, Method, RecordingArrays
from paxisim.logs.resample import check_max_gap, methods_by_name


def load_arrays(
    path: Path,
    *,
    align: Method | Mapping[str, Method] = "linear",
    max_gap: float | None = None,
    layout: TaxelLayout | None = None,
    pads: tuple[str, ...] | None = None,
    profile: CountsToForce | None = None,
    axes: Mapping[str, str] | None = None,
    topics: tuple[str, ...] = (),
    names: Mapping[str, str] | None = None,
    rate: float | None = None,
    start: str | None = None,
    streams: Iterable[Path] = (),
) -> RecordingArrays:
    """Load a recording; see `paxisim.Recording.load`.

    Without `streams`, the fields are not checked yet. The result may hold more than the requested `pads`.
    """
    check_max_gap(max_gap)
    added: dict[Path, Streams] = {}
    for other in streams:
        streams_of = format_of(other, streams=True).streams
        assert streams_of is not None
        added[other] = streams_of(other)
    elsewhere = {name for its in added.values() for name in its}
    own = format_of(path)
    if profile is not None and not own.has_counts:
        raise InvalidValueError(f"profile is for the counts of a board's CSV file; {path} has no counts")
    if not isinstance(axes, Mapping | None):
        raise InvalidValueError(
            f"axes must be words by feature, e.g. {{'observation.touch': 'taxels,xyz'}}, got {axes!r}"
        )
    if axes and not own.has_features:
        raise InvalidValueError(
            f"axes is for arrays: features of a LeRobotDataset, topics of a bag of ROS, HDF5 and npz; {path} has none"
        )
    if topics and not own.has_topics:
        raise InvalidValueError(f"topics is for the topics of a bag of ROS; {path} has no topics")
    if names and not own.may_be_renamed:
        raise InvalidValueError(f"names is for the arrays of an npz file; {path} is none")
    if rate is not None:
        check_rate(rate)
        if not own.may_lack_times:
            raise InvalidValueError(f"rate is for a recording without times; {path} has times of its own")
    began = None if start is None else start_time(start)
    options = Options(
        _part(align, lambda name: name not in elsewhere),
        max_gap=max_gap,
        layout=layout,
        pads=pads,
        profile=profile,
        axes=axes or {},
        topics=topics,
        names=names or {},
        rate=rate,
        start=began,
    )
    found = own.read(path, options)
    if began is not None:
        found = _started(path, found, began)
    if added:
        found = _checked(path, found)
    for other, its in added.items():
        methods = methods_by_name(_part(align, its.__contains__), list(its))
        found = add_streams(found, other, its, methods, max_gap)
    return found


def _started(path: Path, found: RecordingArrays, start: float) -> RecordingArrays:
    stated = found.metadata.get("start", float(found.time[0]) if len(found.time) else 0.0)
    if stated >= UNIX_FROM and stated != start:
        raise InvalidValueError(
            f"{path} states when it began, {stated:.3f} s since 1970, so it needs no start; leave it out"
        )
    return replace(found, metadata={**found.metadata, "start": start})


def _checked(path: Path, found: RecordingArrays) -> RecordingArrays:
    try:
        return check_fields(found)
    except InvalidValueError as error:
        raise InvalidValueError(f"{path}: {error}") from error


def _part(align: Method | Mapping[str, Method], wanted: Callable[[str], bool]) -> Method | Mapping[str, Method]:
    """Return `align`, restricted to the wanted stream names if it is a mapping."""
    return align if isinstance(align, str) else {name: method for name, method in align.items() if wanted(name)}


def save_arrays(path: Path, recording: RecordingArrays) -> None:
    """Save a recording; see `paxisim.Recording.save`."""
    suffix = path.suffix.lower()
    if suffix == ".mcap":
        from paxisim.logs.mcap_save import write_mcap

        write_mcap(path, recording)
    elif suffix == ".npz":
        from paxisim.logs.npz import write_npz

        write_npz(path, recording)
    else:
        raise InvalidValueError(f"a recording is saved as .mcap or .npz, got {path}")
