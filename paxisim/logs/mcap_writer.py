"""LogWriter: an MCAP file that is written as samples arrive and stays readable if the program is killed."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import struct
import threading
import time as clocks
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any

import numpy as np
import orjson
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC, Writer
from numpy.typing import ArrayLike

from paxisim._version import __version__
from paxisim.errors import InvalidValueError, OutputExistsError
from paxisim.layout import TaxelLayout
from paxisim.logs import schemas
from paxisim.logs.recording_arrays import unit_of

_RANGE = "1970-01-01 UTC, up to 2262-04-11"
# numbers are written as the shortest text that reads back to the same float32 or float64
_JSON = orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS
# readers parse a number as float64 first; this is the only float32 whose shortest text then rounds to its neighbour
_ROUNDED_TWICE = np.float32(7.038531e-26)


class LogWriter:
    """Writes one MCAP file with one topic per stream (`paxisim.logs.schemas`).

    The writer is a context manager, and several threads may write. Samples are collected into compressed chunks. A
    chunk is handed to the operating system as a whole by `flush`, and at the latest by the first `write` that follows
    the previous flush by `flush_interval`. A program that is killed loses at most the samples since then. The
    description of the file is written immediately.

    If a write to disk fails, the error is raised, the file is truncated to its last complete chunk and can be loaded,
    and nothing more is written to it.

    Attributes:
        held: Number of samples by stream that are safely in the file, in complete chunks.
    """

    def __init__(
        self, path: str | Path, metadata: Mapping[str, Any], *, flush_interval: float = 0.5, overwrite: bool = False
    ) -> None:
        """Create the file and write its description.

        Args:
            path: Path of the file.
            metadata: Metadata, returned as `Log.metadata` when the file is read: the layout (a `TaxelLayout` or its
                ``to_dict``), the pads' names, sensor, profile; ``scene`` is the text of the scene's MJCF. The version
                of paxisim is added.
            flush_interval: Time (s) between flushes; at most the samples of this time are lost if the program is
                killed.
            overwrite: Whether to replace an existing file.

        Raises:
            OutputExistsError: The file exists and `overwrite` is off.
            InvalidValueError: The metadata cannot be written as JSON.
            OSError: The file cannot be written.
        """
        record, scene = _describe(metadata)
        pads = metadata.get("pads") or ()
        self._pads = [str(pad) for pad in pads]
        self._layout: Mapping[str, Any] | None = _layout_message(metadata)
        self._interval = flush_interval
        self._lock = threading.Lock()
        self._channels: dict[str, tuple[int, tuple[int, ...]]] = {}
        self._counts: dict[str, int] = {}
        self._samples: dict[str, int] = {}
        self.held: dict[str, int] = {}
        try:
            self._file = _WholeWrites(path, "wb" if overwrite else "xb")
        except FileExistsError as error:
            raise OutputExistsError(f"{path} already exists; a recording does not overwrite it") from error
        try:
            stream: Any = self._file  # a binary file, but not of a type that Writer declares
            self._writer = Writer(stream)
            self._writer.start(library=f"paxisim {__version__}")
            self._writer.add_metadata(schemas.METADATA, record)
            if scene is not None:
                self._writer.add_attachment(0, 0, schemas.SCENE, "application/xml", scene.encode())
        except BaseException:
            self._file.close()
            raise
        self._path = os.path.abspath(path)
        self._stat = self._file.stat()
        self._flushed = clocks.monotonic()

    def write(self, stream: str, time: float, values: ArrayLike, **extra: Any) -> None:
        """Write one sample.

        Args:
            stream: ``"measured"``, ``"simulated"``, ``"covariate/NAME"`` or ``"episode"``.
            time: Time of the measurement, seconds since 1970-01-01 UTC. Streams need not be synchronous.
            values: ``(pads, 3, rows, cols)`` newtons; a covariate's number or array; or the number of the episode
                that begins now. A stream's shape must stay the same. NaN means unknown.
            extra: Additional fields of the message; for a tactile one ``sequence``, ``status`` and ``resultant``
                (see `paxisim.hw.frame.Frame`). Fields that are None are omitted. A pad in an error status (neither 0
                nor `paxisim.logs.schemas.NO_TAXELS`) loads as NaN.

        Raises:
            InvalidValueError: The stream does not exist or changes its shape, a value is infinite, the time is before
                1970 or after 2262, or the status is not one number per pad. Earlier samples are not affected.
            OSError: The disk is full or failed, now or earlier; the file is valid up to its last complete chunk.
        """
        if not 0 <= time <= schemas.LATEST * 1e-9:  # also true for NaN
            raise InvalidValueError(f"the time of a sample must be in seconds since {_RANGE}, got {time!r}")
        self.write_at(stream, round(time * 1e9), values, **extra)

    def write_at(self, stream: str, nanoseconds: int, values: ArrayLike, **extra: Any) -> None:
        """Write one sample at a time in ns since 1970-01-01 UTC, of which a float64 resolves only about every 200th."""
        if not 0 <= nanoseconds <= schemas.LATEST:
            raise InvalidValueError(f"the time of a sample must be in nanoseconds since {_RANGE}, got {nanoseconds!r}")
        is_tactile = stream in schemas.TACTILE_STREAMS
        array = np.asarray(values, dtype=np.float32 if is_tactile else np.float64)
        if np.isinf(array).any():
            raise InvalidValueError(f"a sample of {stream!r} holds an infinite value; use NaN for unknown values")
        # beyond 2**53 a float64 skips whole numbers
        if stream == "episode" and not (array.shape == () and array == np.round(array) and abs(array) < 2**53):
            raise InvalidValueError(f"an episode must be a whole number, got {array.tolist()!r}")
        status = extra.get("status")
        if is_tactile and status is not None and np.shape(status) != array.shape[:1]:
            raise InvalidValueError(f"status must be one number per pad, shape {array.shape[:1]}, got {status!r}")
        sec, nsec = divmod(int(nanoseconds), 10**9)
        fields = {"timestamp": {"sec": sec, "nsec": nsec}}
        with self._lock:
            self._file.check()
            channel = self._channel(stream, array, fields)
            sequence = extra.pop("sequence", None)
            sequence = self._counts[stream] if sequence is None else int(sequence)
            self._counts[stream] = sequence + 1
            if is_tactile:
                message = {**fields, "sequence": sequence, **self._tactile(array)}
            elif stream == "episode":
                message = {**fields, "episode": int(array)}
            elif array.ndim == 0:
                message = {**fields, "value": float(array)}
            else:
                message = {**fields, "shape": array.shape, "value": array.ravel()}
            for name, value in extra.items():
                if value is not None:
                    # orjson accepts only row-major arrays
                    message[name] = np.asarray(value, order="C") if isinstance(value, np.ndarray) else value
            data = orjson.dumps(message, option=_JSON)
            self._samples[stream] = self._samples.get(stream, 0) + 1
            with self._counting():
                self._writer.add_message(channel, nanoseconds, data, nanoseconds, sequence & 0xFFFFFFFF)
            if clocks.monotonic() - self._flushed >= self._interval:
                self._flush()

    def flush(self) -> None:
        """End the chunk and hand all samples to the operating system, so that they survive the end of the program.

        Call this about once a second if samples may stop arriving.

        Raises:
            OSError: The disk is full or failed.
        """
        with self._lock:
            self._file.check()
            self._flush()

    def _flush(self) -> None:
        with _uninterrupted(), self._counting():
            self._writer.flush()
        self._flushed = clocks.monotonic()

    @contextlib.contextmanager
    def _counting(self) -> Iterator[None]:
        """Update `held` if the file grows meanwhile: a complete chunk is written before anything else."""
        before = self._file.tell()
        try:
            yield
        finally:
            if self._file.tell() > before:
                self.held = dict(self._samples)

    @property
    def size(self) -> int:
        """Size of the file in bytes."""
        return self._file.tell()

    @property
    def is_in_place(self) -> bool:
        """Whether the file is still at its path: not deleted, moved or replaced by another."""
        try:
            return os.path.samestat(os.stat(self._path), self._stat)
        except OSError:
            return False

    def close(self) -> None:
        """Finish the file. May be called twice; after a failed write it does nothing.

        Raises:
            OSError: The disk is full or failed; the file is valid up to its last complete chunk.
        """
        with self._lock, _uninterrupted():
            if self._file.closed:
                return
            try:
                if self._file.error is None:
                    with self._counting():
                        self._writer.finish()
            finally:
                self._file.close()

    def __enter__(self) -> LogWriter:
        """Return the writer."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the file."""
        self.close()

    def _tactile(self, force: np.ndarray) -> dict[str, Any]:
        total = force.sum(axis=(2, 3), dtype=np.float64).round(6).tolist()
        pads = [
            {"pad": self._pads[i] if i < len(self._pads) else f"pad{i}", "x": x, "y": y, "z": z}
            for i, (x, y, z) in enumerate(total)
        ]
        flat = np.ascontiguousarray(force).ravel()
        if (np.abs(flat) == _ROUNDED_TWICE).any():
            flat = flat.astype(np.float64)
        return {"total": pads, "shape": force.shape, "force": flat}

    def _channel(self, stream: str, array: np.ndarray, timestamp: dict[str, Any]) -> int:
        if stream in self._channels:
            channel, shape = self._channels[stream]
            if array.shape != shape:
                raise InvalidValueError(f"samples of {stream!r} must keep the shape {shape}, got {array.shape}")
            return channel
        topic, schema = _topic(stream, array)
        if stream in schemas.TACTILE_STREAMS and self._layout is not None:
            described = {**timestamp, **self._layout}
            at = timestamp["timestamp"]["sec"] * 10**9 + timestamp["timestamp"]["nsec"]
            channel = self._registered(schemas.LAYOUT_TOPIC, schemas.LAYOUT)
            with self._counting():
                self._writer.add_message(channel, at, orjson.dumps(described, option=_JSON), at)
            self._layout = None
        channel = self._registered(topic, schema)
        self._channels[stream] = channel, array.shape
        self._counts[stream] = 0
        return channel

    def _registered(self, topic: str, schema: dict[str, Any]) -> int:
        document = orjson.dumps(schema)
        return self._writer.register_channel(
            topic, "json", self._writer.register_schema(schema["title"], "jsonschema", document)
        )


# DataEnd without a checksum, Footer without a summary, and the magic bytes
_LEAST_END = (
    struct.pack("<BQI", Opcode.DATA_END, 4, 0) + struct.pack("<BQQQI", Opcode.FOOTER, 20, 0, 0, 0) + MCAP0_MAGIC
)


class _WholeWrites:
    """File whose writes are atomic: the remains of a failed write are cut off.

    The MCAP writer hands over complete records, so the file always ends with one.
    """

    def __init__(self, path: str | Path, mode: str) -> None:
        self._raw = io.FileIO(path, mode)
        self._size = 0
        self.error: BaseException | None = None

    def check(self) -> None:
        """Raise an error if the file can no longer be written: that of an earlier failed write, if there was one."""
        if self.error is not None:
            raise self.error
        if self.closed:
            raise InvalidValueError("the recording was closed; nothing more can be written to it")

    @property
    def closed(self) -> bool:
        return self._raw.closed

    def tell(self) -> int:
        return self._size

    def stat(self) -> os.stat_result:
        return os.fstat(self._raw.fileno())

    def write(self, data: Any) -> int:
        rest = memoryview(data).cast("B")
        size = len(rest)
        try:
            while rest:
                rest = rest[self._raw.write(rest) :]
        except BaseException as error:
            self.error = error
            self._end_here()
            raise
        self._size += size
        return size

    def _end_here(self) -> None:
        """Cut off the incomplete write, and end the file with the shortest ending that MCAP allows, if it fits."""
        with contextlib.suppress(OSError):  # some files cannot be truncated; the original error is the one to report
            self._raw.truncate(self._size)
            self._raw.seek(self._size)
            if self._raw.write(_LEAST_END) != len(_LEAST_END):
                self._raw.truncate(self._size)

    def flush(self) -> None:
        """Do nothing, because writes are not buffered."""

    def close(self) -> None:
        self._raw.close()


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Delay Ctrl-C: its exception in the middle of a chunk would lose the chunk."""
    handler = signal.getsignal(signal.SIGINT)
    # other threads receive no signals and may not set a handler
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    came: list[tuple[int, FrameType | None]] = []
    signal.signal(signal.SIGINT, lambda number, frame: came.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if came:
            handler(*came[0])


def _topic(stream: str, array: np.ndarray) -> tuple[str, dict[str, Any]]:
    if stream in schemas.TACTILE_STREAMS:
        if array.ndim != 4 or array.shape[1] != 3:
            raise InvalidValueError(f"a sample of {stream!r} must be (pads, 3, rows, cols), got shape {array.shape}")
        return f"/tactile/{stream}", schemas.TACTILE
    if stream == "episode":
        return "/episode", schemas.EPISODE
    if stream.startswith(schemas.COVARIATE) and len(stream) > len(schemas.COVARIATE):
        return f"/{stream}", schemas.SCALAR if array.ndim == 0 else schemas.ARRAY
    raise InvalidValueError(f"unknown stream {stream!r}; expected measured, simulated, episode or covariate/NAME")


def _layout_message(metadata: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the message that describes the tensors, without its time; None if the layout is not known."""
    layout = metadata.get("layout")
    described = layout.to_dict() if isinstance(layout, TaxelLayout) else layout
    if not isinstance(described, Mapping):
        return None
    described = {name: value for name, value in described.items() if name != "vendor_order"}
    return {"pads": list(metadata.get("pads") or ()), "unit": unit_of(metadata), **described}


def _describe(metadata: Mapping[str, Any]) -> tuple[dict[str, str], str | None]:
    """Return the file's metadata record, with each value as JSON, and the scene's MJCF."""
    values: dict[str, Any] = {"paxisim": __version__, **metadata}
    scene = values.pop("scene", None)
    if scene is not None and not isinstance(scene, str):
        raise InvalidValueError(f"metadata['scene'] must be the text of an MJCF file, got {type(scene).__name__}")
    if isinstance(values.get("layout"), TaxelLayout):
        values["layout"] = values["layout"].to_dict()
    record = {"format": schemas.FORMAT}
    for name, value in values.items():
        try:
            record[str(name)] = orjson.dumps(value, option=_JSON).decode()
        except TypeError as error:
            raise InvalidValueError(f"metadata[{name!r}] cannot be written as JSON: {error}") from error
    record["format"] = schemas.FORMAT
    return record, scene
