"""FailingTaxels: taxels, or single axes of taxels, that stop responding at some time."""

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
    """`DeadTaxels` from some time on: ``y(t) = x(t)`` before `since`, then 0 or `value`, whatever the force.

    Examples are a bond that breaks, a wire that comes loose or a converter that hangs during a recording. Time counts
    from the first frame in steps of `dt`, and restarts at 0 after `reset`, where all taxels respond again unless their
    `since` is at most 0. Pass a recording in one piece, because each part would start at 0. This is a separate class
    because it needs a clock, which `DeadTaxels` in a frame-by-frame call or in `paxisim.augment.torch.Chain` lacks.

    Example:
        ``FailingTaxels(stuck=[[[1.0]]], value=[[[[0.5]]]], since=2.0)``:

        | t (s) | x (N) | y (N) |
        |---|---|---|
        | 0 | 0 | 0 |
        | 1 | 3 | 3 |
        | 2 | 4 | 0.5 |
        | 3 | 0 | 0.5 |

    The ranges are ours: those of `DeadTaxels`, and a failure within the first minute.

    Attributes:
        dead: ``(..., pads, rows, cols)``, 1 for a taxel that dies, else 0.
        stuck: ``(..., pads, rows, cols)``, 1 for a taxel that gets stuck, else 0.
        value: ``(..., pads, 3, rows, cols)`` reading of stuck taxels (N); any of the four dimensions may be 1.
        since: ``(..., pads, 3, rows, cols)`` time at which each axis fails (s after the first frame); any of the four
            dimensions may be 1. An axis with a value of 0 or less has failed from the start; an axis with an infinite
            value never fails.
    """

    stage: ClassVar[str] = "electronics"

    since: Any = parameter(((((0.0,),),),), "pkrc", unit="s", infinite=True, typical=(0.0, 60.0))

    def at(self, x: Any, time: Any, covariates: Covariates) -> Any:
        """See `Clocked.at`."""
        return namespace(x).where(time >= self.broadcast_parameter("since", x), self.apply(x, covariates), x)

    def later(self, seconds: float) -> FailingTaxels:
        """See `Clocked.later`."""
        return replace(self, since=np.asarray(self.since) - seconds)
