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

import lazy_loader

if TYPE_CHECKING:
    from paxisim.augment.transform import Transform
    from paxisim.diagnose.diagnosis import Diagnosis
    from paxisim.recording import Recording
    from paxisim.scene.scene import Scene

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


class _Callable(ModuleType):
    """Makes the package callable, because importing a submodule binds the package to ``paxisim.diagnose``."""

    def __call__(
        self,
        recording: Recording,
        causes: Sequence[str] | None = None,
        *,
        scene: Scene | None = None,
        sensor: Transform | None = None,
        seed: int = 0,
        jobs: int = 1,
        progress: Callable[[str, float], None] | None = None,
        replays: Path | None = None,
    ) -> Diagnosis:
        """See `paxisim.diagnose.pipeline.diagnose`."""
        from paxisim.diagnose.pipeline import diagnose

        return diagnose(
            recording, causes, scene=scene, sensor=sensor, seed=seed, jobs=jobs, progress=progress, replays=replays
        )


sys.modules[__name__].__class__ = _Callable
