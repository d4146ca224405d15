"""DeadTaxels: single taxels that read nothing, or always the same."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, Transform


@dataclass(frozen=True, eq=False)
class DeadTaxels(Transform):
    """A dead taxel reads 0 on all axes, a stuck one its `value`, whatever the force; the others read as they are.

    A torn gel, a lost magnet, a broken bond. A taxel that is both is dead. Ranges are ours: 1 to 4 dead taxels a pad,
    and stuck readings up to 5 N.

    Attributes:
        dead: ``(..., pads, rows, cols)``, 1 where a taxel is dead, else 0.
        stuck: ``(..., pads, rows, cols)``, 1 where a taxel is stuck, else 0.
        value: ``(..., pads, 3, rows, cols)`` what stuck taxels read (N); any of the four may be 1 long.
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
