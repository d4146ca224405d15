"""Noise floor: the noise, the quantisation step and the noise before rounding, estimated from the streams.

Slow effects hardly contribute to differences between samples, and their median is robust to fast transients.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.special import ndtr, ndtri

from paxisim.diagnose.data.noise import Tolerance, differences, rate
from paxisim.diagnose.data.pieces import FloatArray
from paxisim.diagnose.rules import NOISE

NOISES = np.geomspace(0.01, 1.0, 60)  # steps


def noise_of(
    measured: FloatArray,
    simulated: FloatArray,
    episodes: tuple[slice, ...],
    step: float,
    alive: NDArray[np.bool_],
) -> FloatArray:
    """Standard deviation of each channel's noise (N), from differences of the residual between samples.

    A channel quieter than the median of its axis is assigned that median.
    """
    residual = measured - simulated
    steps = np.concatenate([np.diff(residual[span], axis=0) for span in episodes])
    sigma = np.sqrt(np.median(steps**2, axis=0) / 0.455 / 2)
    each = [np.median(sigma[:, axis][alive[:, axis]]) if alive[:, axis].any() else 0.0 for axis in range(3)]
    if measured[:, :, 2].min() >= 0:  # clipping at 0 hides the noise of the normal force at rest
        shear = [each[axis] for axis in range(2) if alive[:, axis].any()]
        each[2] = max(each[2], float(np.mean(shear)) if shear else _under_load(steps, simulated, episodes))
    typical = np.reshape(each, (1, 3, 1, 1))
    return np.maximum(np.maximum(sigma, typical), max(step / np.sqrt(12), 1e-3))


def _under_load(steps: FloatArray, simulated: FloatArray, episodes: tuple[slice, ...]) -> float:
    """Noise (N) of the normal force under loads large enough to avoid clipping."""
    normal = np.concatenate([simulated[span, :, 2][1:] for span in episodes])
    changes = steps[:, :, 2][normal > NOISE.pressed * normal.max()]
    return float(np.sqrt(np.median(changes**2) / 0.455 / 2)) if changes.size else 0.0


def step_of(measured: FloatArray) -> tuple[float, float]:
    """Quantisation step of the sensor and its reading nearest to 0 (N); both are 0 if there is no step."""
    values = np.unique(np.round(measured[:: max(1, len(measured) // 400)].ravel(), 5))
    gaps = np.diff(values)
    gaps = gaps[gaps > 2e-4]
    if not len(gaps):
        return 0.0, 0.0
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    for candidate in np.unique(np.round(gaps, 4)):  # the smallest common gap; clipping at 0 adds others
        alike = np.abs(gaps - candidate) < NOISE.nearly_step * candidate
        if alike.mean() > NOISE.common:
            step = float(np.median(gaps[alike]))
            break
    phase = float(np.angle(np.mean(np.exp(2j * np.pi * values / step))) / (2 * np.pi)) * step
    phase = phase if abs(phase) > NOISE.shifted * step else 0.0
    values = values[values != 0] if phase else values  # 0 is where normal readings are clipped
    for _ in range(3):  # large readings determine the step more precisely, once their counts are known
        counts = np.round((values - phase) / step)
        near = np.abs(counts) <= 0.1 / 1e-5 * step
        step = float(np.sum((values[near] - phase) * counts[near]) / max(np.sum(counts[near] ** 2), 1.0)) or step
    off = np.abs((values - phase) / step - np.round((values - phase) / step))
    return (step, phase) if np.quantile(off, 0.99) < 0.02 else (0.0, 0.0)


def tolerated(x: FloatArray, time: FloatArray, episodes: tuple[slice, ...], tolerance: Tolerance) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` variance (N^2) of the tolerated errors around the simulation `x`."""
    speed = np.concatenate([rate(x[span], time[span]) for span in episodes])
    along, across = differences(x)
    allowed = (tolerance.gain * x) ** 2 + (tolerance.time * speed) ** 2 + tolerance.place**2 * (across**2 + along**2)
    return allowed if tolerance.encoder is None else allowed + tolerance.encoder.variance(x)


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
    """Standard deviation of the noise before rounding (N).

    Without a quantisation step, or with a small one, it is the standard deviation of the shear at rest. With a large
    step the noise is hardly visible at rest: a reading changes its count only if its offset is near a rounding edge.
    Under load, forces are spread evenly relative to the edges, so the mean count difference between two readings
    follows from the change of force and the noise of both. The result is bounded by the noise visible at rest.

    Args:
        measured: ``(T, pads, 3, rows, cols)`` newtons.
        simulated: The same; it determines which taxels are pressed and how fast the force changes.
        at_rest: ``(T,)`` whether no taxel is pressed.
        untouched: ``(T,)`` whether no taxel has been pressed yet in the episode, so that no memory effect is present.
        episodes: Samples of each episode.
        interval: Typical interval between samples, in seconds.
        step: Quantisation step (N); 0 if there is none.
        alive: ``(pads, 3, rows, cols)`` channels in use.
    """
    resting = _shear(measured, at_rest, episodes, alive)
    before = _shear(measured, untouched, episodes, alive) or resting
    if resting and (step == 0 or _spread(before) > NOISE.smooth * step):
        # all samples at rest, as slow noise shows in long spans only
        return float(np.sqrt(max(_spread(resting) ** 2 - step**2 / 12, 0.0)))
    if step == 0:
        return 0.0
    held = _dither_under_load(measured, simulated, episodes, interval, step, alive)
    if not resting:
        return NOISE.hidden * step if held is None else held
    # counts change least for an offset in the middle of a step
    most = step * max(NOISE.hidden, 0.5 / float(ndtri(1 - 0.5 * min(_spread(before) / step, 1.0) ** 2)))
    return most if held is None else min(held, most)


def _shear(
    measured: FloatArray, frames: NDArray[np.bool_], episodes: tuple[slice, ...], alive: NDArray[np.bool_]
) -> list[FloatArray]:
    parts = [measured[span][frames[span]][:, :, :2] for span in episodes]
    return [
        part.reshape(len(part), -1).compress(alive[:, :2].ravel(), axis=1)
        for part in parts
        if len(part) >= NOISE.samples
    ]


def _spread(parts: list[FloatArray]) -> float:
    return float(np.median([part.std(axis=0) for part in parts]))


def _dither_under_load(
    measured: FloatArray,
    simulated: FloatArray,
    episodes: tuple[slice, ...],
    interval: float,
    step: float,
    alive: NDArray[np.bool_],
) -> float | None:
    """Noise (N) estimated from held forces above one step; None if there are too few."""
    apart, window = (max(1, round(seconds / interval)) for seconds in (NOISE.lag, NOISE.held + NOISE.lag))
    counted, moved, fastest = [], [], []
    for span in episodes:
        force, count = simulated[span] / step, np.rint(measured[span] / step)
        change = apart * np.abs(np.diff(force, axis=0, prepend=force[:1]))
        # over the window that ends at the sample
        fast = maximum_filter1d(change, window + 1, axis=0, origin=window // 2)[apart:]
        pressed = (np.minimum(np.abs(force[apart:]), np.abs(force[:-apart])) > 1) & (fast < NOISE.moving_change) & alive
        counted.append(np.abs(count[apart:] - count[:-apart])[pressed])
        moved.append(np.abs(force[apart:] - force[:-apart])[pressed])
        fastest.append(fast[pressed])
    differ, move, fast = (np.concatenate(parts) for parts in (counted, moved, fastest))
    if len(fast) < NOISE.compared:
        return None
    taken = fast <= max(NOISE.held_change, float(np.partition(fast, NOISE.compared - 1)[NOISE.compared - 1]))
    number, edges = np.histogram(move[taken], bins=100)
    expected = [number @ _mean_difference((edges[1:] + edges[:-1]) / 2, noise) for noise in NOISES]
    return step * float(np.interp(differ[taken].sum(), expected, NOISES))


def _mean_difference(move: FloatArray, noise: float) -> FloatArray:
    """Mean absolute difference of two readings with `noise` whose forces differ by `move`, all in steps."""
    both = np.sqrt(2) * noise
    density = np.exp(-0.5 * (move / both) ** 2) / np.sqrt(2 * np.pi)
    return np.asarray(2 * both * density + move * (1 - 2 * ndtr(-move / both)))
