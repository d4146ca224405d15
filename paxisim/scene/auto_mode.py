"""Auto mode: whether a replay can take the total force from the recorded positions, or must fit the closing.

The opening of a gripper and the size of an object say how deep the pads are pressed, but neither is known to a
hundredth of a millimetre, and a linkage between the driven joint and the fingers gives way under load. Where this
changes the force too much, mode ``"fitted"`` takes the total force of each grasp from the sensor. Mode ``"shape"`` is
never chosen: when a hand closes fast on a rigid object, the force over time hardly depends on the depth.
"""

from __future__ import annotations

from dataclasses import replace

import mujoco
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
_LOADED = 0.5  # s that the fingers are loaded for
_AWAY = 100.0  # m, where objects are meanwhile


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
    layout = rig.pads.layout
    peak = float(np.nanmax(total_normal(recording.measured), initial=0.0)) / len(rig.pads)
    give = _give(rig, recording, peak) if peak > 0 else 0.0
    depth = max(0.5 * ACCURACY, _half_step(recording, drive, rig), give)
    error = scene.gel.stiffness(layout) * layout.taxels * depth
    if not error > COARSE_FRACTION * peak > 0:
        return plain, ""
    why = "by which the fingers give way under load" if depth == give else "to which the depth of the pads is known"
    reason = (
        f"mode fitted was chosen: {1e3 * depth:.2g} mm, {why}, change the force of a pad by {error:.2g} N of "
        f"{peak:.3g} N"
    )
    return replace(scene, mode="fitted"), reason


def _half_step(recording: Recording, drive: Drive, rig: Rig) -> float:
    """Return by how much half a step of the closing stream presses a pad deeper (m); 0 if that is not known."""
    if not drive.joint or drive.unit not in units.LENGTH:
        return 0.0
    step = streams.encoder_step(recording, drive) * abs(drive.gain)
    return 0.5 * step * (0.5 if drive.curve else 1.0)  # a curve starts from the distance between two pads


def _give(rig: Rig, recording: Recording, force: float) -> float:
    """Return by how much (m) a force (N) on each pad pushes it back, with the hand as it is at the highest force."""
    assert recording.measured is not None
    at = int(np.nanargmax(total_normal(recording.measured)))
    model, data = rig.model, mujoco.MjData(rig.model)
    bodies = np.asarray(rig.pads.bodies)
    positions, velocities, values = [], [], []
    for drive in rig.prescribed:
        raw = streams.raw_values(recording, drive)
        if drive.joint and np.isfinite(raw[at]).all():
            positions.append(int(model.jnt_qposadr[rig.joint(drive)]))
            velocities.append(int(model.jnt_dofadr[rig.joint(drive)]))
            values.append(float(drive.to_scene(raw[at : at + 1])[0]))
    places = []
    for push in (0.0, force):
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.ctrl[:] = rig.qpos, rig.ctrl
        for address in rig.free:
            data.qpos[address : address + 3] += _AWAY
        for _ in range(round(_LOADED / model.opt.timestep)):
            data.qpos[positions], data.qvel[velocities] = values, 0.0
            data.xfrc_applied[bodies, :3] = push * data.xmat[bodies].reshape(-1, 3, 3)[:, :, 2]
            mujoco.mj_step(model, data)
        into = data.xmat[bodies].reshape(-1, 3, 3)[:, :, 2]
        places.append(np.sum(data.xpos[bodies] * into, axis=1))
    give = float(np.mean(places[1] - places[0]))
    return give if np.isfinite(give) else 0.0
