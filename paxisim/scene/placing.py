"""Placing: where a free object stands when a hand grasps it, found from what its pads measure.

If an object stands half a millimetre off the middle of a hand, or half a degree askew, one finger touches it first and
pushes it against the friction of the table until the other one touches it too. The shear of this push stays for the
whole grasp, and tilts the object between the gels: it decides how the force is distributed over the taxels. So the
place along the closing direction and the turn about the vertical are fitted to the distribution in the first second of
each grasp. A gain of the sensor does not change the distribution, and a delay hardly does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.recording import Recording
from paxisim.scene.clocks import plain_motion
from paxisim.scene.closing import total_normal
from paxisim.scene.doubt import find_grasps, held
from paxisim.scene.drive import ObjectStart
from paxisim.scene.follow import Follower
from paxisim.scene.scene import Scene

MAX_SHIFT, MAX_TURN = 1.5e-3, np.radians(1.5)
"""Largest distance (m) from the expected place, and largest turn (rad), that are looked for."""
_COARSE, _REFINED = 7, 6  # places of a first search along one of them, and most places of a second one
_FIRST = 1.0  # s after the first contact
_LOADED = 0.3  # of the largest total normal force; less is left out


_Place = tuple[float, float]  # shift (m) and turn (rad)


@dataclass(frozen=True)
class Placed:
    """Place of an object in one grasp.

    Attributes:
        episode: Number of the episode that the grasp becomes.
        shift: Distance (m) from the expected place, along the direction into the first pad.
        turn: Angle (rad) from the expected one, about the vertical.
        before: Difference between the measured and the simulated distribution, relative to the measured one.
        after: The same with both.
    """

    episode: int
    shift: float
    turn: float
    before: float
    after: float


def place_objects(
    scene: Scene, recording: Recording, progress: Callable[[str], None] | None = None
) -> tuple[Scene, Recording, tuple[Placed, ...]]:
    """Find where the free object of a scene stands in each grasp.

    Each grasp becomes an episode, because the object is somewhere else in each. In the first grasp of an episode it is
    expected where the scene puts it, and in the others where the simulated hand has left it.

    Args:
        scene: Scene with one free object.
        recording: Recording with measured forces in newtons and the driving streams.
        progress: Callback that is called with a line of text for each grasp.

    Returns:
        The scene, in which a stream gives the object's start; the recording with that stream, and with the grasps as
        episodes; and the places.

    Raises:
        InvalidValueError: There are no measured forces in newtons, or not exactly one free object.
        UnknownNameError: See `paxisim.Scene.simulate`.
    """
    if recording.measured is None or recording.unit != "N":
        raise InvalidValueError("placing an object needs measured forces in newtons")
    follower = Follower(plain_motion(scene), recording, False)
    if len(follower.rig.free) != 1:
        raise InvalidValueError(f"placing needs a scene with one free object, got {len(follower.rig.free)}")
    (address,) = follower.rig.free
    model = follower.rig.model
    body = model.body(int(model.jnt_bodyid[follower.rig.joint_at(address)])).name
    starts = dict(follower.objects)
    numbers, poses, places = np.zeros(len(recording), int), np.zeros((len(recording), 7)), []
    for part in recording.episodes():
        at = np.flatnonzero(recording.episode == part.episode[0])
        known = follower.known(part)
        moving = part[known]
        assert moving.measured is not None
        expected = starts[address][int(part.episode[0])] if address in starts else follower.rig.qpos[address:][:7]
        for span in find_grasps(moving.time, moving.measured):
            if progress is not None:
                progress(f"placing {body}, grasp {len(places) + 1}")
            grasp = _Grasp(follower, moving, span, address, expected)
            place, before, after = grasp.fitted()
            own = at[np.flatnonzero(known)[span][0] if span.start else 0 :]
            numbers[own], poses[own] = len(places), grasp.pose(place)
            places.append(Placed(len(places), *place, before, after))
            expected = grasp.left(place)
    stream = f"{body}_start"
    others = tuple(start for start in scene.start if start.body != body)
    placed = replace(recording, episode=numbers, covariates={**recording.covariates, stream: poses})
    return replace(scene, start=(*others, ObjectStart(body, stream=stream))), placed, tuple(places)


class _Grasp:
    """One grasp, simulated on its own with the object at several places."""

    def __init__(
        self, follower: Follower, episode: Recording, span: slice, address: int, expected: NDArray[np.float64]
    ) -> None:
        self._follower, self._part, self._address, self._expected = follower, episode[span], address, expected
        gravity = follower.rig.model.opt.gravity
        self._up = -gravity / max(float(np.linalg.norm(gravity)), 1e-9) if gravity.any() else np.array([0.0, 0.0, 1.0])
        self._into = follower.runner.into_first_pad(follower.motion(self._part), float(self._part.time[0]))
        assert self._part.measured is not None
        total = total_normal(self._part.measured)
        touched = float(total.max(initial=0.0)) > 0
        begin = held(self._part.time, self._part.measured)[0]
        early = self._part.time <= begin + _FIRST
        self._early = self._part[early] if touched and early.sum() > 1 else None

    def pose(self, place: _Place) -> NDArray[np.float64]:
        """Return the pose of the object ``(7,)`` at the start, at a place."""
        shift, turn = place
        turned, about = np.zeros(4), np.zeros(4)
        mujoco.mju_axisAngle2Quat(about, self._up, turn)
        mujoco.mju_mulQuat(turned, about, self._expected[3:])
        return np.concatenate([self._expected[:3] + shift * self._into, turned])

    def fitted(self) -> tuple[_Place, float, float]:
        """Return the place, and the difference of the distributions where it is expected and there."""
        if self._early is None:
            return (0.0, 0.0), float("nan"), float("nan")
        shift, _ = _least(lambda shift: self._unlike((shift, 0.0)), MAX_SHIFT)
        turn, _ = _least(lambda turn: self._unlike((shift, turn)), MAX_TURN)
        shift, after = _least(lambda shift: self._unlike((shift, turn)), MAX_SHIFT)
        before = self._unlike((0.0, 0.0))
        return ((shift, turn), before, after) if after < before else ((0.0, 0.0), before, before)

    def left(self, place: _Place) -> NDArray[np.float64]:
        """Return the pose of the object ``(7,)`` at the end of the grasp."""
        self._simulated(self._part, place)
        return self._follower.runner.qpos[self._address :][:7]

    def _simulated(self, part: Recording, place: _Place) -> NDArray[np.float32]:
        return self._follower.forces(part, objects=((self._address, self.pose(place)),))

    def _unlike(self, place: _Place) -> float:
        """Return the difference of the distributions of force, relative to the measured one; infinite if none touch."""
        assert self._early is not None
        assert self._early.measured is not None
        measured, simulated = self._early.measured.astype(float), self._simulated(self._early, place).astype(float)
        totals = [total_normal(stream) for stream in (measured, simulated)]
        both = np.logical_and(*(total > _LOADED * max(float(total.max()), 1e-9) for total in totals))
        if not both.any():
            return float("inf")
        ours, theirs = (
            stream[both] / total[both][:, None, None, None, None]
            for stream, total in zip((measured, simulated), totals, strict=True)
        )
        return float(np.linalg.norm(ours - theirs) / np.linalg.norm(ours))


def _least(function: Callable[[float], float], most: float) -> tuple[float, float]:
    """Return where a function is least between ``-most`` and ``most``, and its value there."""
    from scipy.optimize import minimize_scalar

    grid = np.linspace(-most, most, _COARSE).tolist()
    values = [function(at) for at in grid]
    best = int(np.argmin(values))
    ends = grid[max(best - 1, 0)], grid[min(best + 1, _COARSE - 1)]
    found: Any = minimize_scalar(function, bounds=ends, method="bounded", options={"maxiter": _REFINED})
    return (float(found.x), float(found.fun)) if found.fun < values[best] else (grid[best], values[best])
