"""Clocked: base of the transforms that depend on the elapsed time of their stream."""

from __future__ import annotations

from typing import Any

from paxisim.augment.parameter_spec import namespace
from paxisim.augment.transform import Covariates, State, StatefulTransform


class Clocked(StatefulTransform):
    """Base of transforms whose only memory is the time since the first frame.

    The time is kept in float64, because float32 would lose a hundredth of a second after a day.
    """

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return the time since the first frame (s), ``(*batch, 1, 1, 1, 1)``, float64."""
        xp = namespace(x)
        return (xp.zeros_like(x[..., :1, :1, :1, :1], dtype=xp.float64),)

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        xp = namespace(x)
        elapsed = state[0] + xp.astype(dt, xp.float64)
        return self.at(x, xp.astype(elapsed, x.dtype), covariates), (elapsed,)

    def at(self, x: Any, time: Any, covariates: Covariates) -> Any:
        """Transform a checked frame at a time since the first frame (s), ``(*batch, 1, 1, 1, 1)``."""
        raise NotImplementedError

    def later(self, seconds: float) -> Clocked:
        """Return the transform for a stream that begins `seconds` after this one's first frame."""
        raise NotImplementedError
