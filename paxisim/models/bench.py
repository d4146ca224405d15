"""Bench: close one end effector of a robot on an object in simulation, everything else locked.

Gravity is off, and the robot touches nothing but the object, which is rigid. Springs hold it, soft ones along the
closing direction, so that all pads share the load, and stiff ones across it, so that it does not slip out of jaws that
are not parallel. A plate does not move at all. Units: metres, seconds, newtons.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.models.attach import TactileGripper
from paxisim.models.grip import Grip, below, end_effector
from paxisim.models.links import moments
from paxisim.models.load import compile_whole
from paxisim.models.objects import Placed
from paxisim.models.readout import TactileReadout

_NAME = "paxisim_squeezed_object"
_LOCKED = 1e5  # kg or kg m^2: armature of a joint that must not move; much more spoils the contact solver's accuracy
_STUCK = 1e6  # N s/m or N m s: its damping
_MASS, _INERTIA = 0.2, 1e-4  # kg, kg m^2 of the object
_SOFT, _STIFF = 10e-3, 0.5e-3  # m: the full force moves the object so far along and across the closing direction
_TURN, _LEVER = 0.02, 5e-3  # rad, m: on this lever the full force turns it so far
_PUSH = 1e3  # N or N m, enough to overcome friction in the joints
_STEP = 1e-3  # s, largest time step; light fingers chatter at the usual 2 ms
_LOOK = 4e-3  # s between two looks
_SLOW, _RAMP = 20.0, 2.0  # s: to change the controls from open to closed without and with an object
_RISE = 0.8  # s: to raise the force to its limit, at least
_LONGEST, _REST = 4.0, 0.08  # s: to wait at most after the controls have changed; of two equal mean forces at rest
_CONSTANT = 0.02  # largest change of a constant force, as a share of it; hard contacts chatter
_LOST = 0.1  # share of its largest force that an object which slipped still carries, at most
_SLIPPED = "it slipped out of the grip; these are the largest forces"
_UNSTABLE = "the simulation is unstable"
_THROWN = 20.0  # times the wanted force: no gripper presses so hard, only geoms that lie inside one another
_EJECTED = "it was ejected: something lies inside it, or it was squeezed out at once; there is no force to give"
_STATE = int(mujoco.mjtState.mjSTATE_FULLPHYSICS) | int(mujoco.mjtState.mjSTATE_CTRL)
_ANY = 2**31 - 1  # contact bits that meet all others; which geoms an object touches is chosen later
_QUIET = 1e-3  # speed of a robot at rest, as a share of its largest


@dataclass(frozen=True, eq=False)
class Closing:
    """A slow closing without an object.

    Attributes:
        qpos: ``(frames, nq)`` poses of the robot, open first.
        states: ``(frames, size)`` states of the simulation.
        ramp: ``(frames,)`` share of the way from the open to the closed controls.
    """

    qpos: NDArray[np.float64]
    states: NDArray[np.float64]
    ramp: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Loads:
    """Forces on an object at rest.

    Attributes:
        normal: ``(ngeom,)`` normal force (N) that each geom of the robot carries.
        read: ``(pads, taxels)`` normal force (N) that each taxel reads.
        solver: ``(pads,)`` force (N) along each pad's normal, from ``mj_contactForce``.
        note: What makes the numbers doubtful; empty if nothing does.
    """

    normal: NDArray[np.float64]
    read: NDArray[np.float64]
    solver: NDArray[np.float64]
    note: str


class Bench:
    """Model of the robot with objects, of which it can touch one at a time.

    Attributes:
        model: The model; its first geoms and joints are those of the robot alone.
        pads: Pads of the model.
    """

    def __init__(self, gripper: TactileGripper, grip: Grip, placed: Sequence[Placed] = ()) -> None:
        """Compile the model and lock what does not belong to the end effector."""
        self.grip, self.placed = grip, placed
        spec = gripper.spec.copy()
        for element in [*spec.keys, *spec.pairs]:
            spec.delete(element)
        _add_objects(spec, placed)
        self.model = model = compile_whole(spec, "the gripper with pads and an object")
        model.opt.timestep = min(model.opt.timestep, _STEP)
        model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        self.pads = gripper.bind(model)
        self._readout = TactileReadout(model, self.pads)
        self._data = mujoco.MjData(model)
        self._object = model.body(_NAME).id
        self._objects = int(model.body_geomadr[self._object]) + np.arange(len(placed))
        # planes and height fields are floors and terrain: no finger has them
        ground = [int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD)]
        self._solid = ((model.geom_contype | model.geom_conaffinity) != 0) & ~np.isin(model.geom_type, ground)
        self._solid[self._objects] = False
        hard = ~np.isin(np.arange(model.ngeom), self.pads.geoms)
        model.geom_solref[hard] = (2 * model.opt.timestep, 1.0)
        model.geom_solimp[hard] = (0.99, 0.999, 1e-4, 0.5, 2.0)
        self._moving = end_effector(model, grip)
        self._lock()

    def _lock(self) -> None:
        """Hold every joint outside the end effector, and silence the actuators that move nothing else."""
        model, data = self.model, self._data
        free = self._moving[model.dof_bodyid] | (model.dof_bodyid == self._object)
        _set_armature(model, np.flatnonzero(~free), _LOCKED)
        model.dof_damping[~free] = _STUCK
        mujoco.mj_forward(model, data)
        moment = moments(model, data)
        for actuator in set(range(model.nu)) - set(self.grip.actuators):
            if not np.any(moment[actuator][free]):
                model.actuator_gainprm[actuator] = model.actuator_biasprm[actuator] = 0

    def actuators(self, closing: Closing, index: int) -> list[int]:
        """Return the actuators that close on an object: all of the grip's, or those that move the pad on a plate."""
        grip, placed = self.grip, self.placed[index]
        own = [a for a in grip.actuators if grip.open_ctrl[a] != grip.close_ctrl[a]]
        if placed.shape != "plate":
            return own
        model, data = self.model, self._data
        self._touch(None)
        self._set(closing, placed.frame)
        mujoco.mj_forward(model, data)
        jacobian = np.zeros((3, model.nv))
        mujoco.mj_jacBody(model, data, jacobian, None, int(self.pads.bodies[placed.pads[0]]))
        # motion passes through linkages and coupled joints, so compare accelerations; both ways, for joints at a limit
        rest, moved, moment = data.qacc.copy(), dict.fromkeys(own, 0.0), moments(model, data)
        for actuator in own:
            for push in (_PUSH, -_PUSH):
                data.qfrc_applied[:] = push * moment[actuator]
                mujoco.mj_forward(model, data)
                change = data.qacc - rest
                speed = float(np.linalg.norm(jacobian @ change)) / max(float(np.abs(change).max()), 1e-12)
                moved[actuator] = max(moved[actuator], speed)
        data.qfrc_applied[:] = 0
        return [a for a in own if moved[a] > max(1e-6, 1e-2 * max(moved.values()))]

    def close(self) -> Closing:
        """Close slowly without an object."""
        data = self._data
        mujoco.mj_resetData(self.model, data)
        self._touch(None)
        data.qpos[: self.grip.qpos.shape[1]] = self.grip.qpos[0]
        data.ctrl[:] = self.grip.open_ctrl
        self._drive([], 1.0)
        frames: list[tuple[NDArray[np.float64], float]] = []
        self._drive(list(self.grip.actuators), 0.0, frames=frames)
        states, ramp = zip(*frames, strict=True)
        qpos = np.stack(states)[:, 1 : 1 + self.grip.qpos.shape[1]]  # a state starts with the time
        return Closing(qpos, np.stack(states), np.array(ramp))

    def squeeze(self, closing: Closing, index: int, force: float) -> Loads:
        """Continue a closing on an object until it carries a force per pad, and read the forces at rest."""
        own = self.actuators(closing, index)
        frame = self._place(closing, index, force)
        largest = mujoco.MjData(self.model)
        limit = force * len(self.placed[index].pads)
        note = self._drive(own, float(closing.ramp[frame]), limit=limit, largest=largest)
        loads = self._read(largest if note == _SLIPPED else self._data, note)
        if note and not loads.normal.sum() < _THROWN * limit:
            none = (np.zeros_like(part) for part in (loads.normal, loads.read, loads.solver))
            return Loads(*none, note=note if note == _UNSTABLE else _EJECTED)
        # a weak finger rolls off a plate when it closes further, which says nothing about its pad
        return replace(loads, note="") if note == _SLIPPED and self.placed[index].shape == "plate" else loads

    def _set(self, closing: Closing, frame: int) -> None:
        mujoco.mj_resetData(self.model, self._data)
        mujoco.mj_setState(self.model, self._data, closing.states[frame], _STATE)

    def _touch(self, index: int | None) -> None:
        """Let the robot touch one object and nothing else.

        A plate can be touched only by the link with the pad and by what hangs on it: a curled finger would also put
        its other links on a plate, whatever the mount.
        """
        model, solid = self.model, self._solid
        if index is not None and self.placed[index].shape == "plate":
            link = int(model.body_weldid[self.pads.bodies[self.placed[index].pads[0]]])
            solid = solid & below(model, link)[model.geom_bodyid]
        model.geom_contype[:] = 0
        model.geom_conaffinity[:] = solid
        if index is not None:
            model.geom_contype[self._objects[index]] = 1

    def _place(self, closing: Closing, index: int, force: float) -> int:
        """Put the object where it belongs and open the gripper until nothing touches it; return the frame."""
        model, placed = self.model, self.placed[index]
        self._touch(index)
        model.body_pos[self._object] = placed.pos
        mujoco.mju_mat2Quat(model.body_quat[self._object], np.ascontiguousarray(placed.axes).reshape(-1))
        dof, joint = int(model.body_dofadr[self._object]), int(model.body_jntadr[self._object])
        floats = placed.shape != "plate"
        total = force * len(placed.pads)
        stiffness = np.where(placed.yields, total / _SOFT, total / _STIFF)
        turning = _LEVER * total / _TURN
        _set_armature(model, dof + np.arange(6), 0.0 if floats else _LOCKED)
        model.jnt_stiffness[joint : joint + 4] = [*stiffness, turning] if floats else 0
        model.dof_damping[dof : dof + 3] = 2 * np.sqrt(stiffness * _MASS) if floats else _STUCK
        model.dof_damping[dof + 3 : dof + 6] = 2 * np.sqrt(turning * _INERTIA) if floats else _STUCK
        for frame in range(placed.frame, -1, -1):
            self._set(closing, frame)
            mujoco.mj_fwdPosition(model, self._data)
            if self._data.ncon == 0:
                return frame
        self._set(closing, placed.frame)  # something is in the object's way even when the gripper is open
        return placed.frame

    def _drive(
        self,
        actuators: list[int],
        ramp: float,
        *,
        limit: float = np.inf,
        largest: mujoco.MjData | None = None,
        frames: list[tuple[NDArray[np.float64], float]] | None = None,
    ) -> str:
        """Close actuators until the object carries a force, and wait until it is constant or nothing moves.

        Args:
            actuators: Actuators to close; the others keep their controls.
            ramp: Share of the way from the open to the closed controls at the start.
            limit: Force (N) at which the controls stay as they are.
            largest: Becomes a copy of the data with the largest force.
            frames: States and shares to append to.

        Returns:
            What went wrong; empty if nothing did.
        """
        model, data, grip = self.model, self._data, self.grip
        data.time = 0.0
        every = max(1, round(_LOOK / model.opt.timestep))
        look = every * model.opt.timestep
        window = max(2, round(_REST / look))
        loads, speeds, stopped, peak = [], [], False, 0.0
        duration = _SLOW if limit == np.inf else _RAMP
        while data.time < duration + _LONGEST:
            # wait while the force rises by itself, since servos lag behind their controls
            rises = len(loads) > 1 and loads[-1] - loads[-2] > limit * look / _RISE
            if not (stopped or rises):
                ramp = min(1.0, ramp + look / duration)
            data.ctrl[actuators] = (grip.open_ctrl + ramp * (grip.close_ctrl - grip.open_ctrl))[actuators]
            mujoco.mj_step(model, data, every)
            if not np.all(np.isfinite(data.qpos)) or data.warning[int(mujoco.mjtWarning.mjWARN_BADQACC)].number:
                return _UNSTABLE
            if frames is not None:
                state = np.zeros(mujoco.mj_stateSize(model, _STATE))
                mujoco.mj_getState(model, data, state, _STATE)
                frames.append((state, ramp))
            rows = data.contact.efc_address
            loads.append(float(data.efc_force[rows[rows >= 0]].sum()))  # elliptic cone: the normal force comes first
            speeds.append(float(np.abs(data.qvel).max(initial=0.0)))
            if largest is not None and loads[-1] > peak:
                mujoco.mj_copyData(largest, model, data)
                peak = loads[-1]
            stopped = stopped or min(loads[-3:]) >= limit  # not at an impact
            if (stopped or ramp == 1.0) and len(loads) >= 2 * window:
                before, now = np.mean(loads[-2 * window : -window]), np.mean(loads[-window:])
                constant = abs(now - before) <= _CONSTANT * now
                if constant and now < _LOST * peak:
                    return _SLIPPED
                quiet = max(speeds[-window:]) <= _QUIET * max(speeds)
                if constant and (now > 0 or quiet):
                    return ""
        return f"still moving after {duration + _LONGEST:g} s"

    def _read(self, data: mujoco.MjData, note: str) -> Loads:
        model, pads = self.model, self.pads
        normal, solver, force = np.zeros(model.ngeom), np.zeros((model.ngeom, 3)), np.zeros(6)
        for i in range(data.ncon):
            contact = data.contact[i]
            mujoco.mj_contactForce(model, data, i, force)
            first, second = int(contact.geom1), int(contact.geom2)
            # the force acts on the second geom, its reaction on the first
            geom, sign = (second, 1) if first in self._objects else (first, -1)
            normal[geom] += force[0]
            solver[geom] += sign * force[:3] @ contact.frame.reshape(3, 3)
        inward = data.xmat[pads.bodies].reshape(-1, 3, 3)[:, :, 2]
        read = self._readout.read_exact(data)[:, 2].reshape(len(pads), -1)
        return Loads(normal, read, np.einsum("ptj,pj->p", solver[pads.geoms], inward), note)


def _add_objects(spec: mujoco.MjSpec, placed: Sequence[Placed]) -> None:
    """Add a body with the geom of every object to the end of the world, so that the robot's joints come first."""
    kinds = mujoco.mjtJoint
    # the model's defaults apply to whatever is not given here
    bare = {"limited": 0, "frictionloss": 0, "ref": 0, "springref": 0, "margin": 0}
    surface = {"mass": 0, "friction": [1, 0.005, 1e-4], "condim": 3, "priority": 0, "solmix": 1, "margin": 0, "gap": 0}
    surface |= {"contype": _ANY, "conaffinity": _ANY}
    body = spec.worldbody.add_body(name=_NAME, mass=_MASS, inertia=[_INERTIA] * 3, explicitinertial=True)
    for axis in np.eye(3):
        body.add_joint(type=kinds.mjJNT_SLIDE, axis=axis, **bare)
    body.add_joint(type=kinds.mjJNT_BALL, **bare)
    for one in placed:
        kind = mujoco.mjtGeom.mjGEOM_CYLINDER if one.shape == "cylinder" else mujoco.mjtGeom.mjGEOM_BOX
        body.add_geom(type=kind, size=[*one.size, 0.0][:3], **surface)


def _set_armature(model: mujoco.MjModel, dofs: NDArray[np.int64], value: float) -> None:
    # bodies without children take their inertia from dof_M0, which the compiler computes with the armature
    model.dof_M0[dofs] += value - model.dof_armature[dofs]
    model.dof_armature[dofs] = value
