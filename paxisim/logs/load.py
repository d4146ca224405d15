"""Loading and saving of recordings, with the format chosen by the file suffix."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.add_streams import Streams, add_streams, read_streams
from paxisim.logs.checks import check_fields
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
    streams: Iterable[Path] = (),
) -> RecordingArrays:
    """Load a recording; see `paxisim.Recording.load`.

    Without `streams`, the fields are not checked yet. The result may hold more than the requested `pads`.
    """
    check_max_gap(max_gap)
    added: dict[Path, Streams] = {}
    for other in streams:
        added[other] = read_streams(other)
    elsewhere = {name for its in added.values() for name in its}
    found = _load(path, _part(align, lambda name: name not in elsewhere), max_gap, layout, pads, profile)
    if added:
        found = _checked(path, found)
    for other, its in added.items():
        methods = methods_by_name(_part(align, its.__contains__), list(its))
        found = add_streams(found, other, its, methods, max_gap)
    return found


def _checked(path: Path, found: RecordingArrays) -> RecordingArrays:
    try:
        return check_fields(found)
    except InvalidValueError as error:
        raise InvalidValueError(f"{path}: {error}") from error


def _part(align: Method | Mapping[str, Method], wanted: Callable[[str], bool]) -> Method | Mapping[str, Method]:
    """Return `align`, restricted to the wanted stream names if it is a mapping."""
    return align if isinstance(align, str) else {name: method for name, method in align.items() if wanted(name)}


def _load(
    path: Path,
    align: Method | Mapping[str, Method],
    max_gap: float | None,
    layout: TaxelLayout | None,
    pads: tuple[str, ...] | None,
    profile: CountsToForce | None,
) -> RecordingArrays:
    if path.is_dir():
        if profile is not None:
            raise InvalidValueError(f"profile is for the counts of a board's CSV file; {path} is a folder")
        found = _load_lerobot(path, pads)
        return found if layout is None else replace(found, layout=layout)
    suffix = path.suffix.lower()
    is_eflesh = path.name.endswith(".sensor.csv")
    if suffix == ".csv" and not is_eflesh:
        from paxisim.logs.csv import read_csv

        found, is_cut = read_csv(path, layout=layout, pads=pads, profile=profile)
        if is_cut:
            _warn_of_part(path, "cut off: its last line is incomplete", found)
        return found
    if profile is not None:
        raise InvalidValueError(f"profile is for the counts of a board's CSV file; {path} has no counts")
    if is_eflesh:
        from paxisim.logs.eflesh import read_eflesh

        found = read_eflesh(path, align, max_gap)
    elif suffix == ".npz":
        from paxisim.logs.npz import read_npz

        found = read_npz(path)
    elif suffix == ".parquet":
        found = _load_parquet(path)
    elif suffix in (".h5", ".hdf5"):
        found = _load_hdf5(path)
    elif suffix == ".mcap":
        from paxisim.logs.mcap_reader import read_log
        from paxisim.logs.resample import resample_log

        log = read_log(path)
        found = resample_log(log, align, max_gap)
        if not log.complete:
            _warn_of_part(path, "cut off or damaged", found)
    else:
        raise InvalidValueError(
            "a recording must be a .mcap, .npz, .csv, .parquet or .hdf5 file, or the folder of a LeRobotDataset, got "
            f"{path}"
        )
    return found if layout is None else replace(found, layout=layout)


def _load_parquet(path: Path) -> RecordingArrays:
    from paxisim.logs.columns import from_columns
    from paxisim.logs.parquet import read_parquet

    columns, about = read_parquet(path)
    try:
        found = from_columns(columns)
    except InvalidValueError as error:
        dataset = path.absolute().parent.parent.parent
        is_part = (dataset / "meta/info.json").is_file()
        advice = f"; it is a part of the LeRobotDataset {dataset}, load that folder" if is_part else ""
        raise InvalidValueError(f"{path}: {error}{advice}") from error
    return replace(found, **about | {"covariates": {**found.covariates, **about.get("covariates", {})}})


def _load_hdf5(path: Path) -> RecordingArrays:
    from paxisim.logs.hdf5 import read_hdf5

    found = read_hdf5(path)
    if found.measured is None and found.simulated is None:
        raise InvalidValueError(
            f"{path} has no tensor: expected a dataset of shape (T, pads, 3, rows, cols) in obs; to add the other "
            "streams to a recording that has one, use streams (paxisim convert --streams)"
        )
    return found


def _load_lerobot(path: Path, pads: tuple[str, ...] | None) -> RecordingArrays:
    from paxisim.logs.lerobot_reader import features_in_words, read_lerobot

    found = read_lerobot(path, pads)
    if found.measured is None and found.simulated is None:
        raise InvalidValueError(
            f"{path} has no tactile feature{'' if pads is None else ' of those pads'}: expected one such as "
            f"observation.tactile.PAD of shape (3, rows, cols), got {features_in_words(path)}; to add these to a "
            "recording, use streams (paxisim convert --streams)"
        )
    return found


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


def _warn_of_part(path: Path, what: str, found: RecordingArrays) -> None:
    samples = f"{len(found.time)} sample{'s' * (len(found.time) != 1)}"
    text = f"{path} is {what}; the intact part was read: {samples}, the last at {found.time[-1]:.3f} s"
    warnings.warn(text, stacklevel=5)  # at the caller of Recording.load
