"""FrameJoiner: the frames of several ports as one tensor."""

from __future__ import annotations

from collections import deque

import numpy as np

from paxisim.hw.frame import Frame

MAX_AGE = 0.25
"""Seconds that a port's frame may lie from the pacing port's in time; above, its pads are marked `STALE`. The slowest
board known sends every 90 ms."""

STALE = 0xFE
"""Status of a pad whose port has sent nothing for `MAX_AGE`, though other ports have; no known board reports it."""

KEPT = 256
"""Frames kept of each port, for one that paces a hundred times slower than the others send."""


class FrameJoiner:
    """Joins the frames of several ports, their pads one after another. No I/O, no clock; not safe for several threads.

    The first port paces: each of its frames gives one joined frame, with its `time`. To it comes from each other port
    the frame nearest in time, as it is; forces are never interpolated. A frame of the first port waits until every
    other port has sent one that was measured later, but no longer than until the first port's next one arrives: then
    the newest of each port is taken, however old; one further than `MAX_AGE` from the pacing frame marks its pads as
    `STALE`. Frames that arrive at one moment, having waited while the system stopped this program, wait together.

    Before every port has sent a frame, nothing is joined. `Frame.arrival` of a joined frame is that of the part which
    came last, `Frame.sequence` counts the joined ones, `Frame.resultant` is None where one port reports none.
    """

    def __init__(self, ports: int) -> None:
        """Start with nothing.

        Args:
            ports: How many there are.
        """
        self._waiting: deque[Frame] = deque()
        self._others: list[deque[Frame]] = [deque(maxlen=KEPT) for _ in range(ports - 1)]
        self._sequence = 0

    def push(self, port: int, frame: Frame) -> list[Frame]:
        """The joined frames that are complete now that `port` (from 0) has sent `frame`, in order."""
        joined, waiting = [], self._waiting
        if port > 0:
            self._others[port - 1].append(frame)
        else:
            while waiting and waiting[0].arrival < frame.arrival:
                joined += self._join()
            waiting.append(frame)
        while waiting and all(frames and frames[-1].time >= waiting[0].time for frames in self._others):
            joined += self._join()
        return joined

    def clear(self) -> None:
        """Forget the frames at hand."""
        self._waiting.clear()
        for frames in self._others:
            frames.clear()

    def _join(self) -> list[Frame]:
        """The frame of the first port with the nearest of the others; nothing where one is missing."""
        first = self._waiting.popleft()
        if not all(self._others):
            return []
        parts = [first, *(_nearest(frames, first.time) for frames in self._others)]
        status = [code if abs(part.time - first.time) <= MAX_AGE else STALE for part in parts for code in part.status]
        resultants = [part.resultant for part in parts if part.resultant is not None]
        joined = Frame(
            np.concatenate([part.force for part in parts]),
            first.time,
            max(part.arrival for part in parts),
            self._sequence,
            tuple(status),
            np.concatenate(resultants) if len(resultants) == len(parts) else None,
            first.unit,
        )
        self._sequence += 1
        return [joined]


def _nearest(frames: deque[Frame], time: float) -> Frame:
    """The frame nearest to `time`; those before it are not needed again and go."""
    while len(frames) > 1 and abs(frames[1].time - time) <= abs(frames[0].time - time):
        frames.popleft()
    return frames[0]
