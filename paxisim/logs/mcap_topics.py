"""Numeric streams in MCAP files of other programs: messages of ROS 2 (`paxisim.logs.ros_messages`) and JSON.

| JSON message | streams |
|---|---|
| with ``name`` and ``position``, as a ``JointState`` | ``JOINT``, ``JOINT.velocity``, ``JOINT.effort`` |
| other | ``topic/FIELD`` for each number or list of numbers, ``topic/FIELD.PART`` inside an object |

A joint that appears in several topics is named ``topic/JOINT``. The time of a sample is the message's own timestamp:
``header.stamp``, or in JSON ``timestamp`` ({sec, nsec}) or ``time`` (Unix seconds). If there is none, it is the log
time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import orjson
from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema

from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.logs.mcap_records import McapRecords, as_stream
from paxisim.logs.ros_messages import Sample, joint_samples, parser
from paxisim.logs.topic_streams import TopicStreams

_TIMES = ("timestamp", "header", "time")

_Parse = Callable[[bytes], Iterator[Sample]]


def read_topics(path: Path, files: Sequence[Path] | None = None) -> TopicStreams:
    """Return the streams of a file, or of the files of one recording.

    If a file is cut off or damaged, the intact part is read, with a warning.

    Args:
        path: The file, or the folder of the recording.
        files: The files in that folder.

    Raises:
        InvalidValueError: A file is not an MCAP file, or none has a supported message.
        MissingExtraError: One has messages of ROS 2, and the package that reads them is not installed.
        FileNotFoundError: A file does not exist.
    """
    files = [path] if files is None else files
    found = TopicStreams(path, files)
    for file in files:
        reader, records = _Reader(found), McapRecords(file)
        for opcode, body in records:
            reader.take(opcode, body)
        found.is_whole &= records.is_whole
    return found.check()


class _Reader:
    """Takes the records of one file one after another."""

    def __init__(self, found: TopicStreams) -> None:
        self._found = found
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, tuple[str, _Parse]] = {}

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
                message = Message.read(as_stream(body), len(body))
                if message.channel_id in self._channels:
                    topic, parse = self._channels[message.channel_id]
                    self._found.add(topic, message.log_time, parse(message.data))
        except (MissingExtraError, InvalidValueError):
            raise
        except Exception:  # a damaged message can raise anything in its parser
            self._found.bad += 1

    def _open(self, channel: Channel) -> None:
        if channel.id in self._channels:
            return  # the summary repeats the channels
        schema = self._schemas.get(channel.schema_id)
        kind = schema.name if schema else "no schema"
        self._found.types[channel.topic] = "JSON" if channel.message_encoding == "json" else kind
        samples = parser(kind)
        if channel.message_encoding == "json":
            self._channels[channel.id] = channel.topic, _json
        elif channel.message_encoding == "cdr" and schema is not None and samples is not None:
            self._channels[channel.id] = channel.topic, self._ros_2(schema, samples)

    def _ros_2(self, schema: Schema, samples: Callable[[Any], Iterator[Sample]]) -> _Parse:
        try:
            from mcap_ros2.decoder import DecoderFactory
        except ModuleNotFoundError as error:
            raise MissingExtraError("mcap_ros2", "ros", f"{self._found.path}, a ROS 2 recording,") from error
        decode = DecoderFactory().decoder_for("cdr", schema)
        assert decode is not None
        return lambda data: samples(decode(data))


def _json(data: bytes) -> Iterator[Sample]:
    message = orjson.loads(data)
    if not isinstance(message, dict):
        raise ValueError("not an object")
    at = _time(message)
    names = message.get("name")
    if isinstance(names, list) and isinstance(message.get("position"), list):
        yield from joint_samples(names, at, message)
        return
    for name, value in message.items():
        if name not in _TIMES:
            yield from _numbers(name, at, value)


def _numbers(name: str, at: int | None, value: Any) -> Iterator[Sample]:
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
