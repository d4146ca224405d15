"""Clocked: base of the transforms that depend on how long their stream has run."""

from __future__ import annotations

from typing import Any

from paxisim.augment.parameter_spec import namespace
from paxisim.augment.transform import Covariates, State, StatefulTransform


class Clocked(StatefulTransform):
    """Remembers nothing but the time since the first frame.

    It is kept in float64, as float32 would lose a hundredth of a second after a day.
    """

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """The time since the first frame (s), ``(*batch, 1, 1, 1, 1)``, float64."""
        xp = namespace(x)
        return (xp.zeros_like(x[..., :1, :1, :1, :1], dtype=xp.float64),)

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        xp = namespace(x)
        elapsed = state[0] + xp.astype(dt, xp.float64)
        return self.at(x, xp.astype(elapsed, x.dtype), covariates), (elapsed,)

    def at(self, x: Any, time: Any, covariates: Covariates) -> Any:
        """The transform of a checked frame at a time since the first one (s), ``(*batch, 1, 1, 1, 1)``."""
        raise NotImplementedError

    def later(self, seconds: float) -> Clocked:
        """The transform of a stream that begins so many seconds after this one's first frame."""
        raise NotImplementedError
