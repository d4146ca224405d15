"""Dither: the noise of a sensor ahead of its steps, from how its counts change while nothing moves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.special import ndtr, ndtri

from paxisim.diagnose.noise import FloatArray

LEAST = 5  # samples of an episode
SMOOTH = 0.6  # of a step: with more noise the spread of the counts at rest tells it
HELD = 0.3  # s without a move, after which a slow sensor has settled
APART = 0.15  # s between the counts that are compared, so that some of slow noise shows, too
STILL = 0.1  # of a step, by which a held force may move in that time
MOVING = 0.2  # of a step, by which it may where too few are held
FEWEST = 300  # counts compared
UNTOLD = 0.15  # of a step: noise that may not show at rest at all
NOISES = np.geomspace(0.01, 1.0, 60)  # of a step


def dither_of(
    measured: FloatArray,
    simulated: FloatArray,
    at_rest: NDArray[np.bool_],
    untouched: NDArray[np.bool_],
    episodes: tuple[slice, ...],
    interval: float,
    step: float,
    alive: NDArray[np.bool_],
) -> float:
    """The noise before rounding (N).

    Without a step, or with a small one, it is the spread of the shear that is read where nothing is pressed. Against a
    large step it hardly shows there: no reading leaves its count but those whose zero is near an edge. Pressed taxels
    are as likely to be near one as not, and then two readings of a force that moves by d differ by as many steps, on
    average, as d and the noise of both together are. It is not more than would show at rest in any case.

    Args:
        measured: ``(T, pads, 3, rows, cols)`` newtons.
        simulated: The same, from which is taken where taxels are pressed and how fast that changes.
        at_rest: ``(T,)`` where nothing is pressed.
        untouched: ``(T,)`` where nothing has been pressed in the episode so far: no memory of a load is there.
        episodes: Their samples.
        interval: Usual seconds between two samples.
        step: N, of the sensor; 0 where it has none.
        alive: ``(pads, 3, rows, cols)`` channels that take part.
    """
    resting = _shear(measured, at_rest, episodes, alive)
    before = _shear(measured, untouched, episodes, alive) or resting
    if resting and (step == 0 or _spread(before) > SMOOTH * step):  # all: slow noise shows in long spans only
        return float(np.sqrt(max(_spread(resting) ** 2 - step**2 / 12, 0.0)))
    if step == 0:
        return 0.0
    held = _under_load(measured, simulated, episodes, interval, step, alive)
    if not resting:
        return UNTOLD * step if held is None else held
    # with a zero in the middle of a step counts change least
    most = step * max(UNTOLD, 0.5 / float(ndtri(1 - 0.5 * min(_spread(before) / step, 1.0) ** 2)))
    return most if held is None else min(held, most)


def _shear(
    measured: FloatArray, frames: NDArray[np.bool_], episodes: tuple[slice, ...], alive: NDArray[np.bool_]
) -> list[FloatArray]:
    parts = [measured[span][frames[span]][:, :, :2] for span in episodes]
    return [part.reshape(len(part), -1).compress(alive[:, :2].ravel(), axis=1) for part in parts if len(part) >= LEAST]


def _spread(parts: list[FloatArray]) -> float:
    return float(np.median([part.std(axis=0) for part in parts]))


def _under_load(
    measured: FloatArray,
    simulated: FloatArray,
    episodes: tuple[slice, ...],
    interval: float,
    step: float,
    alive: NDArray[np.bool_],
) -> float | None:
    """The noise (N) with which held forces of more than a step are read as they are, if there are such."""
    apart, window = (max(1, round(seconds / interval)) for seconds in (APART, HELD + APART))
    counted, moved, fastest = [], [], []
    for span in episodes:
        force, count = simulated[span] / step, np.rint(measured[span] / step)
        change = apart * np.abs(np.diff(force, axis=0, prepend=force[:1]))
        fast = maximum_filter1d(change, window + 1, axis=0, origin=window // 2)[apart:]  # of the time up to a sample
        pressed = (np.minimum(np.abs(force[apart:]), np.abs(force[:-apart])) > 1) & (fast < MOVING) & alive
        counted.append(np.abs(count[apart:] - count[:-apart])[pressed])
        moved.append(np.abs(force[apart:] - force[:-apart])[pressed])
        fastest.append(fast[pressed])
    differ, move, fast = (np.concatenate(parts) for parts in (counted, moved, fastest))
    if len(fast) < FEWEST:
        return None
    taken = fast <= max(STILL, float(np.partition(fast, FEWEST - 1)[FEWEST - 1]))
    number, edges = np.histogram(move[taken], bins=100)
    expected = [number @ _mean_difference((edges[1:] + edges[:-1]) / 2, noise) for noise in NOISES]
    return step * float(np.interp(differ[taken].sum(), expected, NOISES))


def _mean_difference(move: FloatArray, noise: float) -> FloatArray:
    """The mean size of `move` and the difference of two readings with `noise`, all in steps."""
    both = np.sqrt(2) * noise
    density = np.exp(-0.5 * (move / both) ** 2) / np.sqrt(2 * np.pi)
    return np.asarray(2 * both * density + move * (1 - 2 * ndtr(-move / both)))
