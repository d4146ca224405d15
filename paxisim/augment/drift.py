"""Drift: the zero drifts with time, at a constant rate and as the device warms up."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

from paxisim.augment.clocked import Clocked
from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates


@dataclass(frozen=True, eq=False)
class Drift(Clocked):
    """A zero that drifts with time since zeroing, t: ``y = x + rate t + amplitude (1 - exp(-t / tau))``.

    The linear term stands for drift that is slow compared to a recording. The exponential term is the warm-up of the
    electronics after power-on or after a change of their load. If the temperature was recorded, `TemperatureDrift` is
    the more specific model.

    t equals `start` at the first frame and advances by `dt`. It is kept in float64, because float32 would lose a
    hundredth of a second after a day. `reset` sets it back to `start`.

    Example:
        ``Drift(rate=[[[[0.01]]]], amplitude=[[[[0.1]]]], tau=1.0)``, without load:

        | t (s) | linear (N) | warm-up (N) | y (N) |
        |---|---|---|---|
        | 0 | 0 | 0 | 0 |
        | 1 | 0.01 | 0.0632 | 0.0732 |
        | 2 | 0.02 | 0.0865 | 0.1065 |
        | 3 | 0.03 | 0.0950 | 0.1250 |

    No figures for this sensor are known; the ranges are ours: 0.5 to 10 % of a full scale of 25 N in ten minutes.

    Attributes:
        rate: ``(..., pads, 3, rows, cols)`` linear drift (N/s); any of the four dimensions may be 1.
        amplitude: ``(..., pads, 3, rows, cols)`` total warm-up drift (N); any of the four dimensions may be 1.
        tau: ``(...)`` time constant of the warm-up (s); with 0 the warm-up is already complete.
        start: ``(...)`` time since zeroing at the first frame (s).
    """

    stage: ClassVar[str] = "electronics"

    rate: Any = parameter(((((0.0,),),),), "pkrc", unit="N/s", typical=(-4e-3, 4e-3))
    amplitude: Any = parameter(((((0.0,),),),), "pkrc", unit="N", typical=(-2.5, 2.5))
    tau: Any = parameter(300.0, unit="s", low=0.0, typical=(60.0, 1800.0))
    start: Any = parameter(0.0, unit="s", low=0.0, typical=(0.0, 600.0))

    def at(self, x: Any, time: Any, covariates: Covariates) -> Any:
        """See `Clocked.at`."""
        xp = namespace(x)
        t = self.broadcast_parameter("start", x) + time
        tau = self.broadcast_parameter("tau", x)
        takes_time = tau > 1e-30 * t  # else the division would be by zero or nearly zero
        warm = -xp.expm1(-t / xp.where(takes_time, tau, xp.ones_like(t)))
        warm = xp.where(takes_time, warm, xp.ones_like(t))
        return x + self.broadcast_parameter("rate", x) * t + self.broadcast_parameter("amplitude", x) * warm

    def later(self, seconds: float) -> Drift:
        """See `Clocked.later`."""
        return replace(self, start=self.start + seconds)
