"""FailingTaxels: taxels, or single axes of them, that respond until some moment and then no more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.dead_taxels import DeadTaxels
from paxisim.augment.parameter import namespace, parameter
from paxisim.augment.transform import Covariates, Memory, State


@dataclass(frozen=True, eq=False)
class FailingTaxels(Memory, DeadTaxels):
    """`DeadTaxels` from some moment on: ``y(t) = x(t)`` up to `since`, afterwards 0 or `value`, whatever the force.

    A bond that breaks, a wire that comes loose, a converter that hangs in the middle of a recording. Time counts from
    the first frame by `dt`, and again from 0 after `reset`, where all respond again unless their `since` is at most 0;
    it is kept in float64, as float32 would lose a hundredth of a second after a day. Give a recording in one piece: its
    parts would each begin at 0. It is a class of its own as it needs a clock, which `DeadTaxels` in a frame-by-frame
    call or in `paxisim.augment.torch.Chain` does not have.

    Example:
        ``FailingTaxels(stuck=[[[1.0]]], value=[[[[0.5]]]], since=2.0)``:

        | t (s) | x (N) | y (N) |
        |---|---|---|
        | 0 | 0 | 0 |
        | 1 | 3 | 3 |
        | 2 | 4 | 0.5 |
        | 3 | 0 | 0.5 |

    Ranges are ours, as those of `DeadTaxels`; a failure within the first minute.

    Attributes:
        dead: ``(..., pads, rows, cols)``, 1 where a taxel will be dead, else 0.
        stuck: ``(..., pads, rows, cols)``, 1 where a taxel will be stuck, else 0.
        value: ``(..., pads, 3, rows, cols)`` what stuck taxels read (N); any of the four may be 1 long.
        since: ``(..., pads, 3, rows, cols)`` when each axis fails (s after the first frame); any of the four may be 1
            long. At most 0: it has failed from the beginning; infinite: an axis that responds throughout.
    """

    stage: ClassVar[str] = "electronics"

    since: Any = parameter(((((0.0,),),),), "pkrc", unit="s", infinite=True, typical=(0.0, 60.0))

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """The time since the first frame (s), ``(*batch, 1, 1, 1, 1)``, float64."""
        xp = namespace(x)
        return (xp.zeros_like(x[..., :1, :1, :1, :1], dtype=xp.float64),)

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `Memory.advance`."""
        xp = namespace(x)
        elapsed = state[0] + xp.astype(dt, xp.float64)
        failed = xp.astype(elapsed, x.dtype) >= self.fit("since", x)
        return xp.where(failed, self.apply(x, covariates), x), (elapsed,)
