"""Ceiling: how much of the error a black-box model explains on the same held-out episodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.errors import MissingExtraError
from paxisim.parallel import parallel_map

MAX_TAXELS = 12  # taxels per axis
MAX_ROWS = 12_000  # training samples per axis
MAX_FRAMES = 4000  # most frames that are evaluated
LAGS = (1, 2, 4, 8)  # frames
FOLDS = 4


def ceiling(problem: Problem, simulated: FloatArray, seed: int, jobs: int = 1) -> tuple[FloatArray | None, str]:
    """``(episodes,)`` squared error (N^2) of gradient boosting on the simulation and its past.

    For each axis, the model predicts the difference between measurement and simulation from the present and past force
    on the taxel, the total force on the pad, the time and the covariates. To run within seconds it uses the most loaded
    taxels and a subset of the frames; the error of the other taxels is assumed to decrease by the same factor.

    Args:
        problem: The recording.
        simulated: ``(T, pads, 3, rows, cols)`` newtons, the simulation.
        seed: Random seed of the boosting and of the subset.
        jobs: Number of threads.

    Returns:
        The error and an empty string; or None and the reason, if scikit-learn is not installed.
    """
    try:
        import sklearn.ensemble  # noqa: F401
        import threadpoolctl  # noqa: F401  # comes with scikit-learn
    except ImportError:
        return None, f"{MissingExtraError('scikit-learn', 'diagnose', 'the black-box ceiling')}."
    difference = problem.measured - simulated
    inputs, (pad, row, col) = _inputs(problem, simulated)
    after = np.zeros(len(problem.episodes))
    for axis in range(3):
        own, alive = difference[:, :, axis], problem.alive[:, axis]
        before = np.array([np.sum(own[span] ** 2, where=alive) for span in problem.episodes])
        used = alive[pad, row, col]
        if used.any():
            before *= _left(problem, inputs[used], own[:, pad, row, col].T[used], seed, jobs)
        after += before
    return after, ""


def _left(problem: Problem, inputs: FloatArray, wanted: FloatArray, seed: int, jobs: int) -> FloatArray:
    """``(episodes,)`` held-out squared error as a share of the energy of `wanted` ``(C, T)``."""
    from sklearn.ensemble import HistGradientBoostingRegressor
    from threadpoolctl import ThreadpoolController

    count = len(problem.episodes)
    episode = np.repeat(np.arange(count), [span.stop - span.start for span in problem.episodes])
    judged = np.arange(len(episode)) % max(1, len(episode) // MAX_FRAMES) == 0
    left = np.ones(count)
    controller = ThreadpoolController()

    def judge(fold: NDArray[np.intp]) -> None:
        train = ~np.isin(episode, fold) if count > 1 else np.ones(len(episode), dtype=bool)
        x, y = inputs[:, train].reshape(-1, inputs.shape[-1]), wanted[:, train].ravel()
        pick = np.random.default_rng((seed, fold[0])).choice(len(y), min(len(y), MAX_ROWS), replace=False)
        model = HistGradientBoostingRegressor(max_iter=60, max_leaf_nodes=24, min_samples_leaf=40, random_state=seed)
        # the boosting's own threads synchronise so often that it takes minutes on a busy machine
        with controller.limit(limits=1, user_api="openmp"):
            model.fit(x[pick], y[pick])
            for number in fold:
                here = judged & (episode == number)
                true = wanted[:, here]
                guess = model.predict(inputs[:, here].reshape(-1, inputs.shape[-1])).reshape(true.shape)
                if true.any():  # without an error on these taxels, the factor is undefined
                    left[number] = np.sum((true - guess) ** 2) / np.sum(true**2)

    parallel_map(judge, np.array_split(np.arange(count), min(FOLDS, count)), jobs)
    return left


def _inputs(problem: Problem, x: FloatArray) -> tuple[FloatArray, tuple[NDArray[np.intp], ...]]:
    """``(C, T, D)`` features of the most loaded taxels, and their pads, rows and columns."""
    load = np.sqrt(np.mean(x**2, axis=(0, 2)))
    order = np.argsort(load.ravel())[::-1][:MAX_TAXELS]
    pad, row, col = np.unravel_index(order, load.shape)
    own = x[:, pad, :, row, col]  # (C, T, 3): the indexed axes come first
    start = np.concatenate([np.full(span.stop - span.start, span.start) for span in problem.episodes])
    past = [own[:, np.maximum(np.arange(len(start)) - lag, start)] for lag in LAGS]
    total = np.moveaxis(x.sum(axis=(3, 4)), 0, 1)[pad]  # on the pad
    alike = [problem.time - problem.time[0], *problem.covariates.values()]
    columns = [*(values[None, :] for values in alike), np.arange(len(order), dtype=float)[:, None]]
    others = [np.broadcast_to(values, own.shape[:2])[..., None] for values in columns]
    return np.concatenate([own, *past, total, *others], axis=-1), (pad, row, col)
