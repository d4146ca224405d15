"""TopicStreams: the samples of the topics of a file, whose number is known only at its end."""

from __future__ import annotations

import warnings
from array import array
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.logs.limits import most_unpacked, refuse_streams, refuse_unpacked
from paxisim.logs.ros_frames import is_frame, poses_in_root
from paxisim.logs.ros_messages import TYPES, Described, Sample
from paxisim.logs.stream import Stream


class TopicStreams:
    """Collects the samples of messages, taken one after another.

    Attributes:
        path: The file or folder, for messages.
        types: Message type of each topic of the file, read or not.
        described: What messages say about the frames of a tactile sensor, by their topic.
        bad: Number of messages that could not be read.
        is_whole: Whether the file was read to its end.
    """

    def __init__(self, path: Path, files: Iterable[Path]) -> None:
        """Store the path; the sizes of `files` set the limit on the numbers that come out of them.

        Raises:
            FileNotFoundError: A file does not exist.
        """
        self.path = path
        self.types: dict[str, str] = {}
        self.bad = 0
        self.is_whole = True
        self.described: dict[str, Described] = {}
        self._most = sum(most_unpacked(file) for file in files)
        self._size = 0
        self._samples: dict[tuple[str, str], _Samples] = {}

    def add(self, topic: str, log_time: int, samples: Iterable[Sample]) -> None:
        """Add the samples of one message, whose log time (ns) counts if a sample has no time.

        Raises:
            InvalidValueError: There are too many streams or numbers.
            ValueError: A sample has another shape than those before it.
        """
        for name, at, value in samples:
            if isinstance(value, Described):
                self.described[topic] = value
                continue
            numbers = np.array(value, dtype=np.float64)  # None becomes NaN
            known = self._samples.get((topic, name))
            if known is None:
                known = self._samples[topic, name] = _Samples(numbers.shape)
                refuse_streams(self.path, len(self._samples))
            self._size += numbers.nbytes + 8
            refuse_unpacked(self.path, self._size, self._most)
            if numbers.shape != known.shape:
                raise ValueError(f"{name} has shape {numbers.shape}, previously {known.shape}")
            known.time.append(log_time if at is None else at)
            known.values.frombytes(numbers.tobytes())

    @property
    def count(self) -> int:
        """Number of streams."""
        return len(self._samples)

    def streams(self, *, without: Iterable[str] = ()) -> dict[str, Stream]:
        """Return the streams by name, without those of some topics; a name of several topics begins with its topic."""
        left_out = set(without)
        names = Counter(name for topic, name in self._samples if topic not in left_out)
        transforms = {name: samples.stream() for (_, name), samples in self._samples.items() if is_frame(name)}
        found, lost = poses_in_root(transforms)
        if lost:
            warnings.warn(f"{self.path}: frames on others that move were left out: {', '.join(lost)}", stacklevel=6)
        for (topic, name), samples in self._samples.items():
            if topic not in left_out and not is_frame(name):
                is_full = name.startswith("/") or names[name] > 1
                found[f"{topic.strip('/')}/{name.removeprefix('/')}" if is_full else name] = samples.stream()
        return found

    def of_topic(self, topic: str) -> dict[str, Stream]:
        """Return the streams of one topic by their names within it."""
        return {name: samples.stream() for (of, name), samples in self._samples.items() if of == topic}

    def check(self) -> TopicStreams:
        """Return itself; warns of what could not be read.

        Raises:
            InvalidValueError: No message could be read.
        """
        if not self._samples:
            expected = ", ".join(TYPES)
            raise InvalidValueError(
                f"{self.path} has no numeric stream: expected {expected} or JSON messages; its topics are: "
                f"{self.listed()}" + (f"; {self.bad} messages could not be read" if self.bad else "")
            )
        if not self.is_whole or self.bad:
            what = "" if self.is_whole else " is cut off or damaged;"
            bad = f" {self.bad} messages that could not be read were skipped;" if self.bad else ""
            warnings.warn(f"{self.path}:{what}{bad} the intact part was read", stacklevel=6)  # where it is loaded
        return self

    def listed(self) -> str:
        """Return the topics and their types, in words."""
        return ", ".join(f"{topic} ({kind})" for topic, kind in sorted(self.types.items())) or "none"


class _Samples:
    """Growing buffers for the samples of a stream."""

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.shape = shape
        self.time = array("q")
        self.values = array("d")

    def stream(self) -> Stream:
        time = np.array(self.time, dtype=np.int64)
        order = np.argsort(time, kind="stable")
        return Stream(time[order], np.array(self.values).reshape(len(time), *self.shape)[order])
