"""Flexion: which way each actuator of a hand closes it.

An actuator of a finger with several joints closes it in the sense in which the finger bends: a straight finger gets
shorter the further it is bent, and it bends further one way than the other. The other actuators close the hand towards
the end of their range at which its links are nearer to one another. An actuator that does neither is held in the
middle of its range, as one that only spreads fingers.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from paxisim.models.closing import Drive, Stroke
from paxisim.models.links import Links

_SIDEWAYS = 0.05  # an actuator with a smaller |cosine| between motion and approach neither opens nor closes
_PARALLEL = 0.8  # cosine between the axes of joints that bend a finger the same way
_ABOUT = 0.6  # an actuator flexes a tip if it turns it about the tip's hinge, to this cosine
_BENDS = 0.2  # a finger bends one way if its joints reach this share (of their range) further to one side
_SHORTENS = 0.95  # only joints that shorten the finger to this share of its length count
_ANGLES = 61


@dataclass(frozen=True, eq=False)
class Closing:
    """What the actuators of a hand do.

    Attributes:
        open_ctrl: ``(n,)`` values of the hand's actuators that open it.
        close_ctrl: ``(n,)`` values that close it; equal to `open_ctrl` for an actuator that does neither.
        spreads: ``(n,)`` True for an actuator that only spreads fingers.
        flexes: For the tip of each finger with several joints, the sense in which it flexes about its hinge, 1 or -1.
    """

    open_ctrl: NDArray[np.float64]
    close_ctrl: NDArray[np.float64]
    spreads: NDArray[np.bool_]
    flexes: dict[int, int]


def closing_of(
    links: Links, drive: Drive, palm: int, leaves: list[int], members: list[int], jaw: bool = False
) -> Closing:
    """Find out what each actuator of a hand does, by driving it to both ends while the others stay in the middle.

    Args:
        links: The robot at rest.
        drive: Drives the hand.
        palm: The link that carries the fingers.
        leaves: The last link of each finger.
        members: All links of the fingers that have collision geoms.
        jaw: The only finger closes on the palm.
    """
    flexes = {leaf: sense for leaf in leaves if (sense := _sense_of_flexion(links, palm, leaf))}
    middle = (drive.low + drive.high) / 2
    rest = drive.reach(middle)
    chain = members if palm not in links.geoms else [palm, *members]
    count = len(drive.actuators)
    signs, spreads = np.zeros(count), np.zeros(count, dtype=bool)
    turned = np.zeros((count, len(leaves)))  # cosine between the turn of a leaf and its hinge; nan: does not turn
    for a in range(count):
        ends = []
        for end in (drive.low[a], drive.high[a]):
            values = middle.copy()
            values[a] = end
            ends.append(drive.reach(values))
        turned[a] = [_turn(links, rest, ends, leaf) for leaf in leaves]
        bent = [turned[a, i] * flexes[leaf] for i, leaf in enumerate(leaves) if leaf in flexes]
        bent = [cosine for cosine in bent if np.isfinite(cosine)]
        if jaw:
            apart = [links.jaw_gap(leaves[0], palm, end.pos[0], end.rot[0]) for end in ends]
            signs[a] = np.sign(apart[0] - apart[1])
        elif bent:
            mean = float(np.mean(bent))
            signs[a] = np.sign(mean) if abs(mean) > _ABOUT else 0.0
            spreads[a] = abs(mean) <= _ABOUT
        else:
            score = _approach(links, palm, chain, ends[0], ends[1], rest)
            signs[a] = np.sign(score) if abs(score) >= _SIDEWAYS else 0.0
    # where one actuator flexes a tip about its hinge, another that turns it across the hinge only spreads
    about = np.abs(turned) > _ABOUT
    across = np.abs(turned) < 1 - _ABOUT
    for a in range(count):
        if any(across[a, i] and about[:, i].any() for i in range(len(leaves))) and not about[a].any():
            signs[a], spreads[a] = 0.0, True
    low, high = drive.low, drive.high
    return Closing(
        np.where(signs > 0, low, np.where(signs < 0, high, middle)),
        np.where(signs > 0, high, np.where(signs < 0, low, middle)),
        spreads,
        flexes,
    )


def _sense_of_flexion(links: Links, palm: int, leaf: int) -> int:
    """Return the sense in which a finger with several driven joints bends its tip about the tip's hinge, else 0."""
    model, data = links.model, links.data
    own = [k for k in (leaf, *links.ancestors(leaf)) if palm in links.ancestors(k)]
    hinge = int(mujoco.mjtJoint.mjJNT_HINGE)
    joints = [j for k in reversed(own) for j in links.joints(k) if int(model.jnt_type[j]) == hinge]
    if not joints:
        return 0
    last = data.xaxis[joints[-1]]
    parallel = [j for j in joints if abs(float(data.xaxis[j] @ last)) > _PARALLEL]
    drivers = [set(np.flatnonzero(links.drives[:, dof])) for dof in model.jnt_dofadr[parallel]]
    if len(set().union(*drivers)) < 2:
        return 0
    tip = data.geom_xpos[list(links.geoms[leaf])]
    further = 0.0
    for before, joint in pairwise(joints):
        low, high = model.jnt_range[joint]
        if joint not in parallel or not model.jnt_limited[joint] or high - low < 1e-6:
            continue
        angles = np.linspace(low, high, _ANGLES) - data.qpos[model.jnt_qposadr[joint]]
        turns = Rotation.from_rotvec(angles[:, None] * data.xaxis[joint]).as_matrix()
        moved = np.einsum("aij,gj->agi", turns, tip - data.xanchor[joint]) + data.xanchor[joint]
        length = np.linalg.norm(moved - data.xanchor[before], axis=2).mean(axis=1)
        if length.min() < _SHORTENS * length.max():
            straight = float(length.argmax()) / (_ANGLES - 1)
            further += float(np.sign(data.xaxis[joint] @ last)) * (1 - 2 * straight)
    return int(np.sign(further)) if abs(further) > _BENDS else 0


def _turn(links: Links, rest: Stroke, ends: list[Stroke], leaf: int) -> float:
    """Return the cosine between a leaf's turn from one end to the other and its hinge, or nan if it does not turn."""
    hinge = links.hinge(leaf)
    if hinge is None:
        return np.nan
    low, high = (Rotation.from_matrix(rest.rot[0, leaf].T @ end.rot[0, leaf]).as_rotvec() for end in ends)
    turn = high - low
    length = float(np.linalg.norm(turn))
    return float(turn @ hinge[1]) / length if length > 0.02 else np.nan


def _approach(links: Links, palm: int, members: list[int], start: Stroke, end: Stroke, rest: Stroke) -> float:
    """Return the mean cosine between the links' motion from `start` to `end` and the direction to other links.

    The mean is over all pairs of links of different fingers, weighted by their relative motion and by the inverse of
    their distance. A value of 1 means that all pairs approach each other, -1 that all separate.
    """

    def centres(pose: Stroke) -> NDArray[np.float64]:
        return np.stack([pose.geoms[0, list(links.geoms[k])].mean(axis=0) for k in members])

    first, last, still = centres(start), centres(end), centres(rest)
    moved = np.linalg.norm(last - first, axis=1) > 1e-6
    centre = np.where(moved[:, None], (first + last) / 2, still)
    ancestors = [set(links.ancestors(k)) for k in members]
    total = weight = 0.0
    for i, a in enumerate(members):
        for j in range(i + 1, len(members)):
            b = members[j]
            if (a != palm and a in ancestors[j]) or (b != palm and b in ancestors[i]):
                continue
            motion = (last[i] - first[i]) - (last[j] - first[j])
            gap = centre[j] - centre[i]
            distance = float(np.linalg.norm(gap))
            if distance > 1e-9:
                total += float(motion @ gap) / distance**2
                weight += float(np.linalg.norm(motion)) / distance
    return total / weight if weight > 1e-9 else 0.0
