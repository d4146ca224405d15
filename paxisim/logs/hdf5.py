"""Demonstrations in the HDF5 files of robosuite and robomimic.

| in ``data/demo_N`` | becomes |
|---|---|
| ``states``: MuJoCo's time, qpos and qvel | the time; for each joint the covariates ``JOINT`` and ``JOINT.velocity``, \
by the names in the attribute ``model_file``, and ``states`` where that does not fit |
| ``actions`` | the covariate ``actions`` |
| ``obs/NAME`` of one number or a row of numbers a sample | the covariate ``NAME`` |
| ``obs/NAME`` of shape ``(T, pads, 3, rows, cols)`` | the tensor: simulated where there are ``states``, measured else |
| ``model_file`` of the first demonstration | ``metadata["scene"]`` |

Demonstration N is episode N, and its time begins at 0. Without ``states``, samples are one over the ``control_freq`` of
``data``'s attribute ``env_args`` or ``env_info`` apart. Images and other arrays are left out.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.logs.recording_arrays import RecordingArrays

_DEMO = re.compile(r"demo_(\d+)")
# of h5py, for what is damaged, or a group where a dataset should be
_NOT_SUCH = (OSError, LookupError, RuntimeError, TypeError, ValueError, AttributeError, OverflowError, MemoryError)
_SIZES = {"free": (7, 6), "ball": (4, 3)}  # numbers of a joint in qpos and qvel; others have one each


def read_hdf5(path: Path) -> RecordingArrays:
    """Read all demonstrations; there may be no tensor in them.

    Raises:
        InvalidValueError: Not such a file, or demonstrations that differ in what they hold.
        MissingExtraError: h5py is not installed.
        FileNotFoundError: There is no such file.
    """
    try:
        import h5py
    except ModuleNotFoundError as error:
        raise MissingExtraError("h5py", "hdf5", "an HDF5 file") from error
    with open(path, "rb"):
        pass  # h5py's own error for a file that is missing is an OSError without a word on which
    try:
        with h5py.File(path, "r") as file:
            return _read(path, file)
    except InvalidValueError:
        raise
    except _NOT_SUCH as error:
        raise InvalidValueError(f"{path} is no whole HDF5 file of robosuite or robomimic: {error}") from error


def _read(path: Path, file: Any) -> RecordingArrays:
    data = file.get("data")
    demos = sorted((int(match[1]), data[name]) for name in (data or ()) if (match := _DEMO.fullmatch(name)))
    if not demos:
        there = ", ".join(sorted(file)[:5]) or "nothing"
        raise InvalidValueError(f"{path} has no demonstrations: expected groups data/demo_N, it holds {there}")
    interval = _interval(data)
    parts = [_Demo(f"{path}: data/demo_{number}", demo, interval) for number, demo in demos]
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


class _Demo:
    """One demonstration.

    Attributes:
        place: For messages.
        time: ``(T,)`` s from its beginning.
        arrays: The covariates, and the tensor under its name `tactile`, if there is one.
        has_states: It comes from a simulation.
        scene: The text of its MJCF, or "".
    """

    def __init__(self, place: str, group: Any, interval: float | None) -> None:
        self.place = place
        self.scene = _text(group.attrs.get("model_file", ""))
        self.arrays: dict[str, NDArray[Any]] = {}
        self.tactile = ""
        self.has_states = "states" in group
        if self.has_states:
            states = self._numbers("states", group["states"])
            if states.ndim != 2 or states.shape[1] < 2:
                raise InvalidValueError(f"{place}: states must be (T, 1 + nq + nv), got shape {states.shape}")
            self.time = states[:, 0] - states[0, 0]
            self.arrays |= _joints(self.scene, states) or {"states": states}
        for name in ("actions", "obs"):
            if name in group:
                found = {name: group[name]} if name == "actions" else dict(group[name])
                for key, value in found.items():
                    self._take(key, value)
        if not self.arrays:
            raise InvalidValueError(f"{place} has neither states, actions nor obs")
        count = len(next(iter(self.arrays.values())))
        if not self.has_states:
            if interval is None:
                raise InvalidValueError(f"{place} has no time: expected states, or a control_freq in env_args")
            self.time = np.arange(count) * interval
        for key, value in self.arrays.items():
            if len(value) != len(self.time):
                raise InvalidValueError(f"{place}: {key} has {len(value)} samples, the time has {len(self.time)}")

    def shapes(self) -> dict[str, tuple[int, ...]]:
        return {name: value.shape[1:] for name, value in self.arrays.items()}

    def _take(self, name: str, dataset: Any) -> None:
        shape = getattr(dataset, "shape", ())
        is_tactile = len(shape) == 5 and shape[2] == 3
        if not shape or getattr(dataset.dtype, "kind", "") not in "biuf" or (len(shape) > 2 and not is_tactile):
            return
        if name in self.arrays:
            raise InvalidValueError(f"{self.place}: two streams would have the name {name!r}")
        if is_tactile and self.tactile:
            raise InvalidValueError(
                f"{self.place} has two tensors, obs/{self.tactile} and obs/{name}; a recording has one for all pads"
            )
        self.tactile = name if is_tactile else self.tactile
        self.arrays[name] = self._numbers(name, dataset)

    def _numbers(self, name: str, dataset: Any) -> NDArray[np.float64]:
        if dataset.size > dataset.id.get_storage_size() * 1024:  # what is not stored reads as made-up zeros
            raise InvalidValueError(f"{self.place}: {name} has shape {dataset.shape}, but its values are not stored")
        return np.asarray(dataset[()], dtype=np.float64)


def _joints(scene: str, states: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Position and velocity of each joint; nothing where the states are not those of the scene."""
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
    """Name and type of each joint of an MJCF, in MuJoCo's order: a body's own before those of its children."""
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
    """Seconds from one sample to the next, where the file says how often its robot was controlled."""
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
