"""lerobot_reader: a LeRobotDataset, format v3, as a recording.

The pads are those of `paxisim.logs.lerobot_pads`. They hold measured newtons unless the feature's ``info``, as written
by `paxisim.logs.lerobot_features`, says otherwise. All other numeric features are covariates. A vector with named
components becomes one covariate per component, such as ``action.NAME``. Images, videos and texts are skipped.

Time counts from the first frame of each episode, unless paxisim wrote the dataset: then it is that of the recording.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.columns import streams_from_columns
from paxisim.logs.lerobot_features import MAX_AXES
from paxisim.logs.lerobot_meta import INDICES, Meta, read_meta
from paxisim.logs.lerobot_pads import Pads, is_taxel, pads_of_array, pads_of_components, tactile_arrays
from paxisim.logs.parquet import column_values, is_numeric, read_table, require_pyarrow
from paxisim.logs.recording_arrays import RecordingArrays


def read_lerobot(
    path: Path,
    pads: Sequence[str] | None = None,
    axes: Mapping[str, str] | None = None,
    layout: TaxelLayout | None = None,
) -> RecordingArrays:
    """Read all episodes, with or without a tensor.

    Args:
        path: The dataset's folder.
        pads: Names of the requested pads. If tactile features differ in grid, layout or unit, those without a requested
            pad are skipped. Empty: skip all tactile features. None: read all.
        axes: Axes of tactile arrays by feature, as words with commas; see `paxisim.logs.lerobot_pads`.
        layout: Layout whose grid taxels without rows and columns are put on. Default: one row.

    Raises:
        MissingExtraError, UnsupportedError: pyarrow cannot be used.
        InvalidValueError: The folder is not a LeRobotDataset of this version, the dataset is damaged or incomplete, its
            pads differ in grid, layout or unit, or the axes of a pad cannot be told.
        UnknownNameError: `axes` names a feature that does not exist.
    """
    require_pyarrow()
    meta = read_meta(path)
    columns = _columns(meta)
    episode = _whole(meta, "episode_index", columns["episode_index"])
    indices, at = np.unique(episode, return_inverse=True)
    begins, numbers = meta.clock(indices)
    time, episode = begins[at] + columns["timestamp"], numbers[at]
    metadata = meta.metadata(_whole(meta, "task_index", columns["task_index"]), episode)
    features = {name: values for name, values in columns.items() if name not in INDICES}
    written = _take_written(meta, features)
    arrays = tactile_arrays(meta, list(features), axes or {}, pads)
    found = [pads_of_array(meta, name, features.pop(name), its, layout) for name, its in arrays.items()]
    if pads is None or pads:
        found += pads_of_components(meta, features, layout)
    if pads is not None and (not pads or _difference(found)):
        found = [part for part in found if set(part.pads) & set(pads)]
    if said := _difference(found):
        raise InvalidValueError(f"{path}: {said}, but all pads of a recording share one; select some with pads")
    names = list(dict.fromkeys(pad for part in found for pad in part.pads))
    if found and (found[0].unit or "N") != (metadata.get("unit") or "N"):
        metadata["unit"] = found[0].unit or "N"
    return RecordingArrays(
        time,
        measured=_tensor(meta, "measured", found, names),
        simulated=_tensor(meta, "simulated", found, names),
        covariates={**_covariates(meta, features, time), **written},
        episode=episode,
        layout=found[0].layout if found else None,
        pads=tuple(names),
        metadata=metadata,
    )


def _columns(meta: Meta) -> dict[str, NDArray[Any]]:
    """Return the columns of all data files, each ``(T, *shape)``, or ``(T,)`` for the shape ``(1,)``."""
    files = sorted((meta.path / "data").glob("*/*.parquet"))
    if not files:
        raise InvalidValueError(f"{meta.path} has no frames: expected data/chunk-000/file-000.parquet")
    names = [*meta.numeric, *(name for name in INDICES if name not in meta.numeric)]
    parts = [_read(meta, file, names) for file in files]
    frames = sum(len(part["timestamp"]) for part in parts)
    if meta.frames is not None and frames != meta.frames:
        raise InvalidValueError(
            f"{meta.path} is incomplete: meta/info.json states {meta.frames} frames, the data files hold {frames}"
        )
    return {name: np.concatenate([part.pop(name) for part in parts]) for name in names}


def _read(meta: Meta, file: Path, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    table = read_table(file, lambda field: field.name in names and is_numeric(field.type, MAX_AXES))
    found = {}
    for name in names:
        if name not in table.column_names:
            raise InvalidValueError(f"{file} has no numeric column {name!r}, although meta/info.json lists it")
        shape = (1,) if name in INDICES else tuple(meta.features[name]["shape"])
        dtype = np.float32 if len(shape) > 2 else np.float64
        values = column_values(f"{file}, column {name!r}", table[name], dtype)
        if (values.shape[1:] or (1,)) != shape:
            raise InvalidValueError(
                f"{file}: {name} has shape {values.shape[1:] or (1,)}, expected {shape} as in meta/info.json"
            )
        found[name] = values.reshape(len(values)) if shape == (1,) else values
    return found


def _whole(meta: Meta, name: str, values: NDArray[Any]) -> NDArray[np.int64]:
    if not np.all((values >= 0) & (values < 2**31) & (values == np.round(values))):
        raise InvalidValueError(f"{meta.path}: {name} must hold whole numbers of at least 0")
    return values.astype(np.int64)


def _difference(found: Sequence[Pads]) -> str:
    """Describe a property that a recording needs to be equal for all pads but that differs; empty if none does."""
    for part in found[1:]:
        for what, of in (("grids", _grid), ("layouts", lambda p: p.layout), ("units", _unit)):
            if of(part) != of(found[0]):
                said = f" ({of(found[0])} and {of(part)})" if what == "grids" else ""
                return f"{found[0].source} and {part.source} have different {what}{said}"
    return ""


def _grid(part: Pads) -> str:
    return "{}x{}".format(*part.tensor.shape[-2:])


def _unit(part: Pads) -> str:
    return part.unit or "N"


def _tensor(meta: Meta, stream: str, found: Sequence[Pads], names: Sequence[str]) -> NDArray[np.float32] | None:
    parts = [part for part in found if part.stream == stream]
    if not parts:
        return None
    pads = [pad for part in parts for pad in part.pads]
    if sorted(pads) != sorted(names):
        raise InvalidValueError(f"{meta.path}: {stream} has the pads {', '.join(pads)}, expected {', '.join(names)}")
    tensor = parts[0].tensor if len(parts) == 1 else np.concatenate([part.tensor for part in parts], axis=1)
    return tensor if pads == list(names) else tensor[:, [pads.index(name) for name in names]]


def _take_written(meta: Meta, features: dict[str, NDArray[Any]]) -> dict[str, NDArray[np.float64]]:
    """Remove the features in which paxisim stored covariates, and return these."""
    written: dict[str, NDArray[np.float64]] = {}
    for feature in list(features):
        parts = _parts(meta.features[feature], features[feature])
        if parts.keys() & written.keys():
            raise InvalidValueError(
                f"{meta.path}: two features hold the covariate {min(parts.keys() & written.keys())!r}"
            )
        written |= parts
        if parts:
            del features[feature]
    return written


def _covariates(
    meta: Meta, features: Mapping[str, NDArray[Any]], time: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    columns: dict[str, NDArray[Any]] = {}
    for feature, values in features.items():
        parts = meta.components(feature, values)
        named = {f"{feature}.{part}": column for part, column in parts.items() if not is_taxel(meta, feature, part)}
        columns |= named if parts else {feature: values}
    try:
        return dict(streams_from_columns({"timestamp": time, **columns}).covariates)
    except InvalidValueError as error:
        raise InvalidValueError(f"{meta.path}: {error}") from error


def _parts(feature: Mapping[str, Any], values: NDArray[Any]) -> dict[str, NDArray[np.float64]]:
    """Return the covariates that paxisim stored in a feature, according to its ``info``; empty if it lists none."""
    info = feature.get("info")
    listed = info.get("covariates") if isinstance(info, dict) else None
    if not isinstance(listed, list):
        return {}
    flat = values.reshape(len(values), -1)
    parts, start = {}, 0
    for item in listed:
        if not (isinstance(item, list) and len(item) == 2 and isinstance(item[0], str) and _is_shape(item[1])):
            return {}
        size = math.prod(item[1])
        if start + size > flat.shape[1]:
            return {}
        parts[item[0]] = flat[:, start : start + size].reshape(-1, *item[1]).astype(np.float64)
        start += size
    return parts if start == flat.shape[1] and len(parts) == len(listed) else {}


def _is_shape(given: Any) -> bool:
    return isinstance(given, list) and len(given) < 32 and all(type(size) is int and 0 < size < 2**31 for size in given)
