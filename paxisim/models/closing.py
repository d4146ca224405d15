"""Closing: drive some of a robot's actuators while everything else is locked, and keep the poses on the way.

The robot is simulated as it is, with its tendons, equalities and springs, but without gravity and contacts. Units:
metres, seconds; controls in the actuator's own units. The result is deterministic.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.models.links import Links

_LONGEST = 6.0  # s; longer strokes are cut off
_RAMP = 1.0  # s; a step of the controls would make a loose linkage swing
_LOOK = 4e-3  # s between two samples of the pose
_FRAMES = 40
_LOCK = 1e7  # kg m^2 or kg, armature of a locked joint


@dataclass(frozen=True, eq=False)
class Stroke:
    """Poses of a robot on the way from one set of controls to another.

    Attributes:
        qpos: ``(frames, nq)`` poses.
        pos: ``(frames, nbody, 3)`` body positions.
        rot: ``(frames, nbody, 3, 3)`` body orientations.
        geoms: ``(frames, ngeom, 3)`` geom positions.
    """

    qpos: NDArray[np.float64]
    pos: NDArray[np.float64]
    rot: NDArray[np.float64]
    geoms: NDArray[np.float64]

    def world(self, link: int, frame: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform points of a link to the world frame at a pose."""
        return point @ self.rot[frame, link].T + self.pos[frame, link]

    def local(self, link: int, frame: int, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Transform world points to the frame of a link at a pose."""
        return (point - self.pos[frame, link]) @ self.rot[frame, link]


class Drive:
    """Drives the actuators of a hand, with all joints that are not its own locked at rest."""

    def __init__(self, links: Links, dofs: NDArray[np.int64], only: Sequence[int] = ()) -> None:
        """Prepare the model.

        Args:
            links: The robot at rest; its model is copied.
            dofs: Degrees of freedom of the hand.
            only: Ids of the actuators to drive; default: all that drive nothing but these degrees of freedom.
        """
        self.model = model = copy(links.model)
        self.rest = links.data
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        self._locked = np.setdiff1d(np.arange(model.nv), dofs)
        model.dof_armature[self._locked] = _LOCK
        still = ~np.isin(np.arange(model.njnt), model.dof_jntid[dofs])
        self._still = np.concatenate(
            [np.zeros(0, dtype=np.int64), *(_positions(model, int(joint)) for joint in np.flatnonzero(still))]
        )
        low, high = control_range(model).T
        own = links.drives[:, dofs].any(axis=1)
        self.actuators = np.flatnonzero(own & ~links.drives[:, self._locked].any(axis=1))
        if only:
            self.actuators = np.array(sorted(set(only) & set(self.actuators.tolist())), dtype=np.int64)
        self.low, self.high = low[self.actuators], high[self.actuators]

    def control(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the controls ``(nu,)`` with these values for the hand's actuators and the rest at rest."""
        ctrl = self.rest.ctrl.copy()
        ctrl[self.actuators] = values
        return ctrl

    def stroke(self, start: NDArray[np.float64], end: NDArray[np.float64]) -> Stroke:
        """Return the poses on the way between two sets of values of the hand's actuators.

        Raises:
            InvalidValueError: The simulation is unstable.
        """
        data = self._data()
        self._drive(data, start)
        frames = [_frame(data)]
        data.time = 0.0
        self._drive(data, end, frames)
        frames = [frames[i] for i in _evenly(np.stack([f[3] for f in frames]))]
        return Stroke(*(np.stack(part) for part in zip(*frames, strict=True)))

    def reach(self, values: NDArray[np.float64]) -> Stroke:
        """Return the single pose that the hand takes with these values of its actuators."""
        data = self._data()
        self._drive(data, values)
        return Stroke(*(part[None] for part in _frame(data)))

    def _data(self) -> mujoco.MjData:
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.rest.qpos
        return data

    def _drive(
        self,
        data: mujoco.MjData,
        values: NDArray[np.float64],
        frames: list[tuple[NDArray[np.float64], ...]] | None = None,
    ) -> None:
        """Simulate until nothing moves; if `frames` is given, move the controls slowly and append the poses to it."""
        start, end = data.ctrl.copy(), self.control(values)
        every = max(1, round(_LOOK / self.model.opt.timestep))
        before, fastest, quiet = data.qpos.copy(), 0.0, 0
        while data.time < _LONGEST and quiet < 20:
            share = 1.0 if frames is None else min(1.0, data.time / _RAMP)
            data.ctrl[:] = start + share * (end - start)
            mujoco.mj_step(self.model, data, every)
            # constraints, such as one that welds a hand to a mocap body, move even heavy joints
            data.qpos[self._still] = self.rest.qpos[self._still]
            data.qvel[self._locked] = 0.0
            if not np.all(np.isfinite(data.qpos)) or data.warning[int(mujoco.mjtWarning.mjWARN_BADQACC)].number:
                raise InvalidValueError("the robot is unstable when its actuators are driven: check its timestep")
            speed = float(np.abs(data.qpos - before).max(initial=0.0))
            before, fastest = data.qpos.copy(), max(fastest, speed)
            quiet = quiet + 1 if share == 1.0 and speed <= 1e-3 * fastest else 0
            if frames is not None:
                mujoco.mj_kinematics(self.model, data)
                frames.append(_frame(data))
        mujoco.mj_kinematics(self.model, data)


def _positions(model: mujoco.MjModel, joint: int) -> NDArray[np.int64]:
    """Return the indices of a joint's coordinates in ``qpos``."""
    first = int(model.jnt_qposadr[joint])
    width = {int(mujoco.mjtJoint.mjJNT_FREE): 7, int(mujoco.mjtJoint.mjJNT_BALL): 4}.get(int(model.jnt_type[joint]), 1)
    return np.arange(first, first + width)


def control_range(model: mujoco.MjModel) -> NDArray[np.float64]:
    """Return the lower and upper control of each actuator, ``(nu, 2)``.

    These are its ctrlrange. Without a ctrlrange, they are the range of its joint or tendon if the actuator holds a
    position, else its forcerange, else -1 to 1.
    """
    ends = np.tile([-1.0, 1.0], (model.nu, 1))
    joint = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    for a in range(model.nu):
        target, kind = int(model.actuator_trnid[a, 0]), int(model.actuator_trntype[a])
        holds = model.actuator_biasprm[a, 1] != 0
        gear = model.actuator_gear[a, 0]
        if model.actuator_ctrllimited[a]:
            ends[a] = model.actuator_ctrlrange[a]
        elif holds and kind in joint and model.jnt_limited[target]:
            ends[a] = np.sort(gear * model.jnt_range[target])
        elif holds and kind == int(mujoco.mjtTrn.mjTRN_TENDON) and model.tendon_limited[target]:
            ends[a] = np.sort(gear * model.tendon_range[target])
        elif not holds and model.actuator_forcelimited[a]:
            ends[a] = model.actuator_forcerange[a]
    return ends


def _frame(data: mujoco.MjData) -> tuple[NDArray[np.float64], ...]:
    return data.qpos.copy(), data.xpos.copy(), data.xmat.reshape(-1, 3, 3).copy(), data.geom_xpos.copy()


def _evenly(points: NDArray[np.float64]) -> Sequence[int]:
    """Return the indices of about `_FRAMES` frames with equal motion between them, the last frame included."""
    travel = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=-1).max(axis=1, initial=0.0)))
    wanted = np.linspace(0, travel[-1], _FRAMES)
    return [int(i) for i in np.unique(np.append(np.searchsorted(travel, wanted - 1e-12), len(travel) - 1))]
