"""FailingTaxels: taxels, or single axes of them, that respond until some moment and then no more."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from paxisim.augment.clocked import Clocked
from paxisim.augment.dead_taxels import DeadTaxels
from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates


@dataclass(frozen=True, eq=False)
class FailingTaxels(Clocked, DeadTaxels):
    """`DeadTaxels` from some moment on: ``y(t) = x(t)`` up to `since`, afterwards 0 or `value`, whatever the force.

    A bond that breaks, a wire that comes loose, a converter that hangs in the middle of a recording. Time counts from
    the first frame by `dt`, and again from 0 after `reset`, where all respond again unless their `since` is at most 0.
    Give a recording in one piece: its parts would each begin at 0. It is a class of its own as it needs a clock, which
    `DeadTaxels` in a frame-by-frame call or in `paxisim.augment.torch.Chain` does not have.

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

    def at(self, x: Any, time: Any, covariates: Covariates) -> Any:
        """See `Clocked.at`."""
        return namespace(x).where(time >= self.broadcast_parameter("since", x), self.apply(x, covariates), x)

    def later(self, seconds: float) -> FailingTaxels:
        """See `Clocked.later`."""
        return replace(self, since=np.asarray(self.since) - seconds)
