"""Demonstrations in the HDF5 files of robosuite and robomimic.

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
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.logs.limits import most_unpacked, refuse_streams, refuse_unpacked
from paxisim.logs.recording_arrays import RecordingArrays

_HEAP = b"GCOL\x01\0\0\0"  # signature, version and reserved bytes of a collection of texts of variable length
_DEMO = re.compile(r"demo_(\d+)")
# errors of h5py for damaged data, or for a group in place of a dataset
_NOT_SUCH = (OSError, LookupError, RuntimeError, TypeError, ValueError, AttributeError, OverflowError, MemoryError)
_SIZES = {"free": (7, 6), "ball": (4, 3)}  # size of a joint in qpos and qvel; other types have one value in each


def read_hdf5(path: Path) -> RecordingArrays:
    """Read all demonstrations, with or without a tensor.

    Raises:
        InvalidValueError: The file does not have this format, or its demonstrations differ in their contents.
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
            return _read(path, file)
    except InvalidValueError:
        raise
    except _NOT_SUCH as error:
        raise InvalidValueError(f"{path} is not a complete HDF5 file of robosuite or robomimic: {error}") from error


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


def _read(path: Path, file: Any) -> RecordingArrays:
    data = _member(path, file, "data")
    names = data if hasattr(data, "keys") else ()
    demos = sorted((int(match[1]), _member(path, data, name)) for name in names if (match := _DEMO.fullmatch(name)))
    if not demos:
        there = ", ".join(sorted(file)[:5]) or "nothing"
        raise InvalidValueError(f"{path} has no demonstrations: expected groups data/demo_N, it holds {there}")
    interval = _interval(data)
    size = 0
    for _, demo in demos:
        counts = [_member(path, demo, name) for name in ("states", "actions")]
        obs = _member(path, demo, "obs")
        refuse_streams(path, len(obs) if hasattr(obs, "keys") else 0)
        counts += [_member(path, obs, name) for name in obs] if hasattr(obs, "keys") else []
        # as float64, in the demonstration and joined with the others
        size += 16 * sum(min(one.size, _most_values(one)) for one in counts if _is_read(one))
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


def _member(path: Path, group: Any, name: str) -> Any:
    """Return a group or dataset of the file itself, or None if there is none of this name.

    Raises:
        InvalidValueError: It is in another file, which may be any file that the user can read.
    """
    link = group.get(name, getlink=True)
    if link is None:
        return None
    found = None if hasattr(link, "filename") else group[name]
    elsewhere = getattr(found, "external", None) or getattr(found, "is_virtual", False)
    if found is None or elsewhere or found.file != group.file:
        place = f"{group.name.rstrip('/')}/{name}"
        raise InvalidValueError(
            f"{path}: {place[1:]} is not in this file but refers to another one, which may be any file of yours: copy "
            "its values into the file"
        )
    return found


def _is_read(dataset: Any) -> bool:
    """Whether a member holds numbers of a kind that is read: vectors, or a tensor."""
    shape = getattr(dataset, "shape", None) or ()
    is_tactile = len(shape) == 5 and shape[2] == 3
    return bool(shape) and getattr(dataset.dtype, "kind", "") in "biuf" and (len(shape) <= 2 or is_tactile)


def _most_values(dataset: Any) -> int:
    """Return how many values a dataset may have; those that are not stored would read as zeros."""
    return dataset.id.get_storage_size() * 1024


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
        found = _member(path, group, "states")
        self.has_states = found is not None
        if found is not None:
            states = self._numbers("states", found)
            if states.ndim != 2 or states.shape[1] < 2:
                raise InvalidValueError(f"{place}: states must be (T, 1 + nq + nv), got shape {states.shape}")
            self.time = states[:, 0] - states[0, 0]
            self.arrays |= _joints(self.scene, states) or {"states": states}
        obs = _member(path, group, "obs")
        self._take("actions", _member(path, group, "actions"))
        for name in () if obs is None else obs:
            self._take(name, _member(path, obs, name))
        if not self.arrays:
            raise InvalidValueError(f"{place} has neither states, actions nor obs")
        count = len(next(iter(self.arrays.values())))
        if not self.has_states:
            if interval is None:
                raise InvalidValueError(f"{place} has no time: expected states, or a control_freq in env_args")
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
        self.arrays[name] = self._numbers(name, dataset)

    def _numbers(self, name: str, dataset: Any) -> NDArray[np.float64]:
        if dataset.size > _most_values(dataset):
            raise InvalidValueError(f"{self.place}: {name} has shape {dataset.shape}, but its values are not stored")
        return np.asarray(dataset[()], dtype=np.float64)


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
