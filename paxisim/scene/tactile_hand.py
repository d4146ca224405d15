"""TactileHand: pads that come together, the joints that bring them together, and the stream that closes them.

The opening of a hand is the distance between its pads, along the direction in which they face each other.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from copy import copy
from itertools import combinations

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.models.find_mounts import grips_of
from paxisim.models.grip import Grip
from paxisim.models.links import at_rest, bodies_above, moments
from paxisim.models.mount import Mount
from paxisim.models.pads import Pads
from paxisim.scene.drive import Drive
from paxisim.scene.rig import ARMATURE, coupled

_SLIDE, _HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)
_STEP = 1e-3  # m or rad
_POINTS = 17  # of a curve
_HOLD = 1.0  # s until a linkage is at rest
_FINEST = 1e-5  # m, smallest step of a curve
_MOVES = 1e-3  # m or rad, smallest travel of a joint that closes


class TactileHand:
    """Pads that come together, and the joints that bring them together.

    Attributes:
        pads: Ids of the bodies of the pads.
        joints: Names of the joints that move when it closes.
        grip: How its actuators close it; None if it has none.
    """

    def __init__(self, model: mujoco.MjModel, pads: Pads, index: Sequence[int], grip: Grip | None) -> None:
        """Find the joints.

        Args:
            model: The compiled model.
            pads: Its pads.
            index: Indices of the pads of this hand.
            grip: How its actuators close it, if it has some.
        """
        self._model, self.grip = model, grip
        self.pads = [int(pads.bodies[i]) for i in index]
        if grip is None:
            chains = [{body, *bodies_above(model, body)} for body in self.pads]
            inside = set.union(*chains) - set.intersection(*chains)  # a joint that moves all pads does not close
            moving = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in inside]
        else:
            travel = np.ptp(grip.qpos, axis=0)
            moving = [j for j in range(model.njnt) if travel[model.jnt_qposadr[j]] > _MOVES]
        kinds = (_SLIDE, _HINGE)
        self.joints = tuple(
            model.joint(j).name for j in moving if int(model.jnt_type[j]) in kinds and model.joint(j).name
        )

    def distance(self, data: mujoco.MjData) -> float:
        """Return the distance (m) between its first two pads, with the kinematics of `data` computed."""
        one, two = self.pads[:2]
        into = data.xmat[two].reshape(3, 3)[:, 2] - data.xmat[one].reshape(3, 3)[:, 2]
        return float(into @ (data.xpos[two] - data.xpos[one]) / max(float(np.linalg.norm(into)), 1e-9))

    def approach(self, joint: str) -> float:
        """Return how much nearer (m) its pads come to one another, on average, if only one joint closes.

        This is 0 for a joint that moves the pads through a linkage.
        """
        model, data = self._model, mujoco.MjData(self._model)
        address = int(model.jnt_qposadr[model.joint(joint).id])
        if self.grip is None:
            ends = tuple(model.joint(joint).range)
        else:
            data.qpos[:] = self.grip.qpos[0]
            ends = (float(self.grip.qpos[0, address]), float(self.grip.qpos[-1, address]))
        apart = []
        for end in ends:
            data.qpos[address] = end
            mujoco.mj_kinematics(model, data)
            pairs = combinations(data.xpos[self.pads], 2)
            apart.append(float(np.mean([np.linalg.norm(one - two) for one, two in pairs] or [0.0])))
        return abs(apart[0] - apart[1])

    def drives(self, stream: str) -> list[Drive]:
        """Return the drives with which a stream in m moves the fingers; empty if its pads do not face each other."""
        if len(self.pads) != 2:
            return []
        return self._slides(stream) or self._linkage(stream)

    def _slides(self, stream: str) -> list[Drive]:
        """Return drives of two joints that each slide by half of the opening."""
        model, data = self._model, mujoco.MjData(self._model)
        if len(self.joints) != 2 or any(int(model.joint(name).type[0]) != _SLIDE for name in self.joints):
            return []
        apart = []
        for moved in ((0.0, 0.0), (_STEP, 0.0), (0.0, _STEP)):
            for name, value in zip(self.joints, moved, strict=True):
                data.joint(name).qpos = value
            mujoco.mj_kinematics(model, data)
            apart.append(self.distance(data))
        rates = [(one - apart[0]) / _STEP for one in apart[1:]]
        if any(abs(abs(rate) - 1) > 0.01 for rate in rates):
            return []
        return [
            Drive(
                stream, joint=name, unit="m", scale=round(0.5 * sign, 6), offset=round(-0.5 * sign * apart[0], 6) + 0.0
            )
            for name, sign in zip(self.joints, np.sign(rates).tolist(), strict=True)
        ]

    def _linkage(self, stream: str) -> list[Drive]:
        """Return drives with a curve for each joint that the actuators move, such as those of a four-bar linkage."""
        if self.grip is None:
            return []
        model = self._model
        acted = np.any(np.abs(moments(model, at_rest(model))[list(self.grip.actuators)]) > 1e-9, axis=0)
        dofs = coupled(model, {int(dof) for dof in np.flatnonzero(acted)})
        joints = [j for name in self.joints if int(model.jnt_dofadr[j := model.joint(name).id]) in dofs]
        if not joints:
            return []
        stroke = self.grip.qpos[:, model.jnt_qposadr[joints]]
        travel = stroke[-1] - stroke[0]
        if np.any(np.abs(travel) < _MOVES):
            return []
        lead = (stroke[:, 0] - stroke[0, 0]) / travel[0]
        shares = np.linspace(0, 1, _POINTS)
        # in proportion: while the hand moves, a joint that is coupled to another lags behind
        places = stroke[0] + shares[:, None] * travel
        frames = [int(np.argmin(np.abs(lead - share))) for share in shares]
        apart = np.array([self._held(self.grip.qpos[f], joints, q) for f, q in zip(frames, places, strict=True)])
        if np.any(np.diff(apart) > -_FINEST):
            return []
        return [
            Drive(stream, joint=model.joint(j).name, unit="m", curve=_points(apart[::-1], places[::-1, i]))
            for i, j in enumerate(joints)
        ]

    def _held(self, qpos: NDArray[np.float64], joints: list[int], places: NDArray[np.float64]) -> float:
        """Return the distance between the pads when some joints are held and the rest of the hand has come to rest."""
        model = copy(self._model)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
        data = mujoco.MjData(model)
        data.qpos[:] = qpos
        inside = {model.joint(name).id for name in self.joints} - set(joints)
        still = [j for j in range(model.njnt) if j not in inside]
        dofs = np.isin(model.dof_jntid, still)
        model.dof_armature[dofs] = ARMATURE
        for _ in range(round(_HOLD / model.opt.timestep)):
            data.qpos[:] = np.where(self._of(still), qpos, data.qpos)
            data.qpos[model.jnt_qposadr[joints]] = places
            data.qvel[dofs] = 0.0
            mujoco.mj_step(model, data)
        mujoco.mj_kinematics(model, data)
        return self.distance(data)

    def _of(self, joints: list[int]) -> NDArray[np.bool_]:
        """Return which entries of ``qpos`` belong to some joints."""
        widths = np.diff(np.append(self._model.jnt_qposadr, self._model.nq))
        return np.repeat(np.isin(np.arange(self._model.njnt), joints), widths)


def _points(values: NDArray[np.float64], positions: NDArray[np.float64]) -> tuple[tuple[float, float], ...]:
    return tuple((round(value, 6), round(position, 6)) for value, position in zip(values, positions, strict=True))


def hands_of(spec: mujoco.MjSpec, model: mujoco.MjModel, pads: Pads) -> list[TactileHand]:
    """Return the hands of a model that carry pads.

    Raises:
        InvalidValueError: The robot is unstable when its actuators are driven.
    """
    grips = grips_of(spec, [Mount(name) for name in pads.names]) if model.nu else ()
    found = [TactileHand(model, pads, grip.pads, grip) for grip in grips if grip.pads]
    if not found and len(pads) > 1:
        found = [TactileHand(model, pads, range(len(pads)), None)]
    return [hand for hand in found if hand.joints]


def closing_stream(
    model: mujoco.MjModel, hands: Sequence[TactileHand], drives: Sequence[Drive], carried: Collection[str]
) -> str:
    """Return the stream that brings the pads of a hand together; without a hand, the only one that moves a pad.

    Args:
        model: The compiled model.
        hands: Its hands.
        drives: The drives.
        carried: Names of the joints that move pads.
    """
    if not hands:
        moving = {drive.stream for drive in drives if drive.joint in carried}
        return moving.pop() if len(moving) == 1 else ""
    nearer: dict[str, float] = {}
    for drive in drives:
        for hand in hands:
            if drive.joint in hand.joints:
                nearer[drive.stream] = nearer.get(drive.stream, 0.0) + hand.approach(drive.joint)
    return max(nearer, key=lambda stream: nearer[stream], default="")
