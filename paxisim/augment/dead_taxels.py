"""DeadTaxels: single taxels that read zero or a constant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class DeadTaxels(Transform):
    """A dead taxel reads 0 on all axes and a stuck one reads `value`, whatever the force; others are unchanged.

    Causes are a torn gel, a lost magnet or a broken bond. A taxel that is both dead and stuck is dead. The ranges are
    ours: 1 to 4 dead taxels per pad, and stuck readings up to 5 N.

    Attributes:
        dead: ``(..., pads, rows, cols)``, 1 for a dead taxel, else 0.
        stuck: ``(..., pads, rows, cols)``, 1 for a stuck taxel, else 0.
        value: ``(..., pads, 3, rows, cols)`` reading of stuck taxels (N); any of the four dimensions may be 1.
    """

    stage: ClassVar[str] = "electronics"

    dead: Any = parameter((((0.0,),),), "prc", low=0.0, high=1.0, whole=True)
    stuck: Any = parameter((((0.0,),),), "prc", low=0.0, high=1.0, whole=True)
    value: Any = parameter(((((0.0,),),),), "pkrc", unit="N", typical=(-5.0, 5.0))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        read = xp.where(self.broadcast_parameter("stuck", x) > 0.5, self.broadcast_parameter("value", x), x)
        return xp.where(self.broadcast_parameter("dead", x) > 0.5, xp.zeros_like(read), read)
