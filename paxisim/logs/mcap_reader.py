"""read_log: read the intact part of an MCAP recording."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema

from paxisim.errors import InvalidValueError
from paxisim.logs import schemas
from paxisim.logs.about import checked_metadata
from paxisim.logs.limits import most_unpacked, refuse_streams, refuse_unpacked
from paxisim.logs.mcap_records import DAMAGE, McapRecords, as_stream
from paxisim.logs.stream import Log, Stream

_CODES = {np.float32: "f", np.float64: "d", np.int64: "q"}
_LAYOUT = ("rows", "cols", "pitch", "pitch_known", "positions", "normals")
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time; the data follow


def read_log(path: str | Path) -> Log:
    """Read a recording that `LogWriter` wrote.

    The file may be truncated, as after a crash, or have damaged parts: the intact part is read, and `Log.complete` is
    False. The file is read chunk by chunk; the tensors take 4 bytes per number, and half as much again while they grow.
    Readings of a pad with a status other than 0 or `schemas.NO_TAXELS`, which is not an error, are not forces and
    become NaN.

    Raises:
        InvalidValueError: The file is not an MCAP file or not a recording of paxisim, is cut off before its
            description, or is so damaged that no sample can be read.
        FileNotFoundError: The file does not exist.
    """
    path = Path(path)
    reader = _Reader(path)
    records = McapRecords(path)
    for opcode, body in records:
        reader.take(opcode, body)
    reader.damaged |= records.damaged
    return reader.log(is_whole=records.is_whole, has_footer=records.has_footer)


def is_recording(path: Path) -> bool:
    """Return whether `read_log` can read the file, judged by the metadata record that precedes the samples.

    Raises:
        InvalidValueError: The file is not an MCAP file.
        FileNotFoundError: The file does not exist.
    """
    for opcode, body in McapRecords(path):
        if opcode == Opcode.SCHEMA and Schema.read(as_stream(body)).name == schemas.TACTILE["title"]:
            return True
        if opcode == Opcode.METADATA:
            try:
                if Metadata.read(as_stream(body)).name == schemas.METADATA:
                    return True
            except DAMAGE:
                continue
        if opcode == Opcode.MESSAGE:
            return False
    return False


class _Reader:
    """Collects samples and metadata from the records of a file, taken one after another."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size, self.most = 0, most_unpacked(path)
        self.damaged = False
        self.metadata: dict[str, Any] | None = None
        self.scene: str | None = None
        self.topics: dict[int, str] = {}
        self.samples: dict[str, _Samples] = {}

    def take(self, opcode: int, body: bytes) -> None:
        try:
            if opcode == Opcode.MESSAGE:
                self._message(body)
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(as_stream(body))
                self.topics[channel.id] = channel.topic
            elif opcode == Opcode.METADATA:
                record = Metadata.read(as_stream(body))
                if record.name == schemas.METADATA:
                    self._describe(record.metadata)
            elif opcode == Opcode.ATTACHMENT:
                attachment = Attachment.read(as_stream(body))
                if attachment.name == schemas.SCENE:
                    self.scene = attachment.data.decode()
        except InvalidValueError:
            raise
        except DAMAGE:
            self.damaged = True

    def _message(self, body: bytes) -> None:
        channel, _, nanoseconds, _ = _MESSAGE.unpack_from(body)
        topic = self.topics[channel]
        document = orjson.loads(memoryview(body)[_MESSAGE.size :])
        if topic.startswith("/tactile/"):
            shape, resultant, status = document["shape"], document.get("resultant"), document.get("status")
            wrong = schemas.in_error((status or ())[: shape[0]])
            samples = self._samples(topic.removeprefix("/tactile/"))
            self._fit(document["force"])
            samples.add(nanoseconds, document["force"], shape, document.get("sequence"), wrong)
            if status is not None:
                samples.errors = (samples.errors or 0) + bool(wrong)
            if resultant is not None:
                samples = self._samples(schemas.RESULTANT)
                numbers = [n for pad in resultant for n in pad]
                samples.add(nanoseconds, numbers, [len(resultant), 3], wrong=wrong)
        elif topic.startswith("/" + schemas.COVARIATE):
            value = document["value"]
            samples = self._samples(topic.removeprefix("/"))
            if isinstance(value, list):
                self._fit(value)
                samples.add(nanoseconds, value, document["shape"])
            else:
                samples.add(nanoseconds, [value], [])
        elif topic == "/episode":
            self._samples("episode").add(nanoseconds, [document["episode"]], [])
        elif topic == schemas.LAYOUT_TOPIC and self.metadata is None:  # from a program that writes no metadata
            layout = {name: document[name] for name in _LAYOUT if name in document}
            found = {"layout": layout, "pads": document["pads"], "unit": document["unit"]}
            checked_metadata(self.path, found)
            self.metadata = found

    def _fit(self, values: Sequence[Any]) -> None:
        """Check that the numbers, which may have two characters each in the file, fit into the memory."""
        self.size += 8 * len(values)
        if self.size > self.most:
            refuse_unpacked(self.path, self.size, self.most)

    def _samples(self, name: str) -> _Samples:
        if name not in self.samples:
            dtype = np.float32 if name in schemas.TACTILE_STREAMS else np.int64 if name == "episode" else np.float64
            self.samples[name] = _Samples(dtype)
            refuse_streams(self.path, len(self.samples))
        return self.samples[name]

    def _describe(self, record: dict[str, str]) -> None:
        if record.get("format") != schemas.FORMAT:
            raise InvalidValueError(
                f"{self.path} is a recording of format {record.get('format')!r}; "
                f"this version of paxisim reads {schemas.FORMAT!r}"
            )
        found = {name: orjson.loads(value) for name, value in record.items() if name != "format"}
        checked_metadata(self.path, found)
        self.metadata = found

    def log(self, is_whole: bool, has_footer: bool) -> Log:
        if self.metadata is None and has_footer:
            topics = ", ".join(self.topics.values()) or "none"
            raise InvalidValueError(
                f"{self.path} is an MCAP file, but not a recording of paxisim: it has neither "
                f"{schemas.METADATA!r} metadata nor a message on {schemas.LAYOUT_TOPIC} (its topics: {topics})"
            )
        if self.metadata is None:
            raise InvalidValueError(f"{self.path} is an MCAP file that ends before its description")
        if self.damaged and not any(samples.count for samples in self.samples.values()):
            raise InvalidValueError(f"{self.path} is damaged: none of its samples can be read")
        if self.scene is not None:
            self.metadata["scene"] = self.scene
        streams = {}
        for name in list(self.samples):  # removed one by one, because sorting a long stream copies it
            samples = self.samples.pop(name)
            if samples.count:
                streams[name] = samples.stream()
        return Log(streams, self.metadata, is_whole and not self.damaged)


class _Samples:
    """Buffers that grow in place, because the number of samples is known only at the end of the file."""

    def __init__(self, dtype: type) -> None:
        self.count = 0
        self.shape: list[int] = []
        self.row = struct.Struct("")
        self.dtype = dtype
        self.nanoseconds = np.empty(0, np.int64)
        self.sequence = np.empty(0, np.int64)
        self.has_sequence = True
        self.errors: int | None = None  # None for a stream without a status
        self.values = np.empty((0, 0), dtype)

    def add(
        self,
        nanoseconds: int,
        values: list[Any],
        shape: list[int],
        sequence: int | None = None,
        wrong: Sequence[int] = (),
    ) -> None:
        """Add a sample, with NaN for the pads listed in `wrong`."""
        # checked before memory is allocated: a damaged shape may claim more than there is
        if not all(type(size) is int and size > 0 for size in shape) or math.prod(shape) != len(values):
            raise ValueError(f"{len(values)} values of shape {shape}")
        if not self.count:
            self.shape = shape
            self.row = struct.Struct(f"{math.prod(shape)}{_CODES[self.dtype]}")
            self._resize(1, math.prod(shape))
        if shape != self.shape or len(values) != self.values.shape[1]:
            raise ValueError(f"{len(values)} values of shape {shape} after {self.shape}")
        if self.count == len(self.values):
            self._resize(self.count + self.count // 2 + 1, len(values))
        try:  # three times as fast as numpy
            self.row.pack_into(self.values.data, self.count * self.row.size, *values)
        except struct.error:  # null, for NaN
            self.values[self.count] = values
        if wrong:
            self.values[self.count].reshape(shape)[wrong] = np.nan
        self.nanoseconds[self.count] = nanoseconds
        if sequence is None:
            self.has_sequence = False
        else:
            self.sequence[self.count] = sequence
        self.count += 1

    def _resize(self, count: int, width: int) -> None:
        # in place: the operating system moves pages, so there is no second copy
        self.values.resize((count, width), refcheck=False)
        self.nanoseconds.resize(count, refcheck=False)
        self.sequence.resize(count, refcheck=False)

    def stream(self) -> Stream:
        self._resize(self.count, self.values.shape[1])
        time, values = self.nanoseconds, self.values.reshape(self.count, *self.shape)
        sequence = self.sequence if self.has_sequence else None
        if np.any(np.diff(time) < 0):
            order = np.argsort(time, kind="stable")
            time, values = time[order], values[order]
            sequence = None if sequence is None else sequence[order]
        return Stream(time, values, sequence, self.errors)
