"""Episodes in HDF5 files as ACT (ALOHA) writes them: one episode a file, under ``observations``.

| dataset | becomes |
|---|---|
| ``observations/NAME`` or ``action``, a number or a vector per sample | the covariate ``NAME`` or ``action`` |
| ``observations/NAME`` with "tactile" in its name and more axes, or any whose axes are given | pads of the measured \
tensor |
| ``timestamp`` or ``time``, also in ``observations`` (s) | the time |

NAME is the path within ``observations``, such as ``qpos`` or ``tactile/left``. The axes of a tactile array are those
that the caller states, in words of `paxisim.logs.axes.WORDS`, or the only ones that fit its shape. ACT itself stores no
times: then the caller must state the rate. Images, that is arrays of bytes, and other arrays are skipped.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.logs.axes import FORMS, Axes, fits, given_axes, on_grid, tensor_of
from paxisim.logs.hdf5_members import member, most_values, numbers
from paxisim.logs.limits import most_unpacked, refuse_streams, refuse_unpacked
from paxisim.logs.recording_arrays import RecordingArrays

_OBSERVATIONS = "observations"
_DEEPEST = 4  # groups within groups
_TIMES = ("timestamp", "time")


def is_act(file: Any) -> bool:
    """Return whether an open HDF5 file has this form."""
    return _OBSERVATIONS in file and "data" not in file


def read_act(
    path: Path, file: Any, axes: Mapping[str, str], rate: float | None, layout: TaxelLayout | None
) -> RecordingArrays:
    """Read an open file, with or without tactile arrays.

    Args:
        path: The file, for messages.
        file: The file, opened with h5py.
        axes: Axes of tactile arrays by NAME.
        rate: Samples per second, for a file without times.
        layout: Layout of the taxels of arrays with an axis of taxels.

    Raises:
        InvalidValueError: There are no times and no `rate`, or both; the axes of an array cannot be told; arrays differ
            in their samples or taxels; or the file asks for too much memory or refers to another one.
        UnknownNameError: `axes` names an array that does not exist.
    """
    datasets = dict(_datasets(path, member(path, file, _OBSERVATIONS), "", 0))
    for name in ("action", *_TIMES):
        found = member(path, file, name)
        if name not in datasets and _is_number(found):
            datasets[name] = found
    refuse_streams(path, len(datasets))
    for name in axes:
        if name not in datasets:
            raise UnknownNameError("array", name, datasets)
    tactile = {name: _axes(path, name, dataset, axes.get(name)) for name, dataset in datasets.items()}
    tactile = {name: own for name, own in tactile.items() if own is not None}
    read = {name: one for name, one in datasets.items() if name in tactile or len(one.shape) <= 2}
    refuse_unpacked(path, sum(16 * min(one.size, most_values(one)) for one in read.values()), most_unpacked(path))
    values = {name: numbers(str(path), name, one) for name, one in read.items()}
    counts = {name: len(one) for name, one in values.items()}
    if len(set(counts.values())) != 1:
        listed = ", ".join(f"{name} has {count}" for name, count in counts.items()) or "it has no arrays of numbers"
        raise InvalidValueError(f"{path}: its arrays must have one number of samples: {listed}")
    time = _time(path, values, rate)
    pads = {name: tensor_of(values.pop(name), own) for name, own in tactile.items()}
    pads = {name: on_grid(one, layout) if "taxels" in tactile[name] else one for name, one in pads.items()}
    if len({one.shape[3:] for one in pads.values()}) > 1:
        listed = ", ".join(f"{name} has {one.shape[3]}x{one.shape[4]}" for name, one in pads.items())
        raise InvalidValueError(
            f"a recording holds pads of one kind, but those of {path} differ in their taxels: {listed}"
        )
    names = [
        f"{name}{i}" if "pads" in tactile[name] else name for name, one in pads.items() for i in range(one.shape[1])
    ]
    return RecordingArrays(
        time,
        measured=np.concatenate(list(pads.values()), axis=1) if pads else None,
        covariates=values,
        pads=tuple(names),
        metadata={"source": path.name},
    )


def _datasets(path: Path, group: Any, prefix: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Yield the datasets of numbers in a group and those within it, by their path."""
    if not hasattr(group, "keys") or depth > _DEEPEST:
        return
    refuse_streams(path, len(group))
    for name in group:
        found = member(path, group, name)
        if hasattr(found, "keys"):
            yield from _datasets(path, found, f"{prefix}{name}/", depth + 1)
        elif _is_number(found):
            yield prefix + name, found


def _is_number(dataset: Any) -> bool:
    shape = getattr(dataset, "shape", None) or ()
    is_image = len(shape) > 2 and getattr(dataset, "dtype", None) == np.uint8
    return bool(shape) and not is_image and getattr(dataset.dtype, "kind", "") in "biuf"


def _axes(path: Path, name: str, dataset: Any, text: str | None) -> Axes | None:
    """Return the axes of a tactile array without time, or None for any other array."""
    shape = dataset.shape[1:]
    if text is not None:
        return given_axes(name, shape, text)
    if "tactile" not in name.lower() or len(shape) < 2:
        return None
    possible = [axes for axes in FORMS if fits(axes, shape)]
    if len(possible) != 1:
        example = ",".join(possible[0]) if possible else "rows,cols"
        raise InvalidValueError(
            f"{path}: the axes of {name}, of shape {shape} per sample, cannot be told; state them with axes (paxisim "
            f"convert --axes {name}={example})"
        )
    return possible[0]


def _time(path: Path, values: dict[str, NDArray[np.float64]], rate: float | None) -> NDArray[np.float64]:
    """Remove the times from the values and return them."""
    count = len(next(iter(values.values())))
    found = [values.pop(name) for name in _TIMES if name in values and values[name].ndim == 1]
    if found and rate is not None:
        raise InvalidValueError(f"{path} has times of its own, so it needs no rate")
    if found:
        return found[0]
    if rate is None:
        raise InvalidValueError(
            f"{path} has no times: state its samples per second with rate (paxisim convert --rate), ALOHA records 50; "
            "as streams beside a recording it needs a dataset 'timestamp' (s)"
        )
    return np.arange(count) / rate
