"""Noise: what of a difference between the streams is not to be explained, read from the streams themselves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_PRESSED = 0.2  # of the largest force, beyond which no noise is cut off below 0


@dataclass(frozen=True)
class Tolerance:
    """What every calibrated sensor and every replayed motion is off by, and what nobody needs explained.

    Attributes:
        gain: Share of the force.
        time: Seconds between a sample and its time stamp.
        place: Pitches by which the simulated contact may be off.
    """

    gain: float = 0.01
    time: float = 0.0015
    place: float = 0.02


def noise_of(
    measured: FloatArray,
    simulated: FloatArray,
    episodes: tuple[slice, ...],
    step: float,
    alive: NDArray[np.bool_],
) -> FloatArray:
    """The noise of each channel (N), from how the residual changes from sample to sample.

    Changes are small against the noise for whatever is slow, an effect included; half of them by size is taken, so
    that fast moments do not count. A channel that is quieter than half of its axis is given that axis' median.
    """
    residual = measured - simulated
    steps = np.concatenate([np.diff(residual[span], axis=0) for span in episodes])
    sigma = np.sqrt(np.median(steps**2, axis=0) / 0.455 / 2)
    each = [np.median(sigma[:, axis][alive[:, axis]]) if alive[:, axis].any() else 0.0 for axis in range(3)]
    if measured[:, :, 2].min() >= 0:  # what is cut off below 0 hides the noise of a normal force at rest
        shear = [each[axis] for axis in range(2) if alive[:, axis].any()]
        each[2] = max(each[2], float(np.mean(shear)) if shear else _under_load(steps, simulated, episodes))
    typical = np.reshape(each, (1, 3, 1, 1))
    return np.maximum(np.maximum(sigma, typical), max(step / np.sqrt(12), 1e-3))


def _under_load(steps: FloatArray, simulated: FloatArray, episodes: tuple[slice, ...]) -> float:
    """The noise (N) of normal forces where they are pressed so that nothing is cut off."""
    normal = np.concatenate([simulated[span, :, 2][1:] for span in episodes])
    changes = steps[:, :, 2][normal > _PRESSED * normal.max()]
    return float(np.sqrt(np.median(changes**2) / 0.455 / 2)) if changes.size else 0.0


def step_of(measured: FloatArray) -> float:
    """The step (N) in which a sensor counts; 0 where no step is to be seen."""
    values = np.unique(np.round(measured[:: max(1, len(measured) // 400)].ravel(), 5))
    gaps = np.diff(values)
    gaps = gaps[gaps > 2e-4]
    if not len(gaps):
        return 0.0
    step = float(np.median(gaps[gaps < 1.5 * gaps.min()]))
    for _ in range(3):  # large readings tell the step more exactly than neighbours do, once their number is known
        counts = np.round(values / step)
        near = np.abs(counts) <= 0.1 / 1e-5 * step
        step = float(np.sum(values[near] * counts[near]) / max(np.sum(counts[near] ** 2), 1.0)) or step
    off = np.abs(values / step - np.round(values / step))
    return step if np.quantile(off, 0.99) < 0.02 else 0.0


def tolerated(x: FloatArray, time: FloatArray, episodes: tuple[slice, ...], tolerance: Tolerance) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` variance (N^2) that `tolerance` allows about the simulation `x`."""
    speed = np.concatenate([rate(x[span], time[span]) for span in episodes])
    along, across = differences(x)
    return (tolerance.gain * x) ** 2 + (tolerance.time * speed) ** 2 + tolerance.place**2 * (across**2 + along**2)


def rate(values: FloatArray, time: FloatArray) -> FloatArray:
    """``(T, ...)`` how fast `values` change (1/s); samples of one time stamp all have that of the first of them."""
    fresh = np.diff(time, prepend=-np.inf) > 0
    if fresh.sum() < 2:
        return np.zeros_like(values)
    if fresh.all():
        return np.gradient(values, time, axis=0)
    return np.gradient(values[fresh], time[fresh], axis=0)[np.cumsum(fresh) - 1]


def differences(x: FloatArray, beyond: Literal["constant", "edge"] = "constant") -> tuple[FloatArray, FloatArray]:
    """How the two neighbours of each taxel differ along columns, and along rows; beyond the pad is 0, or its edge."""
    padded = np.pad(x, ((0, 0), (0, 0), (0, 0), (1, 1), (1, 1)), mode=beyond)
    return padded[..., 2:, 1:-1] - padded[..., :-2, 1:-1], padded[..., 1:-1, 2:] - padded[..., 1:-1, :-2]
