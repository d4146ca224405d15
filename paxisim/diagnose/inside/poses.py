"""Poses: where the object was in its holder in each episode, which no two grasps repeat.

They are a nuisance: what differs between episodes is fitted and taken out, their mean is a cause of its own
(`object_pose`) and stays. Before anything is known, all causes are fitted beside them, in proportion to what they do at
their starts, as a wrong friction or a gain would move the poses, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.cause import Cause
from paxisim.diagnose.folds import effects
from paxisim.diagnose.inside.responses import SPREAD
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.scene.parameters import SceneParameter

MOST = 3.0
"""Spreads by which an episode may differ from the mean."""
_REMEMBERED = 10.0  # samples that share their error: a model is wrong for longer than a frame

Poses = Mapping[int, Mapping[SceneParameter, float]]


def fitted_poses(
    problem: Problem,
    causes: Sequence[Cause],
    predict: Callable[[FloatArray], FloatArray],
    episode: NDArray[np.integer],
    before: Poses,
) -> dict[int, dict[SceneParameter, float]]:
    """The pose of each episode, by which it differs from their mean.

    Args:
        problem: The recording, simulated with the poses as they are known so far.
        causes: What may be wrong besides, and is not in `predict`.
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
    shared = [
        weighed(thin.at_compared(effect))
        for item in causes
        if item.local is None and item.course is None and item.read is None
        for effect in effects(thin, item, thin.simulated)
    ]
    columns, held, target = [one.ravel() for one in shared], [1.0] * len(shared), [0.0] * len(shared)
    for one in numbers:
        spread = SPREAD[one.parameter.unit]
        moved = weighed(predict(thin.simulated + thin.scene.slope(one) * spread) - base)
        for number in known:
            columns.append((moved * (own == number)[:, None]).ravel())
            held.append(1.0)
            target.append(-before.get(int(number), {}).get(one.parameter, 0.0) / spread)
    matrix = np.stack(columns)
    error = max(1.0, float(np.mean(residual**2))) * _REMEMBERED
    normal = matrix @ matrix.T
    prior = np.array(held) * error
    right = matrix @ residual.ravel() + prior * np.array(target)
    amounts = np.linalg.solve(normal + np.diag(prior), right)[len(shared) :].reshape(len(numbers), -1)
    out: dict[int, dict[SceneParameter, float]] = {int(number): {} for number in known}
    for one, steps in zip(numbers, amounts, strict=True):
        item, spread = one.parameter, SPREAD[one.parameter.unit]
        poses = np.array([before.get(int(n), {}).get(item, 0.0) for n in known]) + steps * spread
        poses = np.clip(poses - poses.mean(), -MOST * spread, MOST * spread)
        for number, pose in zip(known, poses, strict=True):
            out[int(number)][item] = float(pose)
    return out
