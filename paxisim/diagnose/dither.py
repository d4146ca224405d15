"""Dither: the noise of a sensor ahead of its steps, from how its counts change while nothing is pressed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp
from scipy.stats import norm

from paxisim.diagnose.noise import FloatArray

LEAST = 5  # samples of an episode
SMOOTH = 0.6  # of a step: with more noise the spread of the counts tells it
NOISES = np.geomspace(0.15, 0.8, 25)  # steps; with less the reading hardly differs
SPREADS = np.array([0.02, 0.1, 0.2, 0.4, 0.8, 1.6, 6.4])  # steps, of the zeros of the channels
MEMORY = 1.5  # times the noise before a contact: what is more after it is not noise
FAR = 3  # counts from the commonest one, that are told apart


def dither_of(
    measured: FloatArray,
    at_rest: NDArray[np.bool_],
    untouched: NDArray[np.bool_],
    episodes: tuple[slice, ...],
    step: float,
    alive: NDArray[np.bool_],
) -> float:
    """The noise before rounding (N), from the shear that is read where nothing is pressed.

    Where it is small against a step, it shows in how often a channel leaves its commonest count, as does a zero near
    the edge of a step. The two are told apart by all channels together: the noise is the likeliest one, with zeros
    that are normally distributed about 0 in each episode.

    Args:
        measured: ``(T, pads, 3, rows, cols)`` newtons.
        at_rest: ``(T,)`` where nothing is pressed.
        untouched: ``(T,)`` where nothing has been pressed in the episode so far: no memory of a load is there.
        episodes: Their samples.
        step: N, of the sensor; 0 where it has none.
        alive: ``(pads, 3, rows, cols)`` channels that take part.
    """
    resting = _shear(measured, at_rest, episodes, alive)
    before = _shear(measured, untouched, episodes, alive) or resting
    if not resting:
        return 0.0
    if step == 0 or _spread(before) > SMOOTH * step:  # all of it: noise that is slow shows in long spans only
        return float(np.sqrt(max(_spread(resting) ** 2 - step**2 / 12, 0.0)))
    noise, longer = _before_rounding(before, step), _before_rounding(resting, step)
    return longer if longer < MEMORY * noise else noise  # slow noise shows in long spans only, but so does a memory


def _before_rounding(parts: list[FloatArray], step: float) -> float:
    counts = [np.round(part / step) for part in parts]
    commonest = np.array([np.median(c, axis=0) for c in counts])
    far = [np.clip(c - own, -FAR, FAR) for c, own in zip(counts, commonest, strict=True)]
    seen = np.array([[(f == level).sum(axis=0) for f in far] for level in range(-FAR, FAR + 1)], dtype=float)
    return step * _likeliest(seen.reshape(2 * FAR + 1, -1).T, commonest.ravel())


def _shear(
    measured: FloatArray, frames: NDArray[np.bool_], episodes: tuple[slice, ...], alive: NDArray[np.bool_]
) -> list[FloatArray]:
    parts = [measured[span][frames[span]][:, :, :2] for span in episodes]
    return [part.reshape(len(part), -1).compress(alive[:, :2].ravel(), axis=1) for part in parts if len(part) >= LEAST]


def _spread(parts: list[FloatArray]) -> float:
    return float(np.median([part.std(axis=0) for part in parts]))


def _likeliest(seen: FloatArray, commonest: FloatArray) -> float:
    """Noise in steps, from ``(channels, 2 * FAR + 1)`` how often each count about the commonest was seen."""
    zero = np.linspace(-0.5, 0.5, 41)
    edges = np.r_[-np.inf, np.arange(-FAR, FAR) + 0.5, np.inf]
    below = norm.cdf((edges - zero[:, None]) / NOISES[:, None, None])  # (noises, zeros, edges)
    chance = np.log(np.maximum(np.diff(below, axis=-1), 1e-12))
    fits = np.einsum("cl,nzl->cnz", seen, chance)
    best = np.full(len(NOISES), -np.inf)
    for spread in SPREADS:
        prior = norm.logpdf(commonest[:, None] + zero, scale=spread)
        best = np.maximum(best, np.sum(logsumexp(fits + prior[:, None, :], axis=-1), axis=0))
    return float(NOISES[best.argmax()])
