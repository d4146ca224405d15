"""LowPass: a first-order lag, as of a sensor's filter."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, State, StatefulTransform, keep

_LARGE = 2_000  # numbers in a frame, so many that a call for each costs little


@dataclass(frozen=True, eq=False)
class LowPass(StatefulTransform):
    """A first-order low-pass filter: ``tau dy/dt = x - y``, tau = 0 for none.

    The input is taken to run straight from frame to frame (first-order hold), for which the step below is exact
    at any `dt`; a zero-order hold would add half a frame of latency that is not there.

    Attributes:
        tau: ``(...)`` time constant (s); the cut-off frequency is ``1 / (2 pi tau)``.
    """

    stage: ClassVar[str] = "electronics"

    tau: Any = parameter(0.0, unit="s", low=0.0, typical=(0.01, 0.16))

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """The frame before, and by how much the output was ahead of it."""
        return (keep(x), namespace(x).zeros_like(x))

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        before, ahead = state
        ahead = lag(x - before, ahead, self.broadcast_parameter("tau", x), dt)
        return x + ahead, (keep(x), ahead)

    def sweep(self, x: NDArray[np.floating], steps: NDArray[np.float64]) -> NDArray[np.floating] | None:
        """See `Transform.sweep`."""
        return None if np.ndim(self.tau) else x + lag_sequence(x, float(self.tau), steps)


def lag(change: Any, ahead: Any, tau: Any, dt: Any) -> Any:
    """One step of ``tau dq/dt = x - q`` for ``q - x``, exact for an x that runs straight.

    In this form an x that stands still costs no digits, however small `dt` is against `tau`.

    Args:
        change: By how much x changed in the step.
        ahead: q - x before the step.
        tau: Time constant (s); 0: q is x.
        dt: Time (s); 0: x jumps.

    Returns:
        q - x after the step.
    """
    xp = namespace(change)
    lags = tau > 1e-30 * dt  # else it would divide by zero, or by next to nothing
    z = dt / xp.where(lags, tau, xp.ones_like(tau))
    run = xp.where(z > 0, z, xp.ones_like(z))
    share = xp.where(z > 0, -xp.expm1(-run) / run, xp.ones_like(z))
    return xp.where(lags, xp.exp(-z) * ahead - share * change, xp.zeros_like(ahead))


def lag_sequence(x: NDArray[np.floating], tau: float, steps: NDArray[np.float64]) -> NDArray[np.floating]:
    """`lag` over a whole sequence: q - x at each frame of ``(time, ...)``, 0 at the first."""
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
    """To each frame of ``(time, ...)`` add `decay` ``(time, 1, ...)`` times the one before, first to last, in place.

    Stretches of frames are gone through side by side, each from 0, and then told how the one before has ended: for
    small frames the calls cost more than the numbers.
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
