"""Poses: the pose of the object in its holder in each episode, which no two grasps repeat.

Poses are nuisance parameters: their differences between episodes are fitted and removed, while their mean stays, as a
cause of its own (`object_pose`). Errors common to all episodes, in any number of the scene or in the gain of an axis,
are fitted together with the poses, which would otherwise absorb them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.deviations import CORRELATED_SAMPLES
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.data.responses import SPREAD
from paxisim.scene.parameters import SceneParameter

PRIOR_STEPS = 3.0  # standard deviation of the prior of a number of the scene, in steps
MAX_DEVIATION = 3.0
"""Largest deviation of an episode's pose from the mean, in units of `SPREAD`."""
ALTERNATIONS = 5  # alternations between fitting the gains and the poses

Poses = Mapping[int, Mapping[SceneParameter, float]]


def fitted_poses(
    problem: Problem,
    predict: Callable[[FloatArray], FloatArray],
    episode: NDArray[np.integer],
    before: Poses,
) -> dict[int, dict[SceneParameter, float]]:
    """Return the deviation of each episode's pose from the mean of all episodes.

    Args:
        problem: The recording, simulated with the current poses.
        predict: Function from the force simulated in the thinned frames, ``(T, pads, 3, rows, cols)`` newtons, to the
            predicted reading in the compared frames.
        episode: ``(T,)`` number of each sample's episode.
        before: Current poses.
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

    with_poses = replace(rows, scene=None)  # its residuals are not freed of the poses
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
    for one in thin.scene.each:  # errors common to all episodes are no pose errors
        if not one.parameter.by_episode:
            wide = PRIOR_STEPS * one.parameter.step
            columns.append(with_poses.weigh(predict(thin.simulated + thin.scene.slope(one) * wide) - base))
    centre += [0.0] * (len(columns) - count)
    steps = _steps(target, simulated, np.stack(columns), np.array(centre))[:count].reshape(len(numbers), -1)
    out: dict[int, dict[SceneParameter, float]] = {int(number): {} for number in known}
    for one, own_steps in zip(numbers, steps, strict=True):
        item, spread = one.parameter, SPREAD[one.parameter.unit]
        poses = np.array([before.get(int(n), {}).get(item, 0.0) for n in known]) + own_steps * spread
        poses = np.clip(poses - poses.mean(), -MAX_DEVIATION * spread, MAX_DEVIATION * spread)
        for number, pose in zip(known, poses, strict=True):
            out[int(number)][item] = float(pose)
    return out


def _steps(target: FloatArray, simulated: FloatArray, columns: FloatArray, centre: FloatArray) -> FloatArray:
    """``(columns,)`` coefficients of the columns that fit a target best, together with a free gain for each axis.

    Args:
        target: ``(T, pads, 3, rows, cols)`` measured stream.
        simulated: ``(T, pads, 3, rows, cols)`` simulated stream, to which the columns are added.
        columns: ``(columns, T, pads, 3, rows, cols)`` effects.
        centre: ``(columns,)`` prior means of the coefficients; their prior standard deviation is 1.
    """
    steps = np.zeros(len(columns))
    gram = np.einsum("ctpkij,dtpkij->kcd", columns, columns, optimize=True)
    for _ in range(ALTERNATIONS):
        fitted = simulated + np.tensordot(steps, columns, 1)
        gain = np.sum(target * fitted, (0, 1, 3, 4)) / np.maximum(np.sum(fitted**2, (0, 1, 3, 4)), 1e-12)
        left = target - gain[:, None, None] * fitted
        error = max(1.0, float(np.mean(left**2))) * CORRELATED_SAMPLES
        right = np.einsum("k,ctpkij,tpkij->c", gain, columns, target - gain[:, None, None] * simulated, optimize=True)
        steps = np.linalg.solve(np.tensordot(gain**2, gram, 1) + error * np.eye(len(steps)), right + error * centre)
    return steps
