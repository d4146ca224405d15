"""FrameJoiner: joins the frames of several ports into one tensor."""

from __future__ import annotations

from collections import deque

import numpy as np

from paxisim.hw.frame import Frame

MAX_AGE = 0.25
"""Maximum time difference (s) between a port's frame and the pacing frame; beyond it, the port's pads are marked
`STALE_STATUS`. The slowest known board sends every 90 ms."""

STALE_STATUS = 0xFE
"""Status of a pad whose frame is more than `MAX_AGE` away from the pacing frame, or that a server sent twice; no known
board reports this code."""

MAX_KEPT_FRAMES = 256
"""Frames kept per port; enough if the pacing port is a hundred times slower than the others."""


class FrameJoiner:
    """Joins the frames of several ports, with their pads one after another. No I/O, no clock; not thread-safe.

    The first port sets the pace: each of its frames yields one joined frame with the same `time`. Every other port
    contributes the frame nearest in time, unchanged; forces are never interpolated. A frame of the first port waits
    until every other port has sent a frame measured at that time or later, but at most until the next frame of the
    first port arrives. Then the nearest frame of each port is used, however old. A frame further than `MAX_AGE` from
    the pacing frame marks its pads as `STALE_STATUS`. Frames that arrive at the same moment, because the system had
    suspended this program, wait together.

    Nothing is joined until every port has sent a frame. `Frame.arrival` of a joined frame is the latest arrival of its
    parts, `Frame.sequence` counts joined frames, and `Frame.resultant` is None if any port reports none.
    """

    def __init__(self, ports: int) -> None:
        """Start without frames.

        Args:
            ports: Number of ports.
        """
        self._waiting: deque[Frame] = deque()
        self._others: list[deque[Frame]] = [deque(maxlen=MAX_KEPT_FRAMES) for _ in range(ports - 1)]
        self._sequence = 0

    def push(self, port: int, frame: Frame) -> list[Frame]:
        """Add a frame of `port` (counted from 0) and return the joined frames that it completes, in order."""
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
        """Discard all frames held."""
        self._waiting.clear()
        for frames in self._others:
            frames.clear()

    def _join(self) -> list[Frame]:
        """Join the first port's oldest frame with the nearest ones of the others; empty if a port has none."""
        first = self._waiting.popleft()
        if not all(self._others):
            return []
        parts = [first, *(_nearest(frames, first.time) for frames in self._others)]
        status = [
            code if abs(part.time - first.time) <= MAX_AGE else STALE_STATUS for part in parts for code in part.status
        ]
        resultants = [part.resultant for part in parts if part.resultant is not None]
        joined = Frame(
            np.concatenate([part.force for part in parts]),
            first.time,
            max(part.arrival for part in parts),
            self._sequence,
            tuple(status),
            np.concatenate(resultants) if len(resultants) == len(parts) else None,
            first.unit,
            max(part.time_error for part in parts),
        )
        self._sequence += 1
        return [joined]


def _nearest(frames: deque[Frame], time: float) -> Frame:
    """Return the frame nearest to `time` and drop the earlier ones, which are not needed again."""
    while len(frames) > 1 and abs(frames[1].time - time) <= abs(frames[0].time - time):
        frames.popleft()
    return frames[0]
