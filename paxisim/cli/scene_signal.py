"""A live MuJoCo scene as a signal for the emulator: its pads are what the emulated sensor feels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError

LONGEST_CATCH_UP = 0.05
"""Seconds of physics done at most for one reading: a scene that is slower than real time falls behind instead."""


class SceneSignal:
    """Steps a scene in real time and gives the forces on its pads.

    The scene begins at its first keyframe, if it has one, and runs with that keyframe's controls.
    """

    def __init__(self, scene: Path, profile) -> None:
        """Load the scene.

        Args:
            scene: An MJCF file with pads, as `paxisim attach` writes it.
            profile: The `paxisim.hw.profile.Profile` whose pads feel it, of its wire layout or of its pooled one.

        Raises:
            InvalidValueError: There is no such file, MuJoCo cannot read it, its pads are not the profile's, or
                the profile is not in newtons.
        """
        import mujoco

        from paxisim.hw.signals import spread
        from paxisim.models.load import compile_spec, load_spec
        from paxisim.models.pads import find_pads
        from paxisim.models.readout import TactileReadout

        if profile.unit != "N":
            raise InvalidValueError(
                f"a scene's pads give newtons, but profile {profile.name!r} feels {profile.unit}: choose a recording "
                "of that unit, 'demo' or a function"
            )
        self._profile, self._spread, self._step = profile, spread, mujoco.mj_step
        self._model = compile_spec(load_spec(scene), str(scene))
        self._data = mujoco.MjData(self._model)
        if self._model.nkey:
            mujoco.mj_resetDataKeyframe(self._model, self._data, 0)
        self._readout = TactileReadout(self._model, find_pads(self._model))
        self._start = self._data.time
        self._behind = 0.0
        mujoco.mj_forward(self._model, self._data)
        self(0.0)

    @property
    def seconds(self) -> float:
        """Seconds of physics since the start."""
        return self._data.time - self._start

    def __call__(self, now: float) -> NDArray[np.floating]:
        """``(pads, 3, rows, cols)`` newtons of the wire layout, `now` seconds after the start."""
        until = now - self._behind
        missing = until - self.seconds
        if missing > LONGEST_CATCH_UP:
            self._behind += missing - LONGEST_CATCH_UP
            until -= missing - LONGEST_CATCH_UP
        while self.seconds < until:
            self._step(self._model, self._data)
        return self._spread(self._readout.read(self._data), self._profile)
