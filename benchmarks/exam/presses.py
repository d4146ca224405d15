"""Parts of a motion: how the force rises and falls, and how the object moves meanwhile.

A press is ``press(rng, steps) -> (S,)`` from 0 over about 1 back to 0; a move is ``move(rng, steps, room)`` with
``room`` the half width of the pad along x and y (mm), and returns the place ``(S, 2)`` (mm), the tangential travel
``(S, 2)`` (mm) and the spin ``(S,)`` (rad), all at `FINE` samples per second.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Array = NDArray[Any]  # of float64
Move = Callable[[Generator, int, Array], tuple[Array, Array, Array]]

FINE = 500  # Hz, rate at which forces and effects are computed
EDGE = 0.12  # s without force at both ends of a press, so that rounding keeps them at 0


def pieces(steps: int, times: list[float], values: list[float]) -> Array:
    """Return straight lines through `values` at `times` (s), as ``(S,)`` samples at `FINE`."""
    return np.interp(np.arange(steps) / FINE, times, values)


def rounded(values: Array, seconds: float) -> Array:
    """Return ``(S, ...)`` values smoothed by a Hann window of that length; the ends are held."""
    width = max(3, round(seconds * FINE)) | 1
    window = np.hanning(width + 2)[1:-1]
    padded = np.pad(values, [(width // 2, width // 2)] + [(0, 0)] * (values.ndim - 1), mode="edge")
    return np.apply_along_axis(np.convolve, 0, padded, window / window.sum(), mode="valid")


def staircase(rng: Generator, steps: int) -> Array:
    """Go up in steps with holds, and down in others."""
    up = np.sort(rng.uniform(0.15, 0.9, 2)).tolist()
    levels = [0, *up, 1.0, float(rng.uniform(0.2, 0.8)), 0]
    edges = np.linspace(EDGE, steps / FINE - EDGE, 2 * len(levels) - 2)
    values = [levels[(i + 1) // 2] for i in range(len(edges))]
    return rounded(pieces(steps, edges.tolist(), values), 0.1)


def taps(rng: Generator, steps: int) -> Array:
    """Tap three to six times, quickly and with other forces."""
    count = int(rng.integers(3, 7))
    starts = np.linspace(EDGE, steps / FINE - EDGE, count + 1)
    force = np.zeros(steps)
    for start, end in pairwise(starts):
        width = float(rng.uniform(0.3, 0.8)) * (end - start)
        force += float(rng.uniform(0.4, 1)) * pieces(steps, [start, start + 0.3 * width, start + width], [0, 1, 0])
    return rounded(force, 0.06)


def triangles(rng: Generator, steps: int) -> Array:
    """Rise and fall three times with three speeds, without returning to zero in between."""
    share = np.array([0.55, 0.3, 0.15])[rng.permutation(3)]
    edges = EDGE + (steps / FINE - 2 * EDGE) * np.r_[0, np.cumsum(share)]
    times = [edges[0], *np.ravel(np.column_stack([(edges[:-1] + edges[1:]) / 2, edges[1:]]))]
    valleys = rng.uniform(0.0, 0.4, 2)
    return rounded(pieces(steps, times, [0, 1, valleys[0], rng.uniform(0.6, 1), valleys[1], 0.9, 0]), 0.08)


def chirp(rng: Generator, steps: int) -> Array:
    """Swing about a held load, from slow to fast."""
    t = np.arange(steps) / FINE
    end, low, high = t[-1], rng.uniform(0.2, 0.5), rng.uniform(2, 5)
    swing = np.sin(2 * np.pi * (low * t + (high - low) * t**2 / (2 * end)))
    level = rounded(pieces(steps, [EDGE, 0.6, end - 0.6, end - EDGE], [0, 1, 1, 0]), 0.1)
    return level * (0.6 + rng.uniform(0.2, 0.35) * swing)


def hold(rng: Generator, steps: int) -> Array:
    """Press at once, hold for long, and let go."""
    end, rise = steps / FINE, float(rng.uniform(0.05, 0.3))
    return rounded(pieces(steps, [EDGE, EDGE + rise, end - EDGE - 0.4, end - EDGE], [0, 1, 1, 0]), 0.05)


def wander(rng: Generator, steps: int) -> Array:
    """Change the load at random, as a hand does."""
    knots = np.linspace(EDGE, steps / FINE - EDGE, int(rng.integers(8, 16)))
    values = rng.uniform(0.05, 1, len(knots))
    values[[0, -1]] = 0
    return rounded(pieces(steps, knots.tolist(), values.tolist()), 0.15)


def still(rng: Generator, steps: int, room: Array) -> tuple[Array, Array, Array]:
    """Stay at one place."""
    return np.zeros((steps, 2)), np.zeros((steps, 2)), np.zeros(steps)


def _path(rng: Generator, steps: int, knots: int) -> Array:
    """Return a path ``(S, 2)`` through random knots within -1 to 1."""
    times = np.linspace(0.3, steps / FINE - 0.3, knots).tolist()
    ends = rng.uniform(-1, 1, (knots, 2))
    return rounded(np.column_stack([pieces(steps, times, axis.tolist()) for axis in ends.T]), 0.2)


def slide(rng: Generator, steps: int, room: Array) -> tuple[Array, Array, Array]:
    """Slide to and fro across the pad."""
    path = 0.5 * room * _path(rng, steps, int(rng.integers(4, 9)))
    return path, path, np.zeros(steps)


def circle(rng: Generator, steps: int, room: Array) -> tuple[Array, Array, Array]:
    """Slide in circles or figures of eight."""
    t = np.arange(steps) / FINE
    turns, ratio = float(rng.uniform(0.15, 0.7)) * rng.choice([-1, 1]), int(rng.integers(1, 3))
    path = 0.4 * room * np.column_stack([np.sin(2 * np.pi * turns * t), np.cos(2 * np.pi * turns * ratio * t)])
    return path, path, np.zeros(steps)


def roll(rng: Generator, steps: int, room: Array) -> tuple[Array, Array, Array]:
    """Roll: the place moves, the surface hardly does."""
    path = 0.6 * room * _path(rng, steps, int(rng.integers(3, 6)))
    return path, 0.02 * path, np.zeros(steps)


def stick(rng: Generator, steps: int, room: Array) -> tuple[Array, Array, Array]:
    """Tug at the gel in all directions, mostly without slip."""
    path = float(rng.uniform(0.2, 0.6)) * _path(rng, steps, int(rng.integers(6, 12)))
    return path, path, np.zeros(steps)


def twist(rng: Generator, steps: int, room: Array) -> tuple[Array, Array, Array]:
    """Turn about the normal, with a little tug."""
    path = 0.15 * _path(rng, steps, 5)
    return path, path, 0.5 * _path(rng, steps, int(rng.integers(4, 8)))[:, 0]


FORCES: tuple[Callable[[Generator, int], Array], ...] = (staircase, taps, triangles, chirp, hold, wander)
MOVES: tuple[Move, ...] = (slide, stick, circle, slide, roll, twist, stick, still)
