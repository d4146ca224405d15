"""Poses: where the object was in its holder in each episode, which no two grasps repeat.

They are a nuisance: what differs between episodes is fitted and taken out, their mean is a cause of its own
(`object_pose`) and stays. What is wrong in all episodes alike, with any number of the scene or the gain of an axis, is
fitted beside them, or they would bend to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.inside.deviations import REMEMBERED
from paxisim.diagnose.inside.responses import SPREAD
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.scene.parameters import SceneParameter

WIDE = 3.0  # steps, the standard deviation of a number of the scene
MOST = 3.0
"""Spreads by which an episode may differ from the mean."""
TURNS = 5  # of poses and gains

Poses = Mapping[int, Mapping[SceneParameter, float]]


def fitted_poses(
    problem: Problem,
    predict: Callable[[FloatArray], FloatArray],
    episode: NDArray[np.integer],
    before: Poses,
) -> dict[int, dict[SceneParameter, float]]:
    """The pose of each episode, by which it differs from their mean.

    Args:
        problem: The recording, simulated with the poses as they are known so far.
        predict: From ``(T, pads, 3, rows, cols)`` newtons that are simulated in the thinned frames, to what is read in
            the compared ones.
        episode: ``(T,)`` the number of the episode of each sample.
        before: The poses so far.
    """
    assert problem.scene is not None
    numbers = problem.scene.poses
    if not numbers:
        return {}
    thin = problem.thinned
    rows = thin.compared
    assert thin.scene is not None
    base = predict(thin.simulated)
    own = thin.at_compared(problem.at_thinned(episode))
    known = np.unique(own)

    with_poses = replace(rows, scene=None)  # a residual that still has them
    target = with_poses.weigh(rows.measured - rows.read(base) + base)
    simulated = with_poses.weigh(base)
    columns, centre = [], []
    for one in numbers:
        spread = SPREAD[one.parameter.unit]
        moved = with_poses.weigh(predict(thin.simulated + thin.scene.slope(one) * spread) - base)
        for number in known:
            columns.append(np.where(np.reshape(own == number, (-1, 1, 1, 1, 1)), moved, 0.0))
            centre.append(-before.get(int(number), {}).get(one.parameter, 0.0) / spread)
    count = len(columns)
    for one in thin.scene.each:  # what is wrong in all episodes is no pose
        if one.parameter.group != "object_pose":
            wide = WIDE * one.parameter.step
            columns.append(with_poses.weigh(predict(thin.simulated + thin.scene.slope(one) * wide) - base))
    centre += [0.0] * (len(columns) - count)
    steps = _steps(target, simulated, np.stack(columns), np.array(centre))[:count].reshape(len(numbers), -1)
    out: dict[int, dict[SceneParameter, float]] = {int(number): {} for number in known}
    for one, own_steps in zip(numbers, steps, strict=True):
        item, spread = one.parameter, SPREAD[one.parameter.unit]
        poses = np.array([before.get(int(n), {}).get(item, 0.0) for n in known]) + own_steps * spread
        poses = np.clip(poses - poses.mean(), -MOST * spread, MOST * spread)
        for number, pose in zip(known, poses, strict=True):
            out[int(number)][item] = float(pose)
    return out


def _steps(target: FloatArray, simulated: FloatArray, columns: FloatArray, centre: FloatArray) -> FloatArray:
    """``(columns,)`` shares of columns that explain a target best, beside a gain for each axis that is nobody's pose.

    Args:
        target: ``(T, pads, 3, rows, cols)`` what is measured.
        simulated: The same, to which the columns are added.
        columns: ``(columns, T, pads, 3, rows, cols)``.
        centre: ``(columns,)`` where shares are expected, with a standard deviation of 1.
    """
    steps = np.zeros(len(columns))
    gram = np.einsum("ctpkij,dtpkij->kcd", columns, columns, optimize=True)
    for _ in range(TURNS):
        fitted = simulated + np.tensordot(steps, columns, 1)
        gain = np.sum(target * fitted, (0, 1, 3, 4)) / np.maximum(np.sum(fitted**2, (0, 1, 3, 4)), 1e-12)
        left = target - gain[:, None, None] * fitted
        error = max(1.0, float(np.mean(left**2))) * REMEMBERED
        right = np.einsum("k,ctpkij,tpkij->c", gain, columns, target - gain[:, None, None] * simulated, optimize=True)
        steps = np.linalg.solve(np.tensordot(gain**2, gram, 1) + error * np.eye(len(steps)), right + error * centre)
    return steps
