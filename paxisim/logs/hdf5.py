"""HDF5 files: demonstrations of robosuite and robomimic; those of ACT are in `paxisim.logs.hdf5_act`.

| in ``data/demo_N`` | becomes |
|---|---|
| ``states``: MuJoCo's time, qpos and qvel | the time, and for each joint the covariates ``JOINT`` and \
``JOINT.velocity``, named as in the attribute ``model_file``; the covariate ``states`` if the model does not match |
| ``actions`` | the covariate ``actions`` |
| ``obs/NAME`` with a number or a vector per sample | the covariate ``NAME`` |
| ``obs/NAME`` of shape ``(T, pads, 3, rows, cols)`` | the tensor: simulated if there are ``states``, otherwise \
measured |
| ``model_file`` of the first demonstration | ``metadata["scene"]`` |

Demonstration N is episode N, and its time begins at 0. Without ``states``, the sampling interval is one over the
``control_freq`` in ``data``'s attribute ``env_args`` or ``env_info``. Images and other arrays are skipped. A file that
refers to other files, by external links, external storage or virtual datasets, is refused.
"""

from __future__ import annotations

import json
import mmap
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, MissingExtraError, UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.logs.hdf5_act import is_act, read_act
from paxisim.logs.hdf5_members import member, most_values, numbers
from paxisim.logs.limits import most_unpacked, refuse_streams, refuse_unpacked
from paxisim.logs.recording_arrays import RecordingArrays

_HEAP = b"GCOL\x01\0\0\0"  # signature, version and reserved bytes of a collection of texts of variable length
_DEMO = re.compile(r"demo_(\d+)")
# errors of h5py for damaged data, or for a group in place of a dataset
_NOT_SUCH = (OSError, LookupError, RuntimeError, TypeError, ValueError, AttributeError, OverflowError, MemoryError)
_SIZES = {"free": (7, 6), "ball": (4, 3)}  # size of a joint in qpos and qvel; other types have one value in each


def read_hdf5(
    path: Path,
    axes: Mapping[str, str] | None = None,
    rate: float | None = None,
    layout: TaxelLayout | None = None,
) -> RecordingArrays:
    """Read all demonstrations, with or without a tensor.

    Args:
        path: The file.
        axes: Axes of the tactile arrays of ACT, by name; see `paxisim.logs.hdf5_act`.
        rate: Samples per second, for a file that does not state its times.
        layout: Layout of the taxels, for arrays of ACT with an axis of taxels.

    Raises:
        InvalidValueError: The file does not have this format, or its demonstrations differ in their contents; or it
            has no times and there is no `rate`, or it has both.
        MissingExtraError: h5py is not installed.
        FileNotFoundError: The file does not exist.
    """
    try:
        import h5py
    except ModuleNotFoundError as error:
        raise MissingExtraError("h5py", "hdf5", "an HDF5 file") from error
    _check_heaps(path)  # and for a missing file, h5py would raise an OSError that does not name it
    try:
        with h5py.File(path, "r") as file:
            if is_act(file):
                return read_act(path, file, axes or {}, rate, layout)
            if axes:
                raise InvalidValueError(f"axes is for the arrays of ACT's files; {path} has demonstrations data/demo_N")
            return _read(path, file, rate)
    except (InvalidValueError, UnknownNameError):
        raise
    except _NOT_SUCH as error:
        raise InvalidValueError(
            f"{path} is not a complete HDF5 file of robosuite, robomimic or ACT: {error}"
        ) from error


def _check_heaps(path: Path) -> None:
    """Check that the objects of every heap of texts follow one another: HDF5 would step over one of size 0 forever.

    Raises:
        InvalidValueError: A heap is damaged.
        FileNotFoundError: The file does not exist.
    """
    with open(path, "rb") as file:
        if not path.stat().st_size:
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            start = data.find(_HEAP)
            while start >= 0:
                at, end = start + 16, start + int.from_bytes(data[start + 8 : start + 16], "little")
                while at + 16 <= min(end, len(data)):
                    index, size = int.from_bytes(data[at : at + 2], "little"), data[at + 8 : at + 16]
                    step = int.from_bytes(size, "little")  # that of the free space, index 0, has its own head
                    if index == 0 and step < 16:
                        raise InvalidValueError(f"{path} is not a complete HDF5 file: a heap of texts is damaged")
                    at += step if index == 0 else 16 + -(-step // 8) * 8
                start = data.find(_HEAP, start + 1)


def _read(path: Path, file: Any, rate: float | None) -> RecordingArrays:
    data = member(path, file, "data")
    names = data if hasattr(data, "keys") else ()
    demos = sorted((int(match[1]), member(path, data, name)) for name in names if (match := _DEMO.fullmatch(name)))
    if not demos:
        there = ", ".join(sorted(file)[:5]) or "nothing"
        raise InvalidValueError(
            f"{path} has no demonstrations: expected groups data/demo_N or observations, it holds {there}"
        )
    interval = _interval(data)
    if rate is not None and (interval is not None or member(path, demos[0][1], "states") is not None):
        raise InvalidValueError(f"{path} has times of its own, so it needs no rate")
    interval = 1 / rate if rate is not None else interval
    size = 0
    for _, demo in demos:
        counts = [member(path, demo, name) for name in ("states", "actions")]
        obs = member(path, demo, "obs")
        refuse_streams(path, len(obs) if hasattr(obs, "keys") else 0)
        counts += [member(path, obs, name) for name in obs] if hasattr(obs, "keys") else []
        # as float64, in the demonstration and joined with the others
        size += 16 * sum(min(one.size, most_values(one)) for one in counts if _is_read(one))
    refuse_unpacked(path, size, most_unpacked(path))
    parts = [_Demo(path, f"{path}: data/demo_{number}", demo, interval) for number, demo in demos]
    for part in parts[1:]:
        differ = sorted({name for name, _ in part.shapes().items() ^ parts[0].shapes().items()})
        if differ:
            raise InvalidValueError(f"{part.place} differs from {parts[0].place} in {', '.join(differ)}")
    arrays = {name: np.concatenate([part.arrays[name] for part in parts]) for name in parts[0].arrays}
    tensor = arrays.pop(parts[0].tactile, None)
    return RecordingArrays(
        np.concatenate([part.time for part in parts]),
        measured=None if parts[0].has_states else tensor,
        simulated=tensor if parts[0].has_states else None,
        covariates=arrays,
        episode=np.repeat([number for number, _ in demos], [len(part.time) for part in parts]),
        metadata={"source": path.name, **({"scene": parts[0].scene} if parts[0].scene else {})},
    )


def _is_read(dataset: Any) -> bool:
    """Whether a member holds numbers of a kind that is read: vectors, or a tensor."""
    shape = getattr(dataset, "shape", None) or ()
    is_tactile = len(shape) == 5 and shape[2] == 3
    return bool(shape) and getattr(dataset.dtype, "kind", "") in "biuf" and (len(shape) <= 2 or is_tactile)


class _Demo:
    """One demonstration.

    Attributes:
        place: File and group, for messages.
        time: ``(T,)`` seconds since the demonstration began.
        arrays: The covariates, and the tensor under the name `tactile`, if there is one.
        tactile: Name of the tensor in `arrays`, or "".
        has_states: Whether there are ``states``, that is, the demonstration was simulated.
        scene: Text of its MJCF, or "".
    """

    def __init__(self, path: Path, place: str, group: Any, interval: float | None) -> None:
        self.place = place
        self.scene = _text(group.attrs.get("model_file", ""))
        self.arrays: dict[str, NDArray[Any]] = {}
        self.tactile = ""
        found = member(path, group, "states")
        self.has_states = found is not None
        if found is not None:
            states = numbers(place, "states", found)
            if states.ndim != 2 or states.shape[1] < 2:
                raise InvalidValueError(f"{place}: states must be (T, 1 + nq + nv), got shape {states.shape}")
            self.time = states[:, 0] - states[0, 0]
            self.arrays |= _joints(self.scene, states) or {"states": states}
        obs = member(path, group, "obs")
        self._take("actions", member(path, group, "actions"))
        for name in () if obs is None else obs:
            self._take(name, member(path, obs, name))
        if not self.arrays:
            raise InvalidValueError(f"{place} has neither states, actions nor obs")
        count = len(next(iter(self.arrays.values())))
        if not self.has_states:
            if interval is None:
                raise InvalidValueError(
                    f"{place} has no time: expected states, or a control_freq in env_args; state it with rate (--rate)"
                )
            self.time = np.arange(count) * interval
        for key, value in self.arrays.items():
            if len(value) != len(self.time):
                raise InvalidValueError(f"{place}: {key} has {len(value)} samples, time has {len(self.time)}")

    def shapes(self) -> dict[str, tuple[int, ...]]:
        return {name: value.shape[1:] for name, value in self.arrays.items()}

    def _take(self, name: str, dataset: Any) -> None:
        if not _is_read(dataset):
            return
        is_tactile = len(dataset.shape) == 5
        if name in self.arrays:
            raise InvalidValueError(f"{self.place}: two streams would have the same name {name!r}")
        if is_tactile and self.tactile:
            raise InvalidValueError(
                f"{self.place} has two tensors, obs/{self.tactile} and obs/{name}; a recording holds one for all pads"
            )
        self.tactile = name if is_tactile else self.tactile
        self.arrays[name] = numbers(self.place, name, dataset)


def _joints(scene: str, states: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Return the position and velocity of each joint; empty if the states do not match the scene."""
    names, sizes = [], []
    for name, kind in _joints_of(scene):
        names.append(name)
        sizes.append(_SIZES.get(kind, (1, 1)))
    nq, nv = (sum(size) for size in zip(*sizes, strict=True)) if sizes else (0, 0)
    if states.shape[1] != 1 + nq + nv or not all(names) or len(set(names)) < len(names):
        return {}
    found, position, velocity = {}, 1, 1 + nq
    for name, (q, v) in zip(names, sizes, strict=True):
        at, speed = states[:, position : position + q], states[:, velocity : velocity + v]
        found |= {name: at[:, 0] if q == 1 else at, f"{name}.velocity": speed[:, 0] if v == 1 else speed}
        position, velocity = position + q, velocity + v
    return found


def _joints_of(scene: str) -> Iterator[tuple[str, str]]:
    """Yield the name and type of each joint of an MJCF in MuJoCo's order: a body's own before those of its children."""
    from lxml import etree

    try:
        root = etree.fromstring(scene.encode(), etree.XMLParser(resolve_entities=False, no_network=True))
    except (etree.XMLSyntaxError, ValueError):
        return
    open_ = list(root.iterfind("worldbody"))[::-1]
    while open_:
        body = open_.pop()
        for joint in body.iterchildren("joint", "freejoint"):
            kind = "free" if joint.tag == "freejoint" else joint.get("type", "hinge")
            yield joint.get("name", ""), kind
        open_ += list(body.iterchildren("body"))[::-1]


def _interval(data: Any) -> float | None:
    """Return the sampling interval (s) from the robot's control frequency, or None if the file does not state it."""
    for attribute in ("env_args", "env_info"):
        try:
            about = json.loads(_text(data.attrs.get(attribute, "{}")))
            rate = float(about.get("env_kwargs", about).get("control_freq", 0))
        except (ValueError, TypeError, AttributeError, RecursionError, OverflowError):
            continue
        if 0 < rate < float("inf"):
            return 1 / rate
    return None


def _text(value: Any) -> str:
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)
