"""Rig: the compiled model of a scene, and where in its state each drive acts.

A joint prescribed by a stream must move exactly as the stream says, whatever it touches. MuJoCo's contacts are soft:
the contact force depends on depth, speed and acceleration, and the acceleration depends on the mass behind the contact.
If only ``qpos`` were written, the model's light finger would give way within the same step, and ``mj_forward`` would
compute only a fraction of the force. Here such a joint gets an armature that no contact can move, and its position,
speed and acceleration are written before each step. The forces are then those of a finger that moves exactly this way.
MuJoCo gives a mocap body no velocity, so its contacts would have neither damping nor friction; it is replaced by a free
body that is moved in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.models.attach import attach
from paxisim.models.load import compile_spec, load_spec, one_line
from paxisim.models.mjcf import format_mjcf
from paxisim.models.pad import Pad
from paxisim.models.pads import Pads, find_pads
from paxisim.scene.drive import Drive
from paxisim.scene.scene import Scene

ARMATURE = 1e6
"""Armature (kg, kg m2) of a prescribed joint; 20 N change its acceleration by 2e-5 m/s2 and a contact's depth by
3 nm."""
TOLERANCE = 1e-12
"""Largest tolerance of the solver beside prescribed joints."""
_SCALAR_JOINTS = (int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE))
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)


@dataclass(frozen=True, eq=False)
class Rig:
    """A compiled scene.

    Attributes:
        model: The model, with the gel on its taxels.
        mjcf: MJCF text of the model, including the pads but without the added armatures.
        pads: Pads of the model.
        qpos: ``(nq,)`` positions at the start of an episode, before streams and object starts are applied.
        ctrl: ``(nu,)`` controls at the start of an episode.
        prescribed: Drives whose joint or body moves exactly as the stream says.
        followed: Joint drives that serve as set-points of the model's own position actuators.
        servos: ``(S,)`` ids of the position actuators that follow these set-points.
        commands: Drives that set actuator controls.
        unused: Drives that this mode does not use.
    """

    model: mujoco.MjModel
    mjcf: str
    pads: Pads
    qpos: NDArray[np.float64]
    ctrl: NDArray[np.float64]
    prescribed: tuple[Drive, ...]
    followed: tuple[Drive, ...]
    servos: NDArray[np.intp]
    commands: tuple[Drive, ...]
    unused: tuple[Drive, ...]

    def joint(self, drive: Drive) -> int:
        """Return the id of the joint that a joint or body drive acts on."""
        if drive.joint:
            return int(self.model.joint(drive.joint).id)
        return int(self.model.body_jntadr[self.model.body(drive.body).id])

    @property
    def free(self) -> tuple[int, ...]:
        """Indices in ``qpos`` of the free objects that no stream moves."""
        driven = {self.joint(drive) for drive in (*self.prescribed, *self.followed)}
        joints = np.flatnonzero(self.model.jnt_type == _FREE)
        return tuple(int(self.model.jnt_qposadr[joint]) for joint in joints if joint not in driven)

    def joint_at(self, address: int) -> int:
        """Return the id of the joint whose position begins at an index in ``qpos``."""
        return int(np.flatnonzero(self.model.jnt_qposadr == address)[0])

    @cached_property
    def weights(self) -> tuple[tuple[int, float], ...]:
        """Body and weight (N) of each free object that no stream moves."""
        gravity = float(np.linalg.norm(self.model.opt.gravity))
        bodies = [int(self.model.jnt_bodyid[self.joint_at(at)]) for at in self.free]
        return tuple((body, gravity * float(self.model.body_subtreemass[body])) for body in bodies)

    @cached_property
    def hands(self) -> NDArray[np.intp]:
        """Root bodies of all that carries pads."""
        return np.unique(self.model.body_rootid[np.asarray(self.pads.bodies)])

    def object_address(self, body: str) -> int:
        """Return the index in ``qpos`` of the pose of a body with a free joint.

        Raises:
            UnknownNameError: The body does not exist.
            InvalidValueError: The body has no free joint.
        """
        names = [self.model.body(i).name for i in range(1, self.model.nbody)]
        if body not in names:
            raise UnknownNameError("body to start", body, [name for name in names if name])
        first = int(self.model.body_jntadr[self.model.body(body).id])
        if first < 0 or int(self.model.jnt_type[first]) != _FREE:
            raise InvalidValueError(f"body {body!r} cannot be placed at the start: it has no free joint")
        return int(self.model.jnt_qposadr[first])


def build_rig(scene: Scene) -> Rig:
    """Compile a scene.

    Raises:
        InvalidValueError: The MJCF cannot be read or lacks the named pads, or a drive cannot act on its target.
        UnknownNameError: A drive's joint, body or actuator is not in the MJCF.
    """
    spec = spec_of(scene)
    mjcf = format_mjcf(spec, "the scene")
    plain = compile_spec(spec, "the scene")
    for drive in scene.drives:
        _check_target(plain, drive)
    qpos, ctrl = _start(plain)
    freed = [d.body for d in scene.drives if d.body and plain.body_mocapid[plain.body(d.body).id] >= 0]
    if freed:
        qpos = _free_mocap(spec, plain, freed, qpos)
        plain = compile_spec(spec, "the scene")
    roles = _roles(scene, plain, qpos)
    model = _heavy(spec, plain, roles.prescribed)
    pads = find_pads(model, names=scene.pads or None)
    scene.gel.apply(model, pads)
    return Rig(model, mjcf, pads, qpos, ctrl, **vars(roles))


def spec_of(scene: Scene) -> mujoco.MjSpec:
    """Return the spec of a scene's model, including its pads, to be modified or compiled."""
    if not scene.sensor:
        return load_spec(scene.mjcf)
    from paxisim.sensors import sensor

    product = sensor(scene.sensor)
    layout = product.layout if scene.pool == 1 else product.layout.pool(scene.pool, scene.pool)
    return attach(scene.mjcf, Pad(layout, mass=product.mass), scene.mounts or None).spec


def _check_target(model: mujoco.MjModel, drive: Drive) -> None:
    counts = {"joint": model.njnt, "body": model.nbody, "actuator": model.nu}
    names = [getattr(model, drive.kind)(i).name for i in range(counts[drive.kind])]
    if drive.target not in names:
        has = ", ".join(name for name in names if name) or "none"
        raise UnknownNameError(
            f"{drive.kind} of the drive of {drive.source!r}",
            drive.target,
            names,
            f"the MJCF's {drive.kind}s are: {has}",
        )
    if drive.joint and int(model.joint(drive.joint).type[0]) not in _SCALAR_JOINTS:
        raise InvalidValueError(
            f"joint {drive.joint!r} is neither a hinge nor a slide: drive its body with a pose (body = ...)"
        )
    if drive.body:
        body = model.body(drive.body).id
        first = int(model.body_jntadr[body])
        is_free = first >= 0 and int(model.jnt_type[first]) == _FREE
        if not is_free and model.body_mocapid[body] < 0:
            raise InvalidValueError(
                f"body {drive.body!r} cannot be driven by a pose: it is not a mocap body and has no free joint"
            )


def _start(model: mujoco.MjModel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    return data.qpos.copy(), data.ctrl.copy()


def _free_mocap(
    spec: mujoco.MjSpec, plain: mujoco.MjModel, bodies: list[str], qpos: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Turn mocap bodies into free bodies and return the start positions including their poses."""
    for name in bodies:
        body = spec.body(name)
        body.mocap = False
        body.add_freejoint()
        if plain.body_mass[plain.body(name).id] < 1e-6:
            body.explicitinertial, body.mass, body.inertia = True, 1.0, np.full(3, 1e-3)
    for key in list(spec.keys):  # keyframes no longer match the number of positions
        spec.delete(key)
    freed = compile_spec(spec, "the scene")
    start = freed.qpos0.copy()
    for body in range(freed.nbody):  # bodies keep their ids, and joints keep their order within each body
        old, new = int(plain.body_jntadr[body]), int(freed.body_jntadr[body])
        if old < 0:
            continue
        for i in range(int(plain.body_jntnum[body])):
            width = {_FREE: 7, int(mujoco.mjtJoint.mjJNT_BALL): 4}.get(int(plain.jnt_type[old + i]), 1)
            a, b = int(plain.jnt_qposadr[old + i]), int(freed.jnt_qposadr[new + i])
            start[b : b + width] = qpos[a : a + width]
    return start


@dataclass(frozen=True, eq=False)
class _Roles:
    """The roles of the drives; see `Rig`."""

    prescribed: tuple[Drive, ...] = ()
    followed: tuple[Drive, ...] = ()
    servos: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    commands: tuple[Drive, ...] = ()
    unused: tuple[Drive, ...] = ()


def _roles(scene: Scene, model: mujoco.MjModel, qpos: NDArray[np.float64]) -> _Roles:
    """Return the role of each drive in the scene's mode."""
    moves = _moved_by(model, qpos)
    bodies = tuple(d for d in scene.drives if d.body)
    joints = tuple(d for d in scene.drives if d.joint)
    actuators = tuple(d for d in scene.drives if d.actuator)
    dof = {d: int(model.jnt_dofadr[model.joint(d.joint).id]) for d in joints}
    if scene.mode in ("auto", "kinematic", "fitted", "shape"):
        held = coupled(model, set(dof.values()))
        unused = tuple(d for d in actuators if moves[model.actuator(d.actuator).id] & held)
        return _Roles((*bodies, *joints), commands=tuple(d for d in actuators if d not in unused), unused=unused)
    if scene.mode == "force" and not actuators:
        raise InvalidValueError("mode force needs a drive with actuator = ... whose stream is a force or a current")
    commanded = {dof for d in actuators for dof in moves[model.actuator(d.actuator).id]}
    left = tuple(d for d in joints if dof[d] not in commanded)
    unused = tuple(d for d in joints if d not in left)
    if scene.mode == "force":
        return _Roles((*bodies, *left), commands=actuators, unused=unused)
    taken = {model.actuator(d.actuator).id for d in actuators}
    holding = [a for a in range(model.nu) if model.actuator_biasprm[a, 1] != 0 and a not in taken]
    for drive in left:
        if not any(dof[drive] in moves[a] for a in holding):
            known = ", ".join(model.actuator(a).name or f"number {a}" for a in holding) or "none"
            raise InvalidValueError(
                f"mode servo: no position actuator moves joint {drive.joint!r} (the MJCF's position actuators: "
                f"{known}); use mode kinematic, or drive an actuator"
            )
    wanted = {dof[drive] for drive in left}
    servos = np.array([a for a in holding if moves[a] & wanted], dtype=np.intp)
    return _Roles(bodies, followed=left, servos=servos, commands=actuators, unused=unused)


def _moved_by(model: mujoco.MjModel, qpos: NDArray[np.float64]) -> list[set[int]]:
    """Return the degrees of freedom that each actuator moves, including those coupled to them by equalities."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    moment = np.zeros((model.nu, model.nv))
    if model.nu:
        mujoco.mju_sparse2dense(
            moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
    return [coupled(model, {int(dof) for dof in np.flatnonzero(row)}) for row in moment]


def coupled(model: mujoco.MjModel, dofs: set[int]) -> set[int]:
    """Return the given degrees of freedom and all those coupled to them by joint equalities."""
    pairs = [
        {int(model.jnt_dofadr[model.eq_obj1id[i]]), int(model.jnt_dofadr[model.eq_obj2id[i]])}
        for i in range(model.neq)
        if int(model.eq_type[i]) == int(mujoco.mjtEq.mjEQ_JOINT) and model.eq_obj2id[i] >= 0
    ]
    grown = set(dofs)
    while True:
        more = set().union(*(pair for pair in pairs if pair & grown))
        if more <= grown:
            return grown
        grown |= more


def _heavy(spec: mujoco.MjSpec, plain: mujoco.MjModel, prescribed: tuple[Drive, ...]) -> mujoco.MjModel:
    """Compile the model with prescribed joints that no contact can move; all else behaves as in `plain`."""
    for drive in prescribed:
        joint = spec.joint(drive.joint) if drive.joint else spec.body(drive.body).joints[0]
        joint.armature = ARMATURE
    try:
        model = spec.copy().compile()
    except ValueError as error:
        raise InvalidValueError(f"MuJoCo cannot compile the scene: {one_line(error)}") from error
    # MuJoCo derives the regularisation of constraints and the solver's tolerance from masses at compile time
    for name in ("body_invweight0", "dof_invweight0", "tendon_invweight0"):
        getattr(model, name)[:] = getattr(plain, name)
    model.stat.meaninertia = plain.stat.meaninertia
    # MuJoCo 4.0 ends its iterations early beside such armatures, and an object held between two of them rattles
    model.opt.tolerance = min(model.opt.tolerance, TOLERANCE)
    return model
