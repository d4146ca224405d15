"""Closing: find out how a gripper's actuators close it, by driving them.

The gripper is simulated as it is, with its tendons, equalities and springs, but without gravity and contacts.
Each actuator is driven to both ends of its range while the others stay in the middle; it closes towards the end at
which the links are nearer to one another. Then all actuators close together, and the poses on the way are kept.

Units: metres, seconds; controls in the actuator's own units. The result is deterministic.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError

_LONGEST = 6.0  # s; longer strokes are cut off
_LOOK = 4e-3  # s between two samples of the pose
_FRAMES = 40
_SIDEWAYS = 0.05  # an actuator with a smaller |cosine| between motion and approach neither opens nor closes


@dataclass(frozen=True, eq=False)
class Stroke:
    """Motion of a gripper from open to closed.

    Attributes:
        actuators: Names of the actuators.
        open_ctrl: ``(nu,)`` controls that open the gripper.
        close_ctrl: ``(nu,)`` controls that close it; equal to `open_ctrl` for an actuator that does neither.
        score: ``(nu,)`` mean cosine between the motion of the links an actuator moves and the direction to the others.
        spread: ``(nu,)`` True for an actuator that only spreads fingers sideways; it stays in the middle.
        qpos: ``(frames, nq)`` poses, open first.
        pos: ``(frames, nbody, 3)`` body positions.
        rot: ``(frames, nbody, 3, 3)`` body orientations.
    """

    actuators: tuple[str, ...]
    open_ctrl: NDArray[np.float64]
    close_ctrl: NDArray[np.float64]
    score: NDArray[np.float64]
    spread: NDArray[np.bool_]
    qpos: NDArray[np.float64]
    pos: NDArray[np.float64]
    rot: NDArray[np.float64]

    @property
    def summary(self) -> str:
        """Controls of each actuator, in one line."""
        ends = zip(self.actuators, self.open_ctrl, self.close_ctrl, strict=True)
        return ", ".join(f"{n} {f'held at {b:.4g}' if a == b else f'{a:.4g} to {b:.4g}'}" for n, a, b in ends)


def collision_geoms(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Return the ids of the geoms that can collide, whose contype or conaffinity is not zero."""
    return np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))


def links_of(model: mujoco.MjModel) -> dict[int, tuple[int, ...]]:
    """Map the body id of each link with collision geoms to their geom ids; link 0 is everything that cannot move.

    A link is a body together with the bodies welded to it; its body id is MuJoCo's ``body_weldid``.
    """
    links: dict[int, list[int]] = {}
    for geom in collision_geoms(model):
        links.setdefault(int(model.body_weldid[model.geom_bodyid[geom]]), []).append(int(geom))
    return {link: tuple(links[link]) for link in sorted(links)}


def ancestors(model: mujoco.MjModel, link: int) -> tuple[int, ...]:
    """Return the links between `link` and the world, nearest first, including the world (0)."""
    chain: list[int] = []
    while link:
        link = int(model.body_weldid[model.body_parentid[link]])
        chain.append(link)
    return tuple(chain)


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


def close_gripper(model: mujoco.MjModel) -> Stroke:
    """Find out in which direction each actuator closes, then close all of them.

    Args:
        model: Compiled model of the gripper alone; gravity and contacts are disabled in its option flags.

    Returns:
        The stroke.

    Raises:
        InvalidValueError: There is no actuator, or the simulation is unstable.
    """
    if not model.nu:
        raise InvalidValueError("the gripper has no actuators, so nothing closes: give its mounts by hand")
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    low, high = control_range(model).T
    middle = (low + high) / 2
    rest = _centres(model, _drive(model, middle))
    scores, motions = np.zeros(model.nu), []
    for a in range(model.nu):
        poses = []
        for end in (low[a], high[a]):
            ctrl = middle.copy()
            ctrl[a] = end
            poses.append(_centres(model, _drive(model, ctrl)))
        scores[a] = _approach(model, poses[0], poses[1], rest)
        motions.append(poses[1] - poses[0])
    spread = _spreads(np.stack(motions))
    closes = (np.abs(scores) >= _SIDEWAYS) & ~spread
    close_ctrl = np.where(closes, np.where(scores > 0, high, low), middle)
    open_ctrl = np.where(closes, np.where(scores > 0, low, high), middle)
    data = _drive(model, open_ctrl)
    frames = [_frame(data)]
    data.time = 0.0
    _drive(model, close_ctrl, data, frames)
    frames = [frames[i] for i in _evenly(np.stack([f[3] for f in frames]))]
    names = tuple(model.actuator(a).name or f"actuator {a}" for a in range(model.nu))
    qpos, pos, rot, _ = (np.stack(part) for part in zip(*frames, strict=True))
    return Stroke(names, open_ctrl, close_ctrl, scores, spread, qpos, pos, rot)


def _drive(
    model: mujoco.MjModel,
    ctrl: NDArray[np.float64],
    start: mujoco.MjData | None = None,
    frames: list[tuple[NDArray[np.float64], ...]] | None = None,
) -> mujoco.MjData:
    """Simulate with constant controls until nothing moves; append the poses to `frames` if given."""
    data: mujoco.MjData = mujoco.MjData(model) if start is None else start
    data.ctrl[:] = ctrl
    every = max(1, round(_LOOK / model.opt.timestep))
    before, fastest, quiet = data.qpos.copy(), 0.0, 0
    while data.time < _LONGEST and quiet < 20:
        mujoco.mj_step(model, data, every)
        if not np.all(np.isfinite(data.qpos)) or data.warning[int(mujoco.mjtWarning.mjWARN_BADQACC)].number:
            raise InvalidValueError("the gripper is unstable when its actuators are driven: check its timestep")
        speed = float(np.abs(data.qpos - before).max(initial=0.0))
        before, fastest = data.qpos.copy(), max(fastest, speed)
        quiet = quiet + 1 if speed <= 1e-3 * fastest else 0
        if frames is not None:
            mujoco.mj_kinematics(model, data)
            frames.append(_frame(data))
    mujoco.mj_kinematics(model, data)
    return data


def _frame(data: mujoco.MjData) -> tuple[NDArray[np.float64], ...]:
    return data.qpos.copy(), data.xpos.copy(), data.xmat.reshape(-1, 3, 3).copy(), data.geom_xpos.copy()


def _evenly(geoms: NDArray[np.float64]) -> Sequence[int]:
    """Return the indices of about `_FRAMES` frames with equal motion between them, the last frame included."""
    travel = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(geoms, axis=0), axis=-1).max(axis=1, initial=0.0)))
    wanted = np.linspace(0, travel[-1], _FRAMES)
    return [int(i) for i in np.unique(np.append(np.searchsorted(travel, wanted - 1e-12), len(travel) - 1))]


def _centres(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.float64]:
    """Return the mean position of each link's collision geoms, ``(links, 3)``, in the order of `links_of`."""
    return np.stack([data.geom_xpos[list(geoms)].mean(axis=0) for geoms in links_of(model).values()])


def _approach(
    model: mujoco.MjModel,
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    rest: NDArray[np.float64],
) -> float:
    """Return the mean cosine between the links' motion from `start` to `end` and the direction to other links.

    The mean is over all pairs of links of different fingers, weighted by their relative motion and by the inverse of
    their distance. A value of 1 means that all pairs approach each other, -1 that all separate.
    """
    moved = np.linalg.norm(end - start, axis=1) > 1e-6
    centre = np.where(moved[:, None], (start + end) / 2, rest)
    links = list(links_of(model))
    total = weight = 0.0
    for i, a in enumerate(links):
        for j in range(i + 1, len(links)):
            b = links[j]
            if (a and a in ancestors(model, b)) or (b and b in ancestors(model, a)):
                continue
            motion = (end[i] - start[i]) - (end[j] - start[j])
            gap = centre[j] - centre[i]
            distance = float(np.linalg.norm(gap))
            if distance > 1e-9:
                total += float(motion @ gap) / distance**2
                weight += float(np.linalg.norm(motion)) / distance
    return total / weight if weight > 1e-9 else 0.0


def _spreads(motions: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which actuators only spread fingers sideways.

    Other actuators move the link that such an actuator moves most more than twice as far, and all of them move it in a
    transverse direction.

    Args:
        motions: ``(nu, links, 3)`` displacement of each link by each actuator.
    """
    length = np.linalg.norm(motions, axis=-1)
    spread = np.zeros(len(motions), dtype=bool)
    for a, link in enumerate(length.argmax(axis=1)):
        cosine = np.abs(motions[:, link] @ motions[a, link]) / np.maximum(length[:, link] * length[a, link], 1e-12)
        larger = length[:, link] > 2 * length[a, link]
        spread[a] = bool(larger.any() and np.all(cosine[larger] < 0.5))
    return spread
