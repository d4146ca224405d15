"""SampleClock: estimates the measurement times of frames from their arrival times."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

LEARNING_FRAMES = 128
"""Number of steady frames before an estimate differs from the arrival."""

MEMORY_FRAMES = 256
"""Number of frames after which an old one has weight 1/e in the fit: 3 s at 83 Hz."""

BUCKETS, BUCKET = 8, 16
"""The earliest of the last 8 x 16 arrivals fix the height of the line. A longer window would smear drift; a shorter one
might hold no frame that arrived without delay."""

UNSTEADY = 1.5
"""Threshold on the variance about the line divided by the variance of the intervals. A steady clock with jitter on each
arrival gives 0.5; frames that each wait for the one before wander off the line and give far more."""

QUEUE = 8
"""Number of successive frames needed to estimate a period before the rate is learnt. As many frames in one read come
from a queue that built up while the host was stalled: the oldest is the next frame, and missing ones were lost when the
queue was full."""

NEGLIGIBLE = 0.05
"""Fraction of a period: a scatter about the line below this counts as steady."""

MAX_SLIPS = 0.2
"""Fraction of recent frames that may miss their place on the line before the line is discarded."""


class SampleClock:
    """Estimates when a steady board measured, from the arrivals of its frames. Online, O(1) per frame, no I/O.

    Port and scheduler can only delay a frame, so the arrivals of a board that measures at a steady rate lie on or above
    a line over the frame numbers. A least-squares fit with exponential forgetting gives the slope of the line, which is
    the board's true period. The earliest of the recent arrivals give its height. The estimate is the line. The part of
    the delay that all frames share is unobservable and stays in the estimate.

    A frame more than three quarters of a period late is taken to follow lost frames. Frames fetched in one read have
    waited for the host, so their arrivals carry no information on the line, but they were measured at least a period
    apart: no estimate is later than that allows, and no loss is assumed where they fill the time since the last frame.

    Where the arrivals follow no steady clock, the arrival itself is the estimate: for the first `LEARNING_FRAMES`
    frames, after a change of rate, and for a board that sends on request, where the load sets the intervals.

    Estimates never run backwards and are never after the arrival.
    """

    def __init__(self) -> None:
        """Start without any estimate."""
        self._last = -math.inf
        self._queue = 0
        self._apart = 0.0
        self._earliest: deque[tuple[int, float]] = deque(maxlen=BUCKETS)
        self.reset()

    def reset(self) -> None:
        """Discard rate and phase, as after the port was reopened; estimates still never run backwards."""
        # keep the last known period as the spacing of frames that waited
        self._apart = max(self.period or 0.0, 0.0) or self._apart
        self._learning: list[float] = []
        self._line = _Line()
        self._intervals = _Spread()
        self._earliest.clear()
        self._held = 0
        self._number = 0
        self._arrival = 0.0
        self._slipped = False
        self._slips = 0.0
        self._unfitted = 0

    @property
    def period(self) -> float | None:
        """Time (s) between two frames; None if no steady rate is known."""
        return self._line.slope if self._earliest else None

    def estimate(self, arrival: float, behind: int = 0) -> float:
        """Estimate when a frame was measured (s). Call it once for each frame, in order.

        Args:
            arrival: Time (s) at which the last byte of the frame was read.
            behind: Number of frames of the same read still to follow, see `Reading.behind`.
        """
        if behind and not self._queue:
            self._measure_period()
        queue, self._queue = self._queue, behind and max(self._queue, behind + 1)
        latest = max(self._last, arrival - behind * self._apart)
        time = self._follow(latest, max(queue, self._queue)) if self._earliest else latest
        if not self._earliest:
            self._learning.append(latest)
            if len(self._learning) == LEARNING_FRAMES:
                self._learn()
        self._last = max(self._last, min(time, latest))
        return self._last

    def _measure_period(self) -> None:
        """Update the spacing of frames with the best estimate so far."""
        known = self._learning
        if self._earliest:
            self._apart = self._line.slope
        elif len(known) > QUEUE:
            self._apart = (known[-1] - known[0]) / (len(known) - 1)

    def _learn(self) -> None:
        """Fit the frames collected so far; if they are not steady, start again."""
        arrivals, intervals = self._learning, np.diff(self._learning)
        typical = float(np.median(intervals))
        self.reset()
        if typical <= 0:
            return
        # a late frame lengthens one interval and shortens the next; a lost frame lengthens their sum
        periods = np.pad(intervals / typical, 1, constant_values=np.inf)
        sums = periods[:-1] + periods[1:] - 1
        steps = np.minimum(periods[1:-1], np.minimum(sums[:-1], sums[1:]))
        steps = np.maximum(1, np.rint(steps)).astype(int)
        numbers = [0, *np.cumsum(steps).tolist()]
        for number, arrival in zip(numbers, arrivals, strict=True):
            self._line.add(number, arrival)
        for interval in intervals[steps == 1].tolist():
            self._intervals.add(interval)
        self._number, self._arrival = numbers[-1], arrivals[-1]
        self._slips = float(np.mean(steps != 1))
        if self._is_steady():
            for number, arrival in zip(numbers, arrivals, strict=True):
                self._hold(number, arrival)

    def _follow(self, arrival: float, queue: int) -> float:
        """Return the line at the next frame; reset if the frame shows that the arrivals follow no line.

        Args:
            arrival: Arrival of the frame (s), or an upper bound of it.
            queue: Number of frames fetched in the same read; 0 if it came alone.
        """
        late = (arrival - self._expected(self._number + 1)) / self._line.slope
        if queue:
            return self._follow_queue(arrival, late, queue)
        slip = round(late - 0.25)
        number = self._number + 1 + slip
        self._unfitted = 0
        if slip == 0:
            self._line.add(number, arrival)
            self._hold(number, arrival)
            if not self._slipped:
                self._intervals.add(arrival - self._arrival)
        self._slips += ((slip != 0) - self._slips) * 2 / LEARNING_FRAMES
        self._number, self._arrival, self._slipped = number, arrival, slip != 0
        if slip > LEARNING_FRAMES or not self._is_steady():
            self.reset()
            return arrival
        return self._expected(number)

    def _follow_queue(self, arrival: float, late: float, queue: int) -> float:
        """Like `_follow` for a frame that waited for the host, so its arrival carries no information on the line."""
        self._number += 1 + (max(math.floor(late), 0) if queue < QUEUE else 0)
        self._arrival, self._slipped = arrival, True
        self._unfitted += 1
        if self._unfitted > MEMORY_FRAMES:
            self.reset()
            return arrival
        return self._expected(self._number)

    def _expected(self, number: int) -> float:
        """Return the height at `number` of the line through the earliest arrivals."""
        slope = self._line.slope
        return min(arrival + slope * (number - at) for at, arrival in self._earliest)

    def _hold(self, number: int, arrival: float) -> None:
        """Keep the arrival if it is the earliest in its bucket."""
        if self._held % BUCKET == 0:
            self._earliest.append((number, arrival))
        else:
            at, earliest = self._earliest[-1]
            if arrival < earliest + self._line.slope * (number - at):
                self._earliest[-1] = (number, arrival)
        self._held += 1

    def _is_steady(self) -> bool:
        slope = self._line.slope
        allowed = max(UNSTEADY * self._intervals.variance, (NEGLIGIBLE * slope) ** 2)
        return slope > 0 and self._slips <= MAX_SLIPS and self._line.variance <= allowed


class _Spread:
    """Mean and variance of numbers, with exponential forgetting."""

    def __init__(self) -> None:
        self._weight = self._mean = self._moment = 0.0

    def add(self, value: float) -> None:
        self._weight = 1 + self._weight * (1 - 1 / MEMORY_FRAMES)
        off = value - self._mean
        self._mean += off / self._weight
        self._moment = self._moment * (1 - 1 / MEMORY_FRAMES) + off * (value - self._mean)

    @property
    def variance(self) -> float:
        return self._moment / self._weight if self._weight else 0.0


class _Line:
    """Straight line fitted to points with exponential forgetting, by moments about their running mean."""

    def __init__(self) -> None:
        self._weight = self._x = self._y = self._xx = self._xy = self._yy = 0.0

    def add(self, x: float, y: float) -> None:
        keep = 1 - 1 / MEMORY_FRAMES
        self._weight = 1 + self._weight * keep
        dx, dy = x - self._x, y - self._y
        self._x += dx / self._weight
        self._y += dy / self._weight
        self._xx = self._xx * keep + dx * (x - self._x)
        self._xy = self._xy * keep + dx * (y - self._y)
        self._yy = self._yy * keep + dy * (y - self._y)

    @property
    def slope(self) -> float:
        return self._xy / self._xx if self._xx else 0.0

    @property
    def variance(self) -> float:
        """Variance of the points about the line."""
        return max(0.0, self._yy - self.slope * self._xy) / self._weight if self._weight else 0.0
