"""Poses: where the object was in its holder in each episode, which no two grasps repeat.

They are a nuisance: what differs between episodes is fitted and taken out, their mean is a cause of its own
(`object_pose`) and stays. Other causes are not fitted beside them: poses would run along the valley that both share.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.inside.responses import SPREAD
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.scene.parameters import SceneParameter

MOST = 3.0
"""Spreads by which an episode may differ from the mean."""
_REMEMBERED = 10.0  # samples that share their error: a model is wrong for longer than a frame

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
    numbers = problem.scene.of("object_pose")
    if not numbers:
        return {}
    thin = problem.thinned
    rows = thin.compared
    assert thin.scene is not None
    base = predict(thin.simulated)
    own = thin.at_compared(problem.at_thinned(episode))
    known = np.unique(own)

    def weighed(change: FloatArray) -> FloatArray:
        return rows.weigh(change).reshape(len(rows.time), -1)

    residual = weighed(rows.measured - rows.read(base))  # of a model that was found, or of the bare simulation
    columns, target = [], []
    for one in numbers:
        spread = SPREAD[one.parameter.unit]
        moved = weighed(predict(thin.simulated + thin.scene.slope(one) * spread) - base)
        for number in known:
            columns.append((moved * (own == number)[:, None]).ravel())
            target.append(-before.get(int(number), {}).get(one.parameter, 0.0) / spread)
    matrix = np.stack(columns)
    error = max(1.0, float(np.mean(residual**2))) * _REMEMBERED
    right = matrix @ residual.ravel() + error * np.array(target)
    amounts = np.linalg.solve(matrix @ matrix.T + error * np.eye(len(matrix)), right).reshape(len(numbers), -1)
    out: dict[int, dict[SceneParameter, float]] = {int(number): {} for number in known}
    for one, steps in zip(numbers, amounts, strict=True):
        item, spread = one.parameter, SPREAD[one.parameter.unit]
        poses = np.array([before.get(int(n), {}).get(item, 0.0) for n in known]) + steps * spread
        poses = np.clip(poses - poses.mean(), -MOST * spread, MOST * spread)
        for number, pose in zip(known, poses, strict=True):
            out[int(number)][item] = float(pose)
    return out
