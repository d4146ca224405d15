"""Arms: where a robot stands, and how its hand is mounted on its arm (hand-eye), both known to a millimetre at best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from paxisim.models.links import bodies_above, common_body
from paxisim.models.pads import Pads


@dataclass(frozen=True)
class Arm:
    """An arm with a hand.

    Attributes:
        base: Name of the body that stands in the world.
        hand: Name of the lowest body that carries all pads of the hand.
    """

    base: str
    hand: str


def arms_of(model: mujoco.MjModel, pads: Pads) -> tuple[Arm, ...]:
    """Return the arms whose joints carry a hand with two or more pads; bodies without a name cannot be moved."""
    trees: dict[int, list[int]] = {}
    for pad in pads.bodies:
        trees.setdefault(int(model.body_rootid[pad]), []).append(int(pad))
    found = []
    for base, own in trees.items():
        hand = common_body(model, own)
        joints = [model.body_jntnum[body] for body in (hand, *bodies_above(model, hand))]
        free = model.body_dofnum[base] == 6
        if len(own) > 1 and hand != base and any(joints) and not free:
            found.append(Arm(model.body(base).name, model.body(hand).name))
    return tuple(arm for arm in found if arm.base and arm.hand)


def displace(spec: mujoco.MjSpec, model: mujoco.MjModel, name: str, pose: Sequence[float], pads: Sequence[int]) -> None:
    """Move a body with all that it carries, and rotate it about the middle of its pads at the model's start.

    A rotation about the middle of the pads hardly moves them, so the six numbers have separate effects.

    Args:
        spec: The spec to change.
        model: The model compiled from it.
        name: Name of the body.
        pose: Displacement along the axes of the body's parent (m), and rotation vector in these axes (rad).
        pads: Ids of the bodies of the pads that it carries.
    """
    data, body = mujoco.MjData(model), model.body(name).id
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    parent = int(model.body_parentid[body])
    back = data.xmat[parent].reshape(3, 3).T
    middle = back @ (data.xpos[list(pads)].mean(axis=0) - data.xpos[parent])
    turn = Rotation.from_rotvec(pose[3:])
    place = middle + turn.apply(model.body_pos[body] - middle) + np.asarray(pose[:3])
    turned = turn * Rotation.from_quat(model.body_quat[body], scalar_first=True)
    _set_pose(spec.body(name), place, turned)


def _set_pose(body: mujoco.MjsBody, place: NDArray[np.float64], turn: Rotation) -> None:
    """Set the pose of a body in its parent; that of the spec is relative to the frames around it."""
    frames, frame = [], body.frame
    while frame is not None:
        frames, frame = [frame, *frames], frame.frame
    for around in frames:
        back = Rotation.from_quat(around.quat, scalar_first=True).inv()
        place, turn = back.apply(place - around.pos), back * turn
    body.pos = place
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    body.quat = turn.as_quat(scalar_first=True)
