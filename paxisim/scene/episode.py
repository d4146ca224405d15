"""Episode: simulation of one episode of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnsupportedError
from paxisim.models.readout import TactileReadout
from paxisim.scene.drive import Drive
from paxisim.scene.motion import Curve, PoseCurve
from paxisim.scene.rig import ARMATURE, Rig

MAX_STEPS = 20_000_000
"""Most steps of an episode."""
_LONGEST = 3600.0  # s per episode; exceeded if times are in ms by mistake
_FAR = 0.1  # m; clearances beyond this are not measured
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_BAD = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)


@dataclass(frozen=True, eq=False)
class Motion:
    """Inputs of the simulation of one episode.

    Attributes:
        number: Number of the episode, for messages.
        time: ``(T,)`` times (s) of the samples to simulate.
        curves: Motion of the joint or body of each prescribed and followed drive.
        commands: ``(T,)`` values at `time` of each command.
        objects: Index in ``qpos`` and start pose of each object.
    """

    number: int
    time: NDArray[np.float64]
    curves: Mapping[Drive, Curve | PoseCurve]
    commands: Mapping[Drive, NDArray[np.float64]]
    objects: tuple[tuple[int, NDArray[np.float64]], ...] = ()


class EpisodeRunner:
    """Simulates episodes of one rig, one after another.

    Attributes:
        path: ``(T, nq)`` positions of the model at the times of the last motion that was run.
        pressed: ``(T,)`` force (N) beyond its weight with which the surroundings pushed an object in the hand.
    """

    def __init__(self, rig: Rig) -> None:
        """Prepare the simulation state and the tactile readout."""
        self._rig, self._model = rig, rig.model
        self._data = mujoco.MjData(rig.model)
        self._readout = TactileReadout(rig.model, rig.pads)
        self.path = np.zeros((0, rig.model.nq), dtype=np.float32)
        self.pressed = np.zeros(0, dtype=np.float32)

    def run(
        self, motion: Motion, settle: float, mean: bool, start: NDArray[np.float64] | None = None
    ) -> NDArray[np.float32]:
        """Simulate an episode, or a part of it, and return forces ``(T, pads, 3, rows, cols)`` (N) at its times.

        Args:
            motion: The motion.
            settle: Time (s) for which the scene rests at the first pose before the motion.
            mean: Return the mean force since the previous sample, instead of the force at each time.
            start: State at the first time, as `state` returned it at the end of the part before. Default: the episode
                begins, with the objects where the motion says, and settles.

        Raises:
            InvalidValueError: The episode lasts more than an hour, so its times are probably not in seconds.
            UnsupportedError: The simulation becomes unstable.
        """
        timestep = float(self._model.opt.timestep)
        length = float(motion.time[-1] - motion.time[0])
        if length > _LONGEST:
            raise InvalidValueError(
                f"episode {motion.number} lasts {length:.4g} s, more than an hour: are its times in seconds?"
            )
        if length > MAX_STEPS * timestep:
            raise InvalidValueError(
                f"episode {motion.number} lasts {length:.4g} s, more than {MAX_STEPS} steps of {timestep:g} s: use a "
                "longer timestep in the MJCF"
            )
        where = (motion.time - motion.time[0]) / timestep
        where = np.where(np.abs(where - np.round(where)) < 1e-5, np.round(where), where)
        steps = int(np.ceil(where[-1])) + 1
        at = motion.time[0] + timestep * np.arange(steps)
        inputs = _Inputs(self._rig, self._data, motion, at)
        if start is None:
            self._start(motion, inputs, int(np.ceil(settle / timestep)))
        else:
            mujoco.mj_resetData(self._model, self._data)
            mujoco.mj_setState(self._model, self._data, start, _STATE)
        return self._read(motion, inputs, where, steps, mean)

    def state(self) -> NDArray[np.float64]:
        """Return the state of the simulation, to continue from it."""
        state = np.empty(mujoco.mj_stateSize(self._model, _STATE))
        mujoco.mj_getState(self._model, self._data, state, _STATE)
        return state

    def carried(
        self,
        address: int,
        motion: Motion,
        start: NDArray[np.float64] | None,
        state: NDArray[np.float64],
        times: tuple[float, float],
    ) -> NDArray[np.float64]:
        """Return a state in which an object lies where the pads carried it.

        Args:
            address: Index of the object in ``qpos``.
            motion: The motion of the grasp.
            start: State at the start of the grasp; None if the episode begins with it.
            state: State at its end.
            times: When the pads took the object and when they let it go (s).
        """
        model, data = self._model, self._data
        if start is None:
            self._place_objects(motion)
        else:
            mujoco.mj_setState(model, data, start, _STATE)
        pose = data.qpos[address : address + 7].copy()
        taken, left = (self._pad_pose(motion, time) for time in times)
        back = [np.zeros(3), np.zeros(4)]
        mujoco.mju_negPose(*back, *taken)
        relative = [np.zeros(3), np.zeros(4)]
        mujoco.mju_mulPose(*relative, *back, pose[:3], pose[3:])
        put = [np.zeros(3), np.zeros(4)]
        mujoco.mju_mulPose(*put, *left, *relative)
        mujoco.mj_setState(model, data, state, _STATE)
        data.qpos[address : address + 7] = np.concatenate(put)
        dof = int(model.jnt_dofadr[self._rig.joint_at(address)])
        data.qvel[dof : dof + 6] = 0.0
        return self.state()

    def into_first_pad(self, motion: Motion, time: float) -> NDArray[np.float64]:
        """Return the direction ``(3,)`` into the first pad at a time, in the world frame."""
        data = self._placed(motion, time)
        return data.xmat[self._rig.pads.bodies[0]].reshape(3, 3)[:, 2].copy()

    def _pad_pose(self, motion: Motion, time: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return position and quaternion of the first pad at a time, with all that no stream moves at its start."""
        data, pad = self._placed(motion, time), self._rig.pads.bodies[0]
        return data.xpos[pad].copy(), data.xquat[pad].copy()

    @property
    def qpos(self) -> NDArray[np.float64]:
        """``(nq,)`` positions at the end of the last episode that was run."""
        return self._data.qpos.copy()

    def clearance(self, motion: Motion, time: float) -> float:
        """Return the distance (m) from the pads to the nearest geom they could touch, at a time of the motion.

        Everything that no stream moves is at its start pose. Infinite if nothing is within 0.1 m.
        """
        data, model = self._placed(motion, time), self._model
        taxels = self._rig.pads.geoms.ravel()
        others = np.setdiff1d(np.arange(model.ngeom), taxels)
        nearest = _FAR
        for taxel in taxels:
            bits = (model.geom_contype[taxel] & model.geom_conaffinity[others]) | (
                model.geom_conaffinity[taxel] & model.geom_contype[others]
            )
            weld = model.body_weldid[model.geom_bodyid[others]] != model.body_weldid[model.geom_bodyid[taxel]]
            for other in others[(bits != 0) & weld]:
                nearest = min(nearest, mujoco.mj_geomDistance(model, data, int(taxel), int(other), nearest, None))
        return float(nearest) if nearest < _FAR else float("inf")

    def _placed(self, motion: Motion, time: float) -> mujoco.MjData:
        """Return the state with the streams at a time and all else at its start, with its kinematics computed."""
        self._place_objects(motion)
        _Inputs(self._rig, self._data, motion, np.array([time])).place(self._data)
        mujoco.mj_kinematics(self._model, self._data)
        return self._data

    def _place_objects(self, motion: Motion) -> None:
        """Reset the simulation to the start of an episode, except for what the streams move."""
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:] = self._rig.qpos
        for address, pose in motion.objects:
            self._data.qpos[address : address + 7] = pose

    def _start(self, motion: Motion, inputs: _Inputs, settling: int) -> None:
        data = self._data
        self._place_objects(motion)
        data.ctrl[:] = self._rig.ctrl
        inputs.place(data)
        for _ in range(settling):
            inputs.rest(data)
            mujoco.mj_step(self._model, data)
        self._check(motion, "while it settles at its first pose")

    def _read(
        self, motion: Motion, inputs: _Inputs, where: NDArray[np.float64], steps: int, mean: bool
    ) -> NDArray[np.float32]:
        """Simulate the motion step by step; `where` holds the samples' times in steps."""
        data, before = self._data, np.floor(where).astype(int)
        weight = (where - before).reshape(-1, 1, 1, 1, 1)
        needed = np.zeros(steps, dtype=bool)
        needed[before] = True
        needed[np.minimum(before + 1, steps - 1)[weight.ravel() > 0]] = True
        first_of = np.searchsorted(before, np.arange(steps + 1))
        out = np.zeros((len(where), *self._rig.pads.shape))
        self.path = np.zeros((len(where), self._model.nq), dtype=np.float32)
        self.pressed = np.zeros(len(where), dtype=np.float32)
        total = np.zeros(self._rig.pads.shape)
        sums = np.zeros_like(out)  # integral of the force up to each sample's time, by the trapezoidal rule
        last = None
        for k in range(steps):
            inputs.set(data, k)
            mujoco.mj_step(self._model, data)
            if not (needed[k] or mean):
                continue
            force = self._readout.read_exact(data)
            mine = slice(first_of[k], first_of[k + 1])
            out[mine] += (1 - weight[mine]) * force
            if mine.stop > mine.start:
                self.path[mine] = data.qpos
                self.pressed[mine] = self._pressed()
            if k:
                previous = slice(first_of[k - 1], first_of[k])
                out[previous] += weight[previous] * force
                if mean and last is not None:
                    # a sample between two steps takes its part of the trapezoid
                    part = weight[previous]
                    sums[previous] = total + part * (last + 0.5 * part * (force - last))
                    total = total + 0.5 * (last + force)
            sums[mine] = total
            last = force
            if k % 500 == 0:
                self._check(motion, f"at {motion.time[0] + k * self._model.opt.timestep:.3f} s")
        self._check(motion, "at its end")
        if mean:
            width = np.diff(where).reshape(-1, 1, 1, 1, 1)
            out[1:] = np.where(width > 0, np.diff(sums, axis=0) / np.maximum(width, 1e-12), out[1:])
        return out.astype(np.float32)

    def _pressed(self) -> float:
        """Return the force (N) beyond its weight with which the surroundings push a free object that a pad touches.

        0 if no pad touches an object. A table that carries an object exerts no more than its weight.
        """
        data, rig, model = self._data, self._rig, self._model
        geoms = data.contact.geom
        roots = model.body_rootid[model.geom_bodyid[geoms]]
        most, force = 0.0, np.zeros(6)
        for body, weight in rig.weights:
            its = np.flatnonzero((roots == body).sum(axis=1) == 1)
            if not np.isin(geoms[its], rig.pads.geoms).any():
                continue
            outside = np.zeros(3)
            for contact in its[~np.isin(roots[its], rig.hands).any(axis=1)]:
                mujoco.mj_contactForce(model, data, int(contact), force)
                push = data.contact.frame[contact].reshape(3, 3).T @ force[:3]
                outside += push if roots[contact, 1] == body else -push
            most = max(most, float(np.linalg.norm(outside)) - weight)
        return most

    def _check(self, motion: Motion, when: str) -> None:
        if any(self._data.warning[int(kind)].number for kind in _BAD):
            raise UnsupportedError(
                f"the simulation of episode {motion.number} becomes unstable {when}: use a smaller timestep in the "
                "MJCF, or check the start poses of the objects"
            )


class _Inputs:
    """Values written into the simulation state before each step."""

    def __init__(self, rig: Rig, data: mujoco.MjData, motion: Motion, at: NDArray[np.float64]) -> None:
        model, steps = rig.model, len(at)
        positions, dofs = [], []
        q, v, a = [np.zeros((steps, 0))], [np.zeros((steps, 0))], [np.zeros((steps, 0))]
        for drive in rig.prescribed:
            joint = rig.joint(drive)
            parts = [part.reshape(steps, -1) for part in motion.curves[drive](at)]
            for values, found in zip((q, v, a), parts, strict=True):
                values.append(found)
            positions += range(model.jnt_qposadr[joint], model.jnt_qposadr[joint] + parts[0].shape[1])
            dofs += range(model.jnt_dofadr[joint], model.jnt_dofadr[joint] + parts[1].shape[1])
        self._positions, self._dofs = np.array(positions, dtype=int), np.array(dofs, dtype=int)
        self._q, self._v, self._push = np.hstack(q), np.hstack(v), ARMATURE * np.hstack(a)
        self._ctrl = np.tile(rig.ctrl, (steps, 1))
        self._followed: dict[int, float] = {}
        self._follow(rig, data, motion, at)
        for drive, values in motion.commands.items():
            self._ctrl[:, model.actuator(drive.actuator).id] = np.interp(at, motion.time, values)

    def _follow(self, rig: Rig, data: mujoco.MjData, motion: Motion, at: NDArray[np.float64]) -> None:
        """Compute the controls that hold position actuators at the recorded positions of their joints."""
        if not rig.followed:
            return
        model = rig.model
        address = [int(model.jnt_qposadr[rig.joint(drive)]) for drive in rig.followed]
        q = np.column_stack([motion.curves[drive](at)[0] for drive in rig.followed])
        self._followed = dict(zip(address, q[0].tolist(), strict=True))
        gain, slope = model.actuator_gainprm[rig.servos, 0], model.actuator_biasprm[rig.servos, 1]
        data.qpos[:] = rig.qpos
        for k in range(len(at)):
            data.qpos[address] = q[k]
            data.qpos[self._positions] = self._q[k]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_tendon(model, data)
            mujoco.mj_transmission(model, data)
            self._ctrl[k, rig.servos] = -slope / gain * data.actuator_length[rig.servos]

    def place(self, data: mujoco.MjData) -> None:
        """Place all driven joints and bodies at the start of the motion."""
        for address, value in self._followed.items():
            data.qpos[address] = value
        data.qpos[self._positions] = self._q[0]

    def rest(self, data: mujoco.MjData) -> None:
        """Hold the first pose."""
        data.qpos[self._positions] = self._q[0]
        data.qvel[self._dofs] = 0.0
        data.qfrc_applied[self._dofs] = 0.0
        data.ctrl[:] = self._ctrl[0]

    def set(self, data: mujoco.MjData, k: int) -> None:
        """Write the inputs of step `k`."""
        data.qpos[self._positions] = self._q[k]
        data.qvel[self._dofs] = self._v[k]
        data.qfrc_applied[self._dofs] = self._push[k]
        data.ctrl[:] = self._ctrl[k]
