"""A MuJoCo scene, simulated in real time, as the signal of an emulated sensor."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError

LONGEST_CATCH_UP = 0.05
"""Maximum simulated time per reading (s); a scene slower than real time falls behind instead of catching up."""


class SceneSignal:
    """Simulate a scene in real time and return the forces on its pads.

    The scene starts at its first keyframe, if it has one, and keeps that keyframe's controls.
    """

    def __init__(self, scene: Path, profile) -> None:
        """Load the scene.

        Args:
            scene: MJCF file with pads, as `paxisim attach` writes it.
            profile: The `paxisim.Profile` of the emulated sensor; the pads of the scene have its wire
                layout or its pooled layout.

        Raises:
            InvalidValueError: The file does not exist, MuJoCo cannot read it, its pads do not match the profile, or
                the profile is not in newtons.
        """
        import mujoco

        from paxisim.hw.emulation.signals import spread
        from paxisim.models.load import compile_spec, load_spec
        from paxisim.models.pads import find_pads
        from paxisim.models.readout import TactileReadout

        if profile.unit != "N":
            raise InvalidValueError(
                f"a scene's pads give newtons, but profile {profile.name!r} is in {profile.unit}: choose a recording "
                "in that unit, 'demo' or a function"
            )
        self._profile, self._spread, self._step = profile, spread, mujoco.mj_step
        self._model = compile_spec(load_spec(scene), str(scene))
        self._data = mujoco.MjData(self._model)
        if self._model.nkey:
            mujoco.mj_resetDataKeyframe(self._model, self._data, 0)
        self._pads = find_pads(self._model)
        self._readout = TactileReadout(self._model, self._pads)
        self._start = self._data.time
        self._behind = 0.0
        mujoco.mj_forward(self._model, self._data)
        self(0.0)

    def set_surface(self, heights: NDArray[np.floating]) -> None:
        """Give the pads of the scene an uneven surface.

        Args:
            heights: ``(pads, rows, cols)`` of the profile's wire layout (m); their means do not matter.
        """
        from paxisim.models.pads import set_surface
        from paxisim.models.surface import heights_from_map

        pads = zip(self._pads.layouts, heights, self._pads.thickness, strict=True)
        set_surface(self._model, self._pads, np.array([heights_from_map(*pad) for pad in pads]))

    @property
    def seconds(self) -> float:
        """Simulated time since the start (s)."""
        return self._data.time - self._start

    def __call__(self, now: float) -> NDArray[np.floating]:
        """Return the forces (N) `now` seconds after the start, ``(pads, 3, rows, cols)`` in the wire layout."""
        until = now - self._behind
        missing = until - self.seconds
        if missing > LONGEST_CATCH_UP:
            self._behind += missing - LONGEST_CATCH_UP
            until -= missing - LONGEST_CATCH_UP
        while self.seconds < until:
            self._step(self._model, self._data)
        return self._spread(self._readout.read(self._data), self._profile)
