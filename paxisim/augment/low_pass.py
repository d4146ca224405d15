"""LowPass: a first-order lag, as of a sensor's filter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter import namespace, parameter
from paxisim.augment.transform import Covariates, Memory, State


@dataclass(frozen=True, eq=False)
class LowPass(Memory):
    """A first-order low-pass filter: ``tau dy/dt = x - y``, tau = 0 for none.

    The input is taken to run straight from frame to frame (first-order hold), for which the step below is exact
    at any `dt`; a zero-order hold would add half a frame of latency that is not there.

    Attributes:
        tau: ``(...)`` time constant (s); the cut-off frequency is ``1 / (2 pi tau)``.
    """

    stage: ClassVar[str] = "electronics"

    tau: Any = parameter(0.0, unit="s", low=0.0, typical=(0.01, 0.16))

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """``(x, y)`` of the frame before."""
        return (x, x)

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `Memory.advance`."""
        xp = namespace(x)
        before, y = state
        tau = self.fit("tau", x)
        lag = xp.where(tau > 0, tau, xp.ones_like(tau))
        decay = xp.exp(-dt / lag)
        # exact for x(t) = before + (x - before) t / dt
        share = lag * -xp.expm1(-dt / lag) / xp.where(dt > 0, dt, xp.ones_like(dt))
        filtered = decay * y + (share - decay) * before + (1 - share) * x
        y = xp.where((tau > 0) & (dt > 0), filtered, xp.where(tau > 0, y, x))
        return y, (x, y)
