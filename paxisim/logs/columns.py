"""A recording as a table, with one row per sample and one named column per value.

| column | holds |
|---|---|
| ``timestamp`` | seconds since the first sample of the episode |
| ``time`` | the recording's time in seconds |
| ``episode_index`` | the episode number |
| ``frame_index`` | sample index within the episode, from 0 |
| ``index`` | sample index over all episodes, from 0 |
| ``tactile.PAD.ROW_COL.AXIS`` | measured force (N), e.g. ``tactile.left.0_9.z`` |
| ``simulated.PAD.ROW_COL.AXIS`` | simulated force (N) |
| ``NAME``, ``NAME.0``, ``NAME.0_1`` | a covariate, or its components if it is an array; a Parquet table of paxisim \
states their shapes |

Column names follow the flat ``thing.part`` names of LeRobot observations, and the names for times and episodes in
LeRobot datasets.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.logs.recording_arrays import RecordingArrays, episode_starts

INDEX_COLUMNS = ("timestamp", "time", "episode_index", "frame_index", "index")
_NOT_COVARIATES = (*INDEX_COLUMNS, "task_index")
_PREFIXES = {"measured": "tactile", "simulated": "simulated"}
_TAXEL = re.compile(r"(tactile|simulated)\.(.+)\.(\d{1,9})_(\d{1,9})\.([xyz])")
_SPARSE = 100  # an array with a column for fewer than one in this many components is taken for a mistake
_COMPONENT = re.compile(r"(.+)\.(\d{1,9}(?:_\d{1,9}){0,15})")


def to_columns(recording: RecordingArrays) -> dict[str, NDArray[np.generic]]:
    """Return the columns, each ``(T,)`` and a view where possible.

    Raises:
        InvalidValueError: A covariate has the name of another column.
    """
    time = np.asarray(recording.time)
    episode = np.zeros(len(time), np.int64) if recording.episode is None else recording.episode
    first = episode_starts(episode)
    begin = np.repeat(first, np.diff([*first, len(time)]))
    index = np.arange(len(time))
    columns: dict[str, NDArray[np.generic]] = dict(
        zip(INDEX_COLUMNS, (time - time[begin], time, episode, index - begin, index), strict=True)
    )
    for field, prefix in _PREFIXES.items():
        tensor = getattr(recording, field)
        if tensor is not None:
            pads, _, rows, cols = tensor.shape[1:]
            for pad, row, col, axis in product(range(pads), range(rows), range(cols), range(3)):
                columns[_name(prefix, recording.pads[pad], row, col, axis)] = tensor[:, pad, axis, row, col]
    for name, values in recording.covariates.items():
        for column, at in _components(name, values.shape[1:]):
            if column in columns:
                raise InvalidValueError(f"a table cannot hold the covariate {name!r}: {column!r} is already a column")
            columns[column] = values[(slice(None), *at)]
    return columns


def take_covariates(columns: dict[str, NDArray[Any]], shapes: Mapping[str, tuple[int, ...]]) -> dict[str, NDArray[Any]]:
    """Remove the columns of covariates of known shape, and return these; those with a missing column are left out."""
    found = {}
    for name, shape in shapes.items():
        if math.prod(shape) <= len(columns) and all(column in columns for column, _ in _components(name, shape)):
            parts = [columns.pop(column) for column, _ in _components(name, shape)]
            found[name] = np.stack(parts, axis=1).reshape(-1, *shape)
    return found


def _components(name: str, shape: tuple[int, ...]) -> list[tuple[str, tuple[int, ...]]]:
    return [(name + ("." + "_".join(map(str, at)) if at else ""), at) for at in np.ndindex(shape)]


def from_columns(columns: Mapping[str, NDArray[Any]]) -> RecordingArrays:
    """Return the arrays of a table; the inverse of `to_columns`. Only one of the two time columns is required.

    Raises:
        InvalidValueError: There is no time or no taxel, or the taxels do not form the same grid on all pads.
    """
    taxels: dict[str, dict[tuple[str, int, int, int], NDArray[np.float64]]] = {}
    for name, values in columns.items():
        if taxel := _TAXEL.fullmatch(name):
            prefix, pad, row, col, axis = taxel.groups()
            taxels.setdefault(prefix, {})[pad, int(row), int(col), "xyz".index(axis)] = values
    if not taxels:
        raise InvalidValueError("the table must have columns tactile.PAD.ROW_COL.AXIS, e.g. tactile.left.0_0.z")
    pads = tuple(dict.fromkeys(pad for found in taxels.values() for pad, *_ in found))
    grids = {field: _grid(prefix, taxels[prefix], pads) for field, prefix in _PREFIXES.items() if prefix in taxels}
    return replace(
        streams_from_columns(columns), measured=grids.get("measured"), simulated=grids.get("simulated"), pads=pads
    )


def streams_from_columns(columns: Mapping[str, NDArray[Any]]) -> RecordingArrays:
    """Return the time, episodes and covariates of a table, which needs no taxels; a column ``(T, n)`` is a covariate.

    Raises:
        InvalidValueError: There is no time, or the components of a covariate are not numbered from 0.
    """
    time = columns.get("time", columns.get("timestamp"))
    if time is None:
        raise InvalidValueError("the table must have a column 'time' or 'timestamp' (s)")
    covariates: dict[str, dict[tuple[int, ...], NDArray[np.float64]]] = {}
    whole = {}
    for name, values in columns.items():
        component = _COMPONENT.fullmatch(name)
        if name in _NOT_COVARIATES or _TAXEL.fullmatch(name):
            continue
        if values.ndim > 1:
            whole[name] = values
        elif component:
            at = tuple(int(i) for i in component[2].split("_"))
            covariates.setdefault(component[1], {})[at] = values
        else:
            covariates.setdefault(name, {})[()] = values
    episode: Any = columns.get("episode_index")  # checked and converted by `Recording`
    return RecordingArrays(
        time=time, covariates={name: _array(name, parts) for name, parts in covariates.items()} | whole, episode=episode
    )


def _grid(
    prefix: str, taxels: Mapping[tuple[str, int, int, int], NDArray[np.float64]], pads: tuple[str, ...]
) -> NDArray[np.float32]:
    rows = 1 + max(row for _, row, _, _ in taxels)
    cols = 1 + max(col for _, _, col, _ in taxels)
    # checked before the tensor is allocated: a wrong index could ask for more memory than there is
    wanted = ((pad, row, col, axis) for pad in pads for axis in range(3) for row in range(rows) for col in range(cols))
    missing = next((taxel for taxel in wanted if taxel not in taxels), None)
    if missing is not None:
        last = max(taxels, key=lambda taxel: max(taxel[1:3]))
        raise InvalidValueError(
            f"the table has no column {_name(prefix, *missing)}; every pad must have {rows}x{cols} taxels with x, y "
            f"and z, because there is {_name(prefix, *last)}"
        )
    tensor = np.empty((len(next(iter(taxels.values()))), len(pads), 3, rows, cols), np.float32)
    for pad, axis, row, col in np.ndindex(tensor.shape[1:]):
        tensor[:, pad, axis, row, col] = taxels[pads[pad], row, col, axis]
    return tensor


def _name(prefix: str, pad: str, row: int, col: int, axis: int) -> str:
    return f"{prefix}.{pad}.{row}_{col}.{'xyz'[axis]}"


def _array(name: str, parts: Mapping[tuple[int, ...], NDArray[np.float64]]) -> NDArray[np.float64]:
    if len({len(at) for at in parts}) > 1:
        raise InvalidValueError(f"the columns of {name!r} have different numbers of indices")
    shape = tuple(1 + max(at) for at in zip(*parts, strict=True))
    if math.prod(shape) > _SPARSE * len(parts):
        column = f"{name}.{'_'.join(map(str, max(parts, key=max)))}"
        raise InvalidValueError(
            f"the column {column!r} makes {name!r} an array of shape {shape}, but the table has only {len(parts)} "
            f"column{'s' * (len(parts) != 1)} of it; number them from 0"
        )
    values = np.full((len(next(iter(parts.values()))), *shape), np.nan)
    for at, column in parts.items():
        values[(slice(None), *at)] = column
    return values
