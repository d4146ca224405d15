"""LowPass: a first-order lag, such as a sensor's filter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, State, StatefulTransform, keep

_LARGE = 2_000  # numbers in a frame above which the overhead of one call per frame is negligible


@dataclass(frozen=True, eq=False)
class LowPass(StatefulTransform):
    """A first-order low-pass filter: ``tau dy/dt = x - y``, without filtering if tau = 0.

    The input is assumed to be piecewise linear between frames (first-order hold), for which the step below is exact at
    any `dt`. A zero-order hold would add half a frame of spurious latency.

    Attributes:
        tau: ``(...)`` time constant (s); the cut-off frequency is ``1 / (2 pi tau)``.
    """

    stage: ClassVar[str] = "electronics"

    tau: Any = parameter(0.0, unit="s", low=0.0, typical=(0.01, 0.16))

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return the previous frame and the output's lead over it."""
        return (keep(x), namespace(x).zeros_like(x))

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        before, ahead = state
        ahead = lag(x - before, ahead, self.broadcast_parameter("tau", x), dt)
        return x + ahead, (keep(x), ahead)

    def between_frames(self, step: float) -> LowPass:
        """See `Transform.between_frames`."""
        return self

    def sweep(self, x: NDArray[np.floating], steps: NDArray[np.float64]) -> NDArray[np.floating] | None:
        """See `Transform.sweep`."""
        return None if np.ndim(self.tau) else x + lag_sequence(x, float(self.tau), steps)


def lag(change: Any, ahead: Any, tau: Any, dt: Any) -> Any:
    """Advance ``q - x`` by one step of ``tau dq/dt = x - q``, exactly for a linear x.

    This form loses no precision if x is constant, however small `dt` is compared to `tau`.

    Args:
        change: Change of x during the step.
        ahead: q - x before the step.
        tau: Time constant (s); with 0, q equals x.
        dt: Time step (s); with 0, x jumps.

    Returns:
        q - x after the step.
    """
    xp = namespace(change)
    lags = tau > 1e-30 * dt  # else the division would be by zero or nearly zero
    z = dt / xp.where(lags, tau, xp.ones_like(tau))
    run = xp.where(z > 0, z, xp.ones_like(z))
    share = xp.where(z > 0, -xp.expm1(-run) / run, xp.ones_like(z))
    return xp.where(lags, xp.exp(-z) * ahead - share * change, xp.zeros_like(ahead))


def lag_sequence(x: NDArray[np.floating], tau: float, steps: NDArray[np.float64]) -> NDArray[np.floating]:
    """Apply `lag` to a whole sequence: q - x at each frame of ``(time, ...)``, 0 at the first."""
    dt = steps.astype(x.dtype).reshape(*steps.shape, *[1] * (x.ndim - steps.ndim))
    lags = tau > 1e-30 * dt
    z = np.divide(dt, tau, out=np.zeros_like(dt), where=lags)
    share = np.divide(-np.expm1(-z), z, out=np.ones_like(z), where=z > 0)
    ahead = np.zeros_like(x)
    np.subtract(x[:-1], x[1:], out=ahead[1:])
    ahead *= np.where(lags, share, 0)
    _accumulate(ahead, np.where(lags, np.exp(-z), 0))
    return ahead


def _accumulate(values: NDArray[np.floating], decay: NDArray[np.floating]) -> None:
    """Add to each frame of ``(time, ...)``, in order and in place, `decay` ``(time, 1, ...)`` times the one before.

    Several stretches of frames are accumulated in parallel, each starting at 0, and then corrected by the end value of
    the stretch before. For small frames, the call overhead would otherwise exceed the arithmetic.
    """
    frames = len(values)
    length = frames if values[:1].size > _LARGE else max(math.isqrt(frames), 1)
    count = frames // length
    whole = count * length
    side = values[:whole].reshape(count, length, *values.shape[1:])
    decays = decay[:whole].reshape(count, length, *decay.shape[1:])
    for frame in range(1, length):
        side[:, frame] += decays[:, frame] * side[:, frame - 1]
    through = np.cumprod(decays, axis=1)
    for stretch in range(1, count):
        side[stretch] += through[stretch] * side[stretch - 1, -1]
    for frame in range(whole, frames):
        values[frame] += decay[frame] * values[frame - 1]
