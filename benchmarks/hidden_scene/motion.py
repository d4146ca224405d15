"""Commands of the stage: presses, holds and slides at several places, at another turn in each episode."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hidden_scene.bench import TIMESTEP

EPISODES = 8
SECONDS = 6.0
TURNS = np.radians([0, 90, 45, -45, 180, 0, 90, -90])


def episodes(rng: np.random.Generator, by_force: bool, count: int = EPISODES) -> list[NDArray[np.float64]]:
    """Return the commands of each episode, ``(steps, 4)``: x, y (m), turn (rad), and depth (m) or closing force (N)."""
    return [_episode(rng, turn, by_force) for turn in np.resize(TURNS, count)]


def _episode(rng: np.random.Generator, turn: float, by_force: bool) -> NDArray[np.float64]:
    time = np.arange(round(SECONDS / TIMESTEP)) * TIMESTEP
    place, way = rng.uniform(-3e-3, 3e-3, 2), rng.choice([-1, 1], 2) * rng.uniform(1.5e-3, 3e-3, 2)
    first, second = np.sort(rng.uniform(0.5, 1.0, 2)) + (0.0, 0.2)
    knots = [0.0, 0.2, 0.8, 1.1, 1.8, 2.1, 2.6, 2.9, 3.6, 3.9, 4.6, 4.8, 5.5, 6.0]
    press = [0, 0, first, first, first, first, second, second, second, second, 0.6 * second, 0.6 * second, 0, 0]
    x = [0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 0.3, 0.3, 0.3, 0.3]
    y = [0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1]
    depth = _path(time, knots, press)
    closing = 9.0 * depth - 0.5 if by_force else -0.5e-3 + 1.5e-3 * depth
    return np.column_stack(
        [
            place[0] + way[0] * _path(time, knots, x),
            place[1] + way[1] * _path(time, knots, y),
            np.full(len(time), turn),
            closing,
        ]
    )


def _path(time, knots, values) -> NDArray[np.float64]:
    """Minimum-jerk moves from value to value."""
    knots, values = np.asarray(knots), np.asarray(values, dtype=float)
    k = np.clip(np.searchsorted(knots, time, side="right") - 1, 0, len(knots) - 2)
    u = np.clip((time - knots[k]) / (knots[k + 1] - knots[k]), 0, 1)
    return values[k] + u**3 * (10 - 15 * u + 6 * u**2) * (values[k + 1] - values[k])
