"""Latency: readings arrive late, by a delay that may jitter; in a recording they may also be early."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.parameter_spec import as_like, can_look, is_torch, namespace, parameter
from paxisim.augment.random_numbers import SEEDS, check_seed, no_draws, uniform
from paxisim.augment.transform import Covariates, State, StatefulTransform
from paxisim.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class Latency(StatefulTransform):
    """A delayed reading: ``y(t) = x(t - d)``, ``d = delay + jitter u``, with u uniform in (-1, 1) for each frame.

    Causes are the conversion, the bus and the operating system's buffers. x is interpolated linearly between frames, so
    the delay need not be a whole number of frames and the frames may be unevenly spaced. All taxels of an environment
    share one delay.

    - In a stream, d is never negative and grows by at most `dt` from frame to frame: readings arrive in order.
    - u is a function of the seed and the number of frames so far (see `WhiteNoise` for seeds and `reset`).
    - At most `capacity` frames are kept. If frames come so fast that ``capacity - 2`` of them do not span ``delay +
      jitter``, the delay is still right, but x is interpolated between fewer frames and short peaks are cut: a frame is
      dropped if the frames before and after it are less than ``2 (delay + jitter) / (capacity - 2)`` apart. Time and
      memory grow with `capacity`.
    - The first frame, and the first after `reset`, counts as constant before that time.
    - A negative `delay` is for recordings whose other stream is the late one: `run` then reads ahead in the sequence,
      and holds its last frame. It must be a single number, without jitter. It does not work frame by frame, because no
      sensor reads the future; delay the simulated stream instead.

    Example:
        ``Latency(delay=1.5)``:

        | t (s) | x (N) | y (N) | from |
        |---|---|---|---|
        | 0 | 0 | 0 | the first frame, held |
        | 1 | 1 | 0 | the same |
        | 2 | 4 | 0.5 | halfway from t = 0 to 1 |
        | 3 | 9 | 2.5 | halfway from t = 1 to 2 |

    The range is ours: 5 to 120 ms, with a few ms of jitter.

    Attributes:
        delay: ``(...)`` mean delay (s). If negative, a single number, and only for `run`.
        jitter: ``(...)`` largest deviation from the mean delay (s).
        seed: ``(...)`` random seeds, whole numbers in [0, 2^32).
        capacity: Maximum number of frames kept, at least 3.

    Raises:
        InvalidValueError: Also if a seed is not an integer, if `capacity` is below 3 or not a whole number, or if a
            negative `delay` has jitter, is one of several, or is used on a stream.
    """

    stage: ClassVar[str] = "electronics"

    delay: Any = parameter(0.0, unit="s", typical=(0.005, 0.12))
    jitter: Any = parameter(0.0, unit="s", low=0.0, typical=(0.0, 0.005))
    seed: Any = parameter(0, low=0, high=SEEDS - 1, typical=(0, SEEDS - 1), whole=True, seeds="jitter")
    capacity: int = 16

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        check_seed("Latency", self.seed)
        if not isinstance(self.capacity, int) or self.capacity < 3:
            raise InvalidValueError(f"Latency: capacity must be a whole number of at least 3, got {self.capacity!r}")
        if self.reads_ahead and (math.prod(np.shape(self.delay)) > 1 or _any(self.jitter, lambda jitter: jitter != 0)):
            raise InvalidValueError(
                f"Latency: a delay below 0 must be one number, without jitter, got delay {self.delay!r} and jitter "
                f"{self.jitter!r}"
            )

    def between_frames(self, step: float) -> Latency:
        """See `Transform.between_frames`; points between frames need a larger buffer."""
        more = math.ceil(4 * abs(float(self.delay)) / step) + 4
        return replace(self, capacity=max(self.capacity, more))

    @property
    def reads_ahead(self) -> bool:
        """Whether any delay is negative; a traced delay, or one on an accelerator, counts as not negative."""
        return _any(self.delay, lambda delay: delay < 0)

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return the kept frames, oldest first, their ages (s), the last delay (s) and the number of frames so far.

        The shapes are ``(*batch, capacity, pads, 3, rows, cols)``, ``(*batch, capacity, 1, 1, 1, 1)``, and twice
        ``(*batch, 1, 1, 1, 1)``.
        """
        if self.reads_ahead:
            raise InvalidValueError(
                f"Latency: with a delay of {float(self.delay):g} s a frame would be read before it arrives; delay "
                "the simulated stream instead, remove the latency, or use run(x, time) on a whole sequence"
            )
        xp = namespace(x)
        frames = xp.concat([_slot(x)] * self.capacity, axis=-5)
        ages = xp.zeros_like(frames[..., :1, :1, :1, :1])
        longest = (
            xp.zeros_like(x[..., :1, :1, :1, :1])
            + self.broadcast_parameter("delay", x)
            + self.broadcast_parameter("jitter", x)
        )
        return (frames, ages, longest, no_draws(x))

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        xp = namespace(x)
        frames, ages, last, count = state
        delay, jitter = self.broadcast_parameter("delay", x), self.broadcast_parameter("jitter", x)
        late = delay
        if not isinstance(self.jitter, float) or self.jitter:  # skipping the draw halves the time of a small frame
            late = delay + jitter * (2 * uniform(self.seed, count, x, _JITTER) - 1)
        late = xp.minimum(xp.maximum(late, xp.zeros_like(late)), last + dt)

        # the previous frame is kept unless the one before it is still close (the last factor allows for rounding)
        ages = ages + _slot(dt)
        spacing = (delay + jitter) * (2 / (self.capacity - 2) * (1 - 1e-6))
        close = ages[_LAST_BUT_ONE] < _slot(spacing)
        kept, kept_ages = xp.where(close, frames[_OLDER], frames[_NEWER]), xp.where(close, ages[_OLDER], ages[_NEWER])
        frames = xp.concat([kept, xp.broadcast_to(_slot(x), kept[_LAST].shape)], axis=-5)
        ages = xp.concat([kept_ages, xp.zeros_like(kept_ages[_LAST])], axis=-5)

        # position of the delayed time between each frame (0) and the one before it (1)
        gap, way = ages[_OLDER] - ages[_NEWER], _slot(late) - ages[_NEWER]
        zero, one = xp.zeros_like(gap), xp.ones_like(gap)
        way = xp.where(gap > 0, way / xp.where(gap > 0, gap, one), xp.where(way > 0, one, zero))
        way = xp.minimum(xp.maximum(way, zero), one)
        weights = xp.concat([way[_FIRST], way[_NEWER] - way[_OLDER], 1 - way[_LAST]], axis=-5)
        return xp.sum(weights * frames, axis=-5), (frames, ages, late, count + 1)

    def run(self, x: Any, time: Any, covariates: Covariates | None = None) -> Any:
        """See `Transform.run`."""
        if not self.reads_ahead:
            return super().run(x, time, covariates)
        steps = self._time_steps(x, time)
        self._check_frame(x[0])
        return _moved(x, np.cumsum(steps, axis=0), float(self.delay))

    def sweep(self, x: NDArray[np.floating], steps: NDArray[np.float64]) -> NDArray[np.floating] | None:
        """See `Transform.sweep`."""
        if np.ndim(self.delay) or np.ndim(self.jitter) or self.jitter:
            return None
        delay = float(self.delay)
        if delay == 0:
            return x.copy()
        if len(steps) > 1 and steps[1].min() == 0:
            return None  # the first frame is held, not the last one of its time
        if len(steps) > 2 and (steps[1:-1] + steps[2:]).min() <= delay * 2 / (self.capacity - 2):
            return None  # stepping would drop frames
        return _moved(x, np.cumsum(steps, axis=0), delay)


def _any(value: Any, holds: Callable[[Any], Any]) -> bool:
    """Whether a condition holds for any of a parameter's numbers, if they can be read."""
    if isinstance(value, (int, float)):  # fast path: the code below would dominate the cost of a small frame
        return bool(holds(value))
    if is_torch(value):
        return can_look(value) and bool(holds(value).any())
    return bool(np.any(holds(np.asarray(value))))


def _moved(x: Any, time: NDArray[np.float64], delay: float) -> Any:
    """Delay a sequence ``(time, ...)`` by linear interpolation between frames; both ends are held."""
    if len(time) == 1:
        return x + 0
    clocks = time.reshape(len(time), -1)  # one for each stream, or one for all
    then = np.clip(clocks - delay, clocks[0], clocks[-1])
    after = np.stack([np.searchsorted(*pair, side="right") for pair in zip(clocks.T, then.T, strict=True)], axis=1)
    after = np.clip(after, 1, len(time) - 1)
    start = np.take_along_axis(clocks, after - 1, axis=0)
    gap = np.take_along_axis(clocks, after, axis=0) - start
    way = np.divide(then - start, gap, out=np.ones_like(gap), where=gap > 0)  # at a jump: the last value
    # the frames of all streams in one row
    count = clocks.shape[1]
    place = namespace(x).asarray((after * count + np.arange(count)).ravel())
    frames = x.reshape(-1, *x.shape[time.ndim :])
    way = as_like(way.reshape(-1, *[1] * (frames.ndim - 1)), x)
    return (frames[place - count] * (1 - way) + frames[place] * way).reshape(x.shape)


def _slot(x: Any) -> Any:
    """Reshape ``(*batch, pads, 3, rows, cols)`` to ``(*batch, 1, pads, 3, rows, cols)``."""
    return x[..., None, :, :, :, :]


_FIRST, _LAST, _LAST_BUT_ONE, _OLDER, _NEWER = (
    (..., slots, *[slice(None)] * 4)
    for slots in (slice(None, 1), slice(-1, None), slice(-2, -1), slice(None, -1), slice(1, None))
)
_JITTER = 3  # stream of `random_numbers` used for the jitter
