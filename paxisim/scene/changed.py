"""Changing the parameters of a scene: new values are written into its MJCF, its gel and its drives."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from paxisim.errors import UnsupportedError
from paxisim.models.links import bodies_above
from paxisim.models.mjcf import format_mjcf
from paxisim.models.pads import Pads, find_pads, half_thickness
from paxisim.scene.arms import displace
from paxisim.scene.drive import Drive
from paxisim.scene.parameters import SceneParameter, height_map
from paxisim.scene.rig import spec_of
from paxisim.scene.scene import Scene

Values = Mapping[SceneParameter, float]

_QUATERNION = mujoco.mjtOrientation.mjORIENTATION_QUAT


def changed(scene: Scene, values: Values) -> Scene:
    """Return the scene with the given parameter values, which become the nominal values of the new scene.

    Args:
        scene: The scene.
        values: New values by parameter, as listed by `paxisim.Scene.parameters`.

    Raises:
        UnsupportedError: The size of an object changes, but other bodies use its mesh too.
    """
    moved = {item: value for item, value in values.items() if value != item.nominal}
    gel, drives, in_model = scene.gel, scene.drives, {}
    for item, value in moved.items():
        if item.group == "friction":
            gel = replace(gel, friction=value)
        elif item.group == "gel_stiffness":
            gel = replace(gel, modulus=gel.modulus * value)
        elif item.group == "joint_offset":
            drives = tuple(_shifted(d, value) if d.joint and d.source == item.target else d for d in drives)
        elif item.group == "grip_force" and scene.mode == "force":
            drives = tuple(_scaled(d, value) if d.actuator else d for d in drives)
        else:
            in_model[item] = value
    if in_model:
        scene = replace(scene, mjcf=_model(scene, in_model), sensor="", pool=1, mounts=())
    # bounds refer to the previous nominal values
    return replace(scene, gel=gel, drives=drives, bounds={}) if moved else scene


def _shifted(drive: Drive, value: float) -> Drive:
    """Return the drive with its joint offset by `value` in the direction of an increasing stream."""
    return replace(drive, offset=float(np.asarray(drive.offset)) + np.copysign(1.0, drive.scale) * value)


def _scaled(drive: Drive, value: float) -> Drive:
    return replace(drive, scale=drive.scale * value, offset=float(np.asarray(drive.offset)) * value)


def _model(scene: Scene, values: Values) -> str:
    """Return the MJCF with the new values."""
    spec = spec_of(scene)
    model = spec.copy().compile()  # compiling a copy leaves the frames of the spec unchanged
    pads = find_pads(model, names=scene.pads or None)
    sizes = {item: value for item, value in values.items() if item.group == "object_size"}
    for item, value in sizes.items():  # before the poses, which must not be scaled
        _scale(spec, model, item.target, value)
    for pad in pads.names:
        offset, tilt, surface = (of_target(values, g, pad) for g in ("mount_offset", "mount_tilt", "surface"))
        if offset or tilt:
            _mount(spec, model, pad, offset, tilt)
        if surface:
            _bump(spec, model, pads, pad, surface)
    for body in {item.target for item in values if item.group == "object_pose"}:
        own = of_target(values, "object_pose", body)
        _place(spec, model, body, [own.get(k, 0.0) for k in range(6)])
    for group in ("base_pose", "hand_pose"):
        for body in {item.target for item in values if item.group == group}:
            own, carried = of_target(values, group, body), model.body(body).id
            of_body = [int(pad) for pad in pads.bodies if carried in bodies_above(model, int(pad))]
            displace(spec, model, body, [own.get(k, 0.0) for k in range(6)], of_body)
    for value in (v for item, v in values.items() if item.group == "impratio"):
        spec.option.impratio = value
    for value in (v for item, v in values.items() if item.group == "grip_force"):
        for actuator in spec.actuators:
            actuator.gainprm, actuator.biasprm = actuator.gainprm * value, actuator.biasprm * value
            actuator.forcerange = actuator.forcerange * value
    return format_mjcf(spec, "the scene")


def of_target(values: Values, group: str, target: str) -> dict[int, float]:
    """Return the values of one cause for a pad or an object, by their index."""
    return {item.index: value for item, value in values.items() if item.group == group and item.target == target}


def remounted(
    position: np.ndarray, turn: Rotation, offset: Mapping[int, float], tilt: Mapping[int, float]
) -> tuple[np.ndarray, Rotation]:
    """Return the pose of a pad's body, moved by an offset along and a rotation about the pad's own x and y."""
    along, about = ([own.get(0, 0.0), own.get(1, 0.0), 0.0] for own in (offset, tilt))
    return position + turn.apply(along), turn * Rotation.from_rotvec(about)


def _mount(
    spec: mujoco.MjSpec, model: mujoco.MjModel, pad: str, offset: Mapping[int, float], tilt: Mapping[int, float]
) -> None:
    body = spec.body(pad)
    turn = rotation_of(model.body_quat[model.body(pad).id])
    turn = _of_frames(body).inv() * turn  # the spec's pose is relative to its frames
    body.pos, turned = remounted(body.pos, turn, offset, tilt)
    if tilt:
        body.alt.type = _QUATERNION
        body.quat = quaternion_of(turned)


def _bump(spec: mujoco.MjSpec, model: mujoco.MjModel, pads: Pads, pad: str, heights: Mapping[int, float]) -> None:
    """Make taxels thicker or thinner while their backs stay in place."""
    more = height_map(pads.layout, heights)
    geoms = pads.geoms[pads.names.index(pad)]
    half = half_thickness(model, geoms)
    half_more = np.maximum(more.ravel() / 2, -0.9 * half)  # keeps taxels from vanishing
    for number, now, added in zip(geoms, half, half_more, strict=True):
        geom = spec.geom(model.geom(int(number)).name)
        inward = rotation_of(model.geom_quat[number]).as_matrix()[:, 2]
        geom.pos = model.geom_pos[number] - inward * added
        place = 0 if geom.type == mujoco.mjtGeom.mjGEOM_SPHERE else 2
        geom.size = np.where(np.arange(3) == place, now + added, model.geom_size[number])


def _scale(spec: mujoco.MjSpec, model: mujoco.MjModel, name: str, factor: float) -> None:
    """Scale an object about the origin of its body, without changing its mass."""
    own = [spec.body(name), *spec.body(name).find_all("body")]
    geoms = [geom for body in own for geom in body.geoms]
    meshes = Counter(geom.meshname for geom in geoms if geom.meshname)
    uses = Counter(geom.meshname for geom in spec.geoms)
    shared = sorted(mesh for mesh, count in meshes.items() if uses[mesh] > count)
    if shared:
        raise UnsupportedError(f"the size of {name} cannot change, because other bodies use its mesh {shared[0]!r} too")
    for mesh in meshes:
        spec.mesh(mesh).scale = spec.mesh(mesh).scale * factor
    for geom in geoms:
        geom.pos, geom.size = geom.pos * factor, geom.size * factor
        geom.fromto = geom.fromto * factor
    for part in [*own[1:], *(frame for body in own for frame in body.frames)]:
        part.pos = part.pos * factor
    for body in own:
        _keep_inertia(body, model)


def _keep_inertia(body: mujoco.MjsBody, model: mujoco.MjModel) -> None:
    """Fix the inertia of a body at its current value, independent of its geoms.

    The object's motion is prescribed by whatever holds it, so its mass hardly matters. But the inverse weight slightly
    affects the stiffness of MuJoCo's contacts, and MuJoCo computes it differently for a body on slides whose centre of
    mass is not in the middle.
    """
    number = model.body(body.name).id
    body.explicitinertial = True
    body.mass, body.ipos = model.body_mass[number], model.body_ipos[number]
    body.inertia, body.iquat = model.body_inertia[number], model.body_iquat[number]


def _place(spec: mujoco.MjSpec, model: mujoco.MjModel, name: str, pose: list[float]) -> None:
    """Translate and rotate all parts of an object in the frame of its body."""
    body = spec.body(name)
    _keep_inertia(body, model)
    turn = Rotation.from_rotvec(pose[3:])
    frame = body.add_frame(pos=pose[:3], quat=quaternion_of(turn))
    for part in [*body.frames, *body.geoms, *body.bodies, *body.sites]:
        if part.frame is None and part != frame:
            part.set_frame(frame)


def _of_frames(body: mujoco.MjsBody) -> Rotation:
    """Return the total rotation of the frames in which a body is defined."""
    turn, frame = Rotation.identity(), body.frame
    while frame is not None:
        turn, frame = rotation_of(frame.quat) * turn, frame.frame
    return turn


def rotation_of(quat: np.ndarray) -> Rotation:
    """Return the rotation of a quaternion in MuJoCo's order, w first."""
    return Rotation.from_quat(np.roll(quat, -1))


def quaternion_of(turn: Rotation) -> np.ndarray:
    """Return the quaternion ``(4,)`` of a rotation in MuJoCo's order, w first."""
    return np.roll(turn.as_quat(), 1)
