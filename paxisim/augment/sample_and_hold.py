"""SampleAndHold: the device samples at its own rate and repeats its reading in between."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, State, StatefulTransform, keep


@dataclass(frozen=True, eq=False)
class SampleAndHold(StatefulTransform):
    """The reading at the device's last tick up to t: ``y(t) = x(t_n)``, with ``t_n = (n + phase) / rate``.

    A device that samples more slowly than it is read returns the same frame several times; one that samples faster is
    still up to one period late. x is interpolated linearly between frames, so ticks may fall between frames. All taxels
    are sampled at once. A tick within 1e-4 periods of a frame counts as simultaneous with it, and later ticks count
    from there. Otherwise rounding would decide whether a device at the frame rate reads this frame or the previous one.

    Time counts from the first frame, or from the first after `reset`; that frame is held until the first tick.

    Example:
        ``SampleAndHold(rate=0.4)``, a tick every 2.5 s:

        | t (s) | x (N) | y (N) | from the tick at |
        |---|---|---|---|
        | 0 | 0 | 0 | 0 |
        | 1 | 1 | 0 | 0 |
        | 2 | 4 | 0 | 0 |
        | 3 | 9 | 6.5 | 2.5 s, halfway from 4 to 9 N |

    Source: PaXini's sensors give about 91 or 176 frames per second, which are often recorded at other rates.

    Attributes:
        rate: ``(...)`` sampling rate of the device (Hz); with 0, y equals x.
        phase: ``(...)`` time of the first tick, in periods after the first frame, in [0, 1].
    """

    stage: ClassVar[str] = "electronics"

    rate: Any = parameter(0.0, unit="Hz", low=0.0, typical=(30.0, 200.0))
    phase: Any = parameter(0.0, low=0.0, high=1.0, typical=(0.0, 1.0))

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return the previous frame, the held frame and the periods since the last tick, ``(*batch, 1, 1, 1, 1)``."""
        since = namespace(x).zeros_like(x[..., :1, :1, :1, :1]) + 1 - self.broadcast_parameter("phase", x)
        return (keep(x), keep(x), since)

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        xp = namespace(x)
        before, held, since = state
        rate = self.broadcast_parameter("rate", x)
        periods = dt * rate
        since = since + periods
        nearest = xp.round(since)
        ticks = xp.where(xp.abs(since - nearest) < 1e-4, nearest, xp.floor(since))
        ago = xp.maximum(since - ticks, xp.zeros_like(since))
        one = xp.ones_like(periods)
        back = xp.minimum(ago / xp.where(periods > 0, periods, one), one)
        back = xp.where(periods > 0, back, xp.zeros_like(back))
        held = xp.where(ticks > 0, x + back * (before - x), held)
        return xp.where(rate > 0, held, x), (keep(x), held, ago)
