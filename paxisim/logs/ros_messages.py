"""The numbers in messages of ROS 1 and ROS 2, whichever library decoded them.

| message | streams |
|---|---|
| ``sensor_msgs/JointState`` | ``JOINT`` (rad or m), ``JOINT.velocity``, ``JOINT.effort`` |
| ``geometry_msgs/WrenchStamped`` | ``topic/force`` (N), ``topic/torque`` (Nm) |
| ``sensor_msgs/MagneticField`` | ``topic/magnetic_field`` (T) |
| ``std_msgs/Float64MultiArray``, ``Float32MultiArray`` | ``topic/data``, in the shape of its layout if that fits |
| ``paxisim_msgs/TactileFrame`` | ``topic/tensor``, ``(pads, 3, rows, cols)``; ``TactileLayout`` describes it |
| ``tf2_msgs/TFMessage`` | ``CHILD_FRAME``: the pose of a frame that moves, see `paxisim.logs.ros_frames` |
| ``SensStream`` of XELA's server | ``topic/MODEL_N/forces`` (N) and ``topic/MODEL_N/counts`` of each sensor N, \
``(taxels, 3)`` |

The time of a sample is the message's own: the stamp in its header, or the time that XELA's server states. XELA's
server repeats a reading until it has a new one; repetitions are left out by their number. Its counts are relative to
the middle of their 16-bit range. No source states the unit of its forces; newtons are assumed.

Source of XELA's messages: the repositories mcsix/xela_server_ros and mcsix/xela_server_ros2, READMEs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from paxisim.layout import TaxelLayout
from paxisim.logs.ros_frames import transform_samples
from paxisim.logs.schemas import in_error

# name within the topic, which begins with "/" if the topic is part of the stream's name; time (ns) or None; numbers
Sample = tuple[str, "int | None", Any]

FORCES, COUNTS, FIELD, WRENCH, ARRAY, TENSOR = "/forces", "/counts", "/magnetic_field", "/force", "/data", "/tensor"
"""Ends of the names of streams that may be tactile."""
_KINDS = (("position", ""), ("velocity", ".velocity"), ("effort", ".effort"))
_MIDDLE_COUNT = 2**15


def type_name(kind: str) -> str:
    """Return the name of a message type as ROS 1 writes it, ``package/Type``."""
    return kind.replace("/msg/", "/")


def parser(kind: str) -> Callable[[Any], Iterator[Sample]] | None:
    """Return what yields the samples of one topic's messages of a type, which are decoded; None for other types."""
    if type_name(kind) in XELA_TYPES:
        return _Xela().samples
    return _PARSERS.get(type_name(kind))


def joint_samples(names: list[str], at: int | None, message: Any) -> Iterator[Sample]:
    """Yield the samples of the joints.

    Args:
        names: Names of the joints.
        at: Time (ns), or None.
        message: Positions, velocities and efforts by field; those that are not known are missing or empty.

    Raises:
        ValueError: There are not as many values as joints.
    """
    for field, suffix in _KINDS:
        values = message.get(field)
        values = [] if values is None else values
        if len(values) not in (0, len(names)):
            raise ValueError(f"{len(values)} values of {field} for {len(names)} joints")
        for name, value in zip(names, values, strict=False):
            yield name + suffix, at, value


def _joints(message: Any) -> Iterator[Sample]:
    return joint_samples(message.name, _stamp(message), {field: getattr(message, field) for field, _ in _KINDS})


def _wrench(message: Any) -> Iterator[Sample]:
    at = _stamp(message)
    yield WRENCH, at, _xyz(message.wrench.force)
    yield "/torque", at, _xyz(message.wrench.torque)


def _field(message: Any) -> Iterator[Sample]:
    yield FIELD, _stamp(message), _xyz(message.magnetic_field)


def _array(message: Any) -> Iterator[Sample]:
    values = np.asarray(message.data, dtype=np.float64)
    shape = [dim.size for dim in message.layout.dim]
    is_whole = len(shape) > 1 and message.layout.data_offset == 0 and math.prod(shape) == values.size
    yield ARRAY, None, values.reshape(shape) if is_whole else values


@dataclass(frozen=True)
class Described:
    """What the frames of a tactile sensor have in common: the names of its pads, the unit, and the layout."""

    pads: tuple[str, ...]
    unit: str
    layout: TaxelLayout


def _tactile_layout(message: Any) -> Iterator[Sample]:
    layout: dict[str, Any] = {name: getattr(message, name) for name in ("rows", "cols")}
    layout["pitch"] = [float(length) for length in message.pitch]
    for name in ("positions", "normals"):
        if points := [_xyz(one) for one in getattr(message, name)]:
            layout[name] = points
    yield TENSOR, None, Described(tuple(message.pads), message.unit, TaxelLayout.from_dict(layout))


def _tactile_frame(message: Any) -> Iterator[Sample]:
    tensor = np.array(message.force, dtype=np.float64).reshape(tuple(message.shape))
    tensor[in_error(message.status)] = np.nan
    yield TENSOR, _stamp(message), tensor


class _Xela:
    """Messages of one topic of XELA's server."""

    def __init__(self) -> None:
        self._last: dict[str, int] = {}

    def samples(self, message: Any) -> Iterator[Sample]:
        for sensor in message.sensors:
            name = f"/{sensor.model}_{sensor.sensor_pos}"
            if not len(sensor.taxels) or self._last.get(name) == sensor.message:
                continue
            self._last[name] = sensor.message
            at = round(sensor.time * 1e9) if sensor.time > 0 else None
            counts = np.array([_xyz(taxel) for taxel in sensor.taxels]).astype(np.int64) & 0xFFFF
            yield name + COUNTS, at, counts - _MIDDLE_COUNT
            if len(sensor.forces):
                yield name + FORCES, at, [_xyz(force) for force in sensor.forces]


def _xyz(vector: Any) -> list[float]:
    return [vector.x, vector.y, vector.z]


def _stamp(message: Any) -> int | None:
    stamp = message.header.stamp
    return (stamp.sec * 10**9 + stamp.nanosec) or None


_PARSERS: dict[str, Callable[[Any], Iterator[Sample]]] = {
    "sensor_msgs/JointState": _joints,
    "geometry_msgs/WrenchStamped": _wrench,
    "sensor_msgs/MagneticField": _field,
    "std_msgs/Float64MultiArray": _array,
    "std_msgs/Float32MultiArray": _array,
    "paxisim_msgs/TactileFrame": _tactile_frame,
    "paxisim_msgs/TactileLayout": _tactile_layout,
    "tf2_msgs/TFMessage": transform_samples,
}
XELA_TYPES = ("xela_server_ros/SensStream", "xela_server_ros2/SensStream")
TYPES = (*_PARSERS, *XELA_TYPES)
"""Names of all types that are read."""
