"""Plan: what a diagnosis looks for, and on how many processors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from paxisim.diagnose.cause import Cause
from paxisim.diagnose.worth import Thresholds


@dataclass(frozen=True)
class Plan:
    """What is looked for.

    Attributes:
        searched: Causes that are fitted.
        limits: What each must bring.
        slow: Those of "offset" and "drift" that are looked for.
        tell: Told in words what is being done.
        jobs: Processors to use.
    """

    searched: Sequence[Cause]
    limits: Thresholds
    slow: tuple[str, ...] = ()
    tell: Callable[[str], None] = lambda text: None
    jobs: int = 1
