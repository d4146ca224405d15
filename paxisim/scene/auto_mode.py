"""Auto mode: whether a replay can take the total force from the recorded positions, or must fit the closing.

The opening of a gripper and the size of an object say how deep the pads are pressed, but neither is known to a
hundredth of a millimetre. Where this changes the force too much, mode ``"fitted"`` takes the total force of each grasp
from the sensor. Mode ``"shape"`` is never chosen: when a hand closes fast on a rigid object, the force over time hardly
depends on the depth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paxisim.recording import Recording
from paxisim.scene import streams, units
from paxisim.scene.closing import total_normal
from paxisim.scene.drive import Drive
from paxisim.scene.rig import Rig, build_rig
from paxisim.scene.scene import Scene

ACCURACY = 5e-5
"""How well the opening of a gripper and the size of an object are known together (m)."""
COARSE_FRACTION = 0.1
"""Fraction of the peak force above which an error of the opening is too much."""


def with_mode(scene: Scene, recording: Recording) -> tuple[Scene, str]:
    """Return the scene with a mode instead of ``"auto"``, and the reason; the scene itself if it has a mode.

    Raises:
        InvalidValueError: The scene cannot be compiled.
        UnknownNameError: A stream, joint, body or actuator does not exist.
    """
    if scene.mode != "auto":
        return scene, ""
    plain = replace(scene, mode="kinematic")
    if not scene.closing or recording.measured is None or recording.unit != "N":
        return plain, ""
    rig = build_rig(plain)
    if not rig.free:
        return plain, ""
    drive = next(drive for drive in scene.drives if drive.stream == scene.closing)
    depth = max(0.5 * ACCURACY, _half_step(recording, drive, rig))
    layout = rig.pads.layout
    error = scene.gel.stiffness(layout) * layout.taxels * depth
    peak = float(np.nanmax(total_normal(recording.measured), initial=0.0)) / len(rig.pads)
    if not error > COARSE_FRACTION * peak > 0:
        return plain, ""
    reason = (
        f"mode fitted was chosen: {1e3 * depth:.2g} mm, to which the depth of the pads is known at best, change the "
        f"force of a pad by {error:.2g} N of {peak:.3g} N"
    )
    return replace(scene, mode="fitted"), reason


def _half_step(recording: Recording, drive: Drive, rig: Rig) -> float:
    """Return by how much half a step of the closing stream presses a pad deeper (m); 0 if that is not known."""
    if not drive.joint or drive.unit not in units.LENGTH:
        return 0.0
    step = streams.encoder_step(recording, drive) * abs(drive.gain)
    return 0.5 * step * (0.5 if drive.curve else 1.0)  # a curve starts from the distance between two pads
