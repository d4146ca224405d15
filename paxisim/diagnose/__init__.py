"""Diagnosis: find out what a simulation gets wrong and why, with ``paxisim.diagnose(recording)``.

The input is a recording with measured and simulated tensors. The output is a `Diagnosis`: a verdict, the causes with
their fitted parameters and held-out gains, and an extended sensor model. `register_cause` adds a user-defined cause.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from paxisim._lazy import lazy

if TYPE_CHECKING:
    from paxisim.diagnose.cause import Cause as Cause
    from paxisim.diagnose.cause import Free as Free
    from paxisim.diagnose.diagnosis import Diagnosis as Diagnosis
    from paxisim.diagnose.diagnosis import FittedParameter as FittedParameter
    from paxisim.diagnose.diagnosis import FoundCause as FoundCause
    from paxisim.diagnose.diagnosis import HeldOut as HeldOut
    from paxisim.diagnose.diagnosis import Interval as Interval
    from paxisim.diagnose.diagnosis import LeftOver as LeftOver
    from paxisim.diagnose.diagnosis import Place as Place
    from paxisim.diagnose.diagnosis import Symptoms as Symptoms
    from paxisim.diagnose.run import diagnose as diagnose
    from paxisim.diagnose.vocabulary import known_causes as known_causes
    from paxisim.diagnose.vocabulary import register_cause as register_cause
    from paxisim.recording import Recording
    from paxisim.scene.scene import Scene

_HOMES = {
    "paxisim.diagnose.cause": ("Cause", "Free"),
    "paxisim.diagnose.vocabulary": ("known_causes", "register_cause"),
    "paxisim.diagnose.diagnosis": (
        "Diagnosis",
        "FittedParameter",
        "FoundCause",
        "HeldOut",
        "Interval",
        "LeftOver",
        "Place",
        "Symptoms",
    ),
    "paxisim.diagnose.run": ("diagnose",),
}
__getattr__, __dir__, __all__ = lazy(__name__, _HOMES)


class _Callable(ModuleType):
    """Makes the package callable, because importing a submodule binds the package to ``paxisim.diagnose``."""

    def __call__(
        self,
        recording: Recording,
        causes: Sequence[str] | None = None,
        *,
        scene: Scene | None = None,
        seed: int = 0,
        jobs: int = 1,
        progress: Callable[[str, float], None] | None = None,
        replays: Path | None = None,
    ) -> Diagnosis:
        """See `paxisim.diagnose.run.diagnose`."""
        from paxisim.diagnose.run import diagnose

        return diagnose(recording, causes, scene=scene, seed=seed, jobs=jobs, progress=progress, replays=replays)


sys.modules[__name__].__class__ = _Callable
