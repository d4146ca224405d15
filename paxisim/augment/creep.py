"""Creep: under a constant load the gel keeps giving way slowly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.low_pass import lag, lag_sequence
from paxisim.augment.modes import check_modes, each_mode, over_modes
from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, State, StatefulTransform, keep


@dataclass(frozen=True, eq=False)
class Creep(StatefulTransform):
    """The reading follows a load at once and then creeps on, as a sum of M relaxation modes (a Prony series).

    ::

        y = x + sum_m amplitude_m (q_m - held u)        tau_m dq_m/dt = u - q_m        u = x (1 + growth |x|)

    Silicone is viscoelastic: under a held load it sinks in further, along with the magnets, and after unloading the
    reading recovers late. Without `held` and `growth`, the instantaneous gain is 1 and the steady-state gain is ``1 +
    sum amplitude``; at angular frequency w the gain is ``1 + sum amplitude / (1 + i w tau)``. With a negative amplitude
    the reading falls under a held load, as stress relaxes under a held indentation. A sensor that was calibrated with
    held loads (`held` of 1) reads too little at once, and correctly once the creep has ended. With a `growth`, large
    loads creep by a larger share than small ones; otherwise the transform is linear. It acts on each element
    independently. With amplitudes of 0, y equals x.

    The input is assumed to be piecewise linear between frames, for which a step is exact at any `dt`. The first frame,
    and the first after `reset`, counts as a constant load whose creep is complete.

    Example:
        ``Creep(amplitude=(0.2,), tau=(1.0,))``, with a load that rises to 1 N within the first second:

        | t (s) | x (N) | q (N) | y (N) |
        |---|---|---|---|
        | 0 | 0 | 0 | 0 |
        | 1 | 1 | 0.368 | 1.074 |
        | 2 | 1 | 0.767 | 1.153 |
        | 3 | 1 | 0.914 | 1.183 |

    Source: linear viscoelasticity, e.g. J. D. Ferry, Viscoelastic Properties of Polymers, 3rd ed. (1980), ch. 3. No
    figures for this sensor are known; the ranges are ours: 2 to 25 % creep, over 0.2 to 60 s.

    Attributes:
        amplitude: ``(..., M)`` creep of each mode as a fraction of the load.
        tau: ``(..., M)`` time constants (s); a mode with 0 follows immediately. M may be 1 in one of the two.
        held: ``(...)`` 0 if the sensor reads correctly at once, 1 if it does once creep has ended, or in between.
        growth: ``(...)`` increase of the creeping share per newton of load (1/N).

    Raises:
        InvalidValueError: Also if the two have different numbers of modes.
    """

    stage: ClassVar[str] = "gel"

    amplitude: Any = parameter((0.0,), "m", low=-1.0, typical=(0.02, 0.25))
    tau: Any = parameter((1.0,), "m", unit="s", low=0.0, typical=(0.2, 60.0))
    held: Any = parameter(0.0, low=0.0, high=1.0, typical=(0.0, 1.0))
    growth: Any = parameter(0.0, unit="1/N", typical=(0.0, 0.1))

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        check_modes(self, "amplitude", "tau")

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return the previous drive u and each mode's lead over it, ``(*batch, M, pads, 3, rows, cols)``."""
        return (keep(self._drive(x)), namespace(x).zeros_like(over_modes(self, x, "amplitude", "tau")))

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        before, ahead = state
        drive, modes = self._drive(x), each_mode(x)
        ahead = lag(each_mode(drive - before), ahead, self.broadcast_parameter("tau", modes), each_mode(dt))
        left = each_mode((1 - self.broadcast_parameter("held", x)) * drive)
        y = x + namespace(x).sum(self.broadcast_parameter("amplitude", modes) * (left + ahead), axis=-5)
        return y, (keep(drive), ahead)

    def sweep(self, x: NDArray[np.floating], steps: NDArray[np.float64]) -> NDArray[np.floating] | None:
        """See `Transform.sweep`."""
        if max(np.ndim(self.amplitude), np.ndim(self.tau)) > 1 or np.ndim(self.held) or np.ndim(self.growth):
            return None
        modes = [(float(share), float(tau)) for share, tau in np.broadcast(self.amplitude, self.tau) if share]
        drive = self._drive(x)
        y = lag_sequence(drive, modes, steps)
        y += sum(share for share, _ in modes) * (1 - float(self.held)) * drive
        y += x
        return y

    def _drive(self, x: Any) -> Any:
        if isinstance(self.growth, (int, float)) and self.growth == 0:
            return x
        return x * (1 + self.broadcast_parameter("growth", x) * namespace(x).abs(x))
