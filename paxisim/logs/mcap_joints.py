"""Numeric streams in an MCAP file of another program: joint states and poses from ROS 2, and JSON topics.

| message | streams |
|---|---|
| ROS 2 ``sensor_msgs/msg/JointState``, or JSON with its fields ``name`` and ``position`` | ``JOINT`` (rad or m), \
``JOINT.velocity``, ``JOINT.effort`` |
| ROS 2 ``tf2_msgs/msg/TFMessage`` | ``CHILD_FRAME``: the pose of a frame that moves, as a 4x4 matrix (m) row by row |
| other JSON | ``topic/FIELD`` for each number or list of numbers, ``topic/FIELD.PART`` inside an object |

A joint that appears in several topics is named ``topic/JOINT``. The pose of a frame is in the root of its tree of
frames; a frame on another one that moves is left out, with a warning. The time of a sample is the message's own:
``header.stamp``, or in JSON ``timestamp`` ({sec, nsec}) or ``time`` (Unix seconds). If there is none, it is the log
time.
"""

from __future__ import annotations

import math
import warnings
from array import array
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.logs.limits import most_unpacked, refuse_streams, refuse_unpacked
from paxisim.logs.mcap_records import McapRecords, as_stream
from paxisim.logs.stream import Stream

_JOINT_STATES = ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")
_TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf2_msgs/TFMessage")
_TF = "ROS tf"  # stands for the topics of all transforms, which have one tree of frames
_KINDS = (("position", ""), ("velocity", ".velocity"), ("effort", ".effort"))
_TIMES = ("timestamp", "header", "time")

# parser of a message; yields the name within the topic, the message's time in ns or None, and a number or list of them
_Parse = Callable[[bytes], Iterator[tuple[str, "int | None", Any]]]


def read_joints(path: Path) -> dict[str, Stream]:
    """Return the streams by name.

    If the file is cut off or damaged, the intact part is read, with a warning.

    Raises:
        InvalidValueError: The file is not an MCAP file or has no supported message.
        MissingExtraError: It has ROS 2 joint states, and the package that reads them is not installed.
        FileNotFoundError: The file does not exist.
    """
    reader = _Reader(path)
    records = McapRecords(path)
    for opcode, body in records:
        reader.take(opcode, body)
    streams, left = reader.streams()
    if not streams:
        topics = ", ".join(sorted(reader.unread)) or "none"
        raise InvalidValueError(
            f"{path} has no numeric stream: expected ROS 2 sensor_msgs/msg/JointState, tf2_msgs/msg/TFMessage or "
            f"JSON messages; its other topics are: {topics}"
            + (f"; {reader.bad} messages could not be read" if reader.bad else "")
        )
    if left:
        warnings.warn(f"{path}: frames on others that move were left out: {', '.join(left)}", stacklevel=5)
    if not records.is_whole or reader.bad:
        what = "" if records.is_whole else " is cut off or damaged;"
        bad = f" {reader.bad} messages that could not be read were skipped;" if reader.bad else ""
        warnings.warn(f"{path}:{what}{bad} the intact part was read", stacklevel=5)  # at the caller of Recording.load
    return streams


class _Reader:
    """Collects samples from the records, taken one after another.

    Attributes:
        bad: Number of messages that could not be read.
        unread: Topics of unsupported message types, each with its type.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._size, self._most = 0, most_unpacked(path)
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, tuple[str, _Parse]] = {}
        self._samples: dict[tuple[str, str], _Samples] = {}
        self._parents: dict[str, str] = {}
        self.bad = 0
        self.unread: set[str] = set()

    def take(self, opcode: int, body: bytes) -> None:
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            return
        try:
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(as_stream(body))
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                self._open(Channel.read(as_stream(body)))
            else:
                self._message(Message.read(as_stream(body), len(body)))
        except (MissingExtraError, InvalidValueError):
            raise
        except Exception:  # a damaged message can raise anything in its parser
            self.bad += 1

    def _message(self, message: Message) -> None:
        if message.channel_id not in self._channels:
            return
        topic, parse = self._channels[message.channel_id]
        for name, at, value in parse(message.data):
            numbers = np.array(value, dtype=np.float64)  # None becomes NaN
            samples = self._samples.get((topic.strip("/"), name))
            if samples is None:
                samples = self._samples[topic.strip("/"), name] = _Samples(numbers.shape)
                refuse_streams(self._path, len(self._samples))
            self._size += numbers.nbytes + 8
            refuse_unpacked(self._path, self._size, self._most)
            if numbers.shape != samples.shape:
                raise ValueError(f"{name} has shape {numbers.shape}, previously {samples.shape}")
            samples.time.append(message.log_time if at is None else at)
            samples.values.frombytes(numbers.tobytes())

    def streams(self) -> tuple[dict[str, Stream], list[str]]:
        """Return the streams by name, and the frames that are left out, each with the one that it is on."""
        names = Counter(name for _, name in self._samples)
        found, frames = {}, {}
        for (topic, name), samples in self._samples.items():
            full = f"{topic}/{name.removeprefix('/')}" if name.startswith("/") or names[name] > 1 else name
            (frames if topic == _TF else found)[name if topic == _TF else full] = samples.stream()
        left = []
        for name, stream in frames.items():
            if len(stream.values) == 1:
                continue  # it does not move
            matrices = self._in_root(name, frames)
            if matrices is None:
                left.append(f"{name} on {self._parents[name]}")
            else:
                found[f"tf/{name}" if names[name] > 1 else name] = Stream(stream.nanoseconds, matrices.reshape(-1, 16))
        return found, left

    def _in_root(self, frame: str, frames: dict[str, Stream]) -> NDArray[np.float64] | None:
        """Return the poses ``(n, 4, 4)`` of a frame in the root of its tree; None if it is on a frame that moves."""
        matrices, passed = frames[frame].values.reshape(-1, 4, 4), {frame}
        parent = self._parents[frame]
        while parent in frames:
            values = frames[parent].values
            if parent in passed or np.any(values != values[0]):
                return None
            passed.add(parent)
            matrices, parent = values[0].reshape(4, 4) @ matrices, self._parents[parent]
        return matrices

    def _open(self, channel: Channel) -> None:
        schema = self._schemas.get(channel.schema_id)
        kind = schema.name if schema else "no schema"
        if channel.message_encoding == "json":
            self._channels[channel.id] = channel.topic, _json
        elif channel.message_encoding == "cdr" and schema is not None and kind in _JOINT_STATES:
            self._channels[channel.id] = channel.topic, self._joint_states(schema)
        elif channel.message_encoding == "cdr" and schema is not None and kind in _TRANSFORMS:
            self._channels[channel.id] = _TF, self._transforms(schema)
        else:
            self.unread.add(f"{channel.topic} ({kind})")

    def _decoder(self, schema: Schema) -> Callable[[bytes], Any]:
        try:
            from mcap_ros2.decoder import DecoderFactory
        except ModuleNotFoundError as error:
            raise MissingExtraError("mcap_ros2", "ros2", f"{self._path}, a ROS 2 recording,") from error
        decode = DecoderFactory().decoder_for("cdr", schema)
        assert decode is not None
        return decode

    def _joint_states(self, schema: Schema) -> _Parse:
        decode = self._decoder(schema)

        def parse(data: bytes) -> Iterator[tuple[str, int | None, Any]]:
            message = decode(data)
            at = _stamp(message.header)
            return _joints(message.name, at, {field: getattr(message, field) for field, _ in _KINDS})

        return parse

    def _transforms(self, schema: Schema) -> _Parse:
        decode = self._decoder(schema)

        def parse(data: bytes) -> Iterator[tuple[str, int | None, Any]]:
            for one in decode(data).transforms:
                child, parent = one.child_frame_id.strip("/"), one.header.frame_id.strip("/")
                if self._parents.setdefault(child, parent) != parent:
                    raise ValueError(f"{child} is on {parent}, previously on {self._parents[child]}")
                yield child, _stamp(one.header), _matrix(one.transform)

        return parse


class _Samples:
    """Growing buffers for the samples of a stream, whose number is known only at the end of the file."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape = shape
        self.time = array("q")
        self.values = array("d")

    def stream(self) -> Stream:
        time = np.array(self.time, dtype=np.int64)
        order = np.argsort(time, kind="stable")
        return Stream(time[order], np.array(self.values).reshape(len(time), *self.shape)[order])


def _stamp(header: Any) -> int | None:
    """Return the time of a ROS header in nanoseconds since 1970, or None if it has none."""
    return header.stamp.sec * 10**9 + header.stamp.nanosec or None


def _matrix(transform: Any) -> list[float]:
    """Return a ROS transform as the 16 numbers of a 4x4 matrix, row by row."""
    place, turn = transform.translation, transform.rotation
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix()
    matrix[:3, 3] = place.x, place.y, place.z
    return matrix.ravel().tolist()


def _json(data: bytes) -> Iterator[tuple[str, int | None, Any]]:
    message = orjson.loads(data)
    if not isinstance(message, dict):
        raise ValueError("not an object")
    at = _time(message)
    names = message.get("name")
    if isinstance(names, list) and isinstance(message.get("position"), list):
        yield from _joints(names, at, message)
        return
    for name, value in message.items():
        if name not in _TIMES:
            yield from _numbers(name, at, value)


def _joints(names: list[str], at: int | None, message: Any) -> Iterator[tuple[str, int | None, Any]]:
    for field, suffix in _KINDS:
        values = message.get(field) or []
        if len(values) not in (0, len(names)):
            raise ValueError(f"{len(values)} values of {field} for {len(names)} joints")
        for name, value in zip(names, values, strict=False):
            yield name + suffix, at, value


def _numbers(name: str, at: int | None, value: Any) -> Iterator[tuple[str, int | None, Any]]:
    if isinstance(value, dict):
        for part, inner in value.items():
            yield from _numbers(f"{name}.{part}", at, inner)
    elif isinstance(value, (int, float)) or (
        isinstance(value, list) and value and all(isinstance(number, (int, float, type(None))) for number in value)
    ):
        yield "/" + name, at, value


def _time(message: dict[str, Any]) -> int | None:
    """Return the message's time in nanoseconds since 1970, or None if it has none."""
    header = message.get("header")
    stamp = header.get("stamp") if isinstance(header, dict) else message.get("timestamp")
    if isinstance(stamp, dict) and "sec" in stamp:
        return int(stamp["sec"]) * 10**9 + int(stamp.get("nanosec", stamp.get("nsec", 0)))
    seconds = message.get("time")
    return round(seconds * 1e9) if isinstance(seconds, (int, float)) and math.isfinite(seconds) else None
