"""Creep: under a constant load the gel gives way a little more with time."""

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

        y = x + sum_m amplitude_m q_m        tau_m dq_m/dt = x - q_m

    Silicone is viscoelastic: a held load sinks in further, the magnets with it, and after unloading the reading comes
    back late. At once the gain is 1, in the end ``1 + sum amplitude``; a sine of angular frequency w gains ``1 + sum
    amplitude / (1 + i w tau)``. A negative amplitude lets the reading sink under a held load, as stress relaxes under a
    held indentation. Linear, each element by itself. With amplitudes of 0 y is x.

    The input is taken to run straight from frame to frame, for which a step is exact at any `dt`. The first frame, and
    that after `reset`, is taken to have been there forever: its creep is over, ``y = (1 + sum amplitude) x``.

    Example:
        ``Creep(amplitude=(0.2,), tau=(1.0,))``, load that rises to 1 N within the first second:

        | t (s) | x (N) | q (N) | y (N) |
        |---|---|---|---|
        | 0 | 0 | 0 | 0 |
        | 1 | 1 | 0.368 | 1.074 |
        | 2 | 1 | 0.767 | 1.153 |
        | 3 | 1 | 0.914 | 1.183 |

    Source: linear viscoelasticity, e.g. J. D. Ferry, Viscoelastic Properties of Polymers, 3rd ed. (1980), ch. 3. No
    figures for this sensor are known; the ranges are ours: 2 to 25 % creep, over 0.2 to 60 s.

    Attributes:
        amplitude: ``(..., M)`` creep of each mode as a share of the load.
        tau: ``(..., M)`` time constants (s); 0: the mode follows at once. M may be 1 in one of the two.

    Raises:
        InvalidValueError: Also if the two have different numbers of modes.
    """

    stage: ClassVar[str] = "gel"

    amplitude: Any = parameter((0.0,), "m", low=-1.0, typical=(0.02, 0.25))
    tau: Any = parameter((1.0,), "m", unit="s", low=0.0, typical=(0.2, 60.0))

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        check_modes(self, "amplitude", "tau")

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """The frame before, and by how much each mode was ahead of it, ``(*batch, M, pads, 3, rows, cols)``."""
        return (keep(x), namespace(x).zeros_like(over_modes(self, x, "amplitude", "tau")))

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        before, ahead = state
        frame = each_mode(x)
        ahead = lag(each_mode(x - before), ahead, self.broadcast_parameter("tau", frame), each_mode(dt))
        y = x + namespace(x).sum(self.broadcast_parameter("amplitude", frame) * (frame + ahead), axis=-5)
        return y, (keep(x), ahead)

    def sweep(self, x: NDArray[np.floating], steps: NDArray[np.float64]) -> NDArray[np.floating] | None:
        """See `Transform.sweep`."""
        if max(np.ndim(self.amplitude), np.ndim(self.tau)) > 1:
            return None
        y = x.copy()
        for amplitude, tau in np.broadcast(self.amplitude, self.tau):
            if amplitude:
                y += float(amplitude) * (x + lag_sequence(x, float(tau), steps))
        return y
