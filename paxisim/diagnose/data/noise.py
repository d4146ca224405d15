"""Noise: estimates of the noise and of tolerated errors, from the streams themselves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from paxisim.scene.encoder import EncoderError

FloatArray = NDArray[np.float64]

NEARLY_STEP = 0.03  # steps; tolerance of a gap between readings
COMMON = 0.15  # least share of the gaps that are one step
SHIFTED = 0.1  # steps; with a larger phase the readings are not multiples of the step

_PRESSED = 0.2  # share of the largest force above which clipping at 0 does not affect the noise


@dataclass(frozen=True)
class Tolerance:
    """Errors of calibration and replay that are tolerated and need no explanation.

    Attributes:
        gain: Relative error of the force.
        time: Error of a time stamp, seconds.
        place: Position error of the simulated contact, in pitches.
        encoder: Error of the replayed force due to encoder steps; None if it is not known.
    """

    gain: float = 0.01
    time: float = 0.0015
    place: float = 0.02
    encoder: EncoderError | None = None


def noise_of(
    measured: FloatArray,
    simulated: FloatArray,
    episodes: tuple[slice, ...],
    step: float,
    alive: NDArray[np.bool_],
) -> FloatArray:
    """Standard deviation of each channel's noise (N), from differences of the residual between samples.

    Slow effects hardly contribute to these differences, and their median is robust to fast transients. A channel
    quieter than the median of its axis is assigned that median.
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
    changes = steps[:, :, 2][normal > _PRESSED * normal.max()]
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
        alike = np.abs(gaps - candidate) < NEARLY_STEP * candidate
        if alike.mean() > COMMON:
            step = float(np.median(gaps[alike]))
            break
    phase = float(np.angle(np.mean(np.exp(2j * np.pi * values / step))) / (2 * np.pi)) * step
    phase = phase if abs(phase) > SHIFTED * step else 0.0
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


def rate(values: FloatArray, time: FloatArray) -> FloatArray:
    """``(T, ...)`` time derivative of `values` (1/s); samples that share a time stamp get that of the first."""
    fresh = np.diff(time, prepend=-np.inf) > 0
    if fresh.sum() < 2:
        return np.zeros_like(values)
    if fresh.all():
        return np.gradient(values, time, axis=0)
    return np.gradient(values[fresh], time[fresh], axis=0)[np.cumsum(fresh) - 1]


def differences(x: FloatArray, beyond: Literal["constant", "edge"] = "constant") -> tuple[FloatArray, FloatArray]:
    """Central differences along columns and along rows; values beyond the pad are 0 or those of its edge."""
    padded = np.pad(x, ((0, 0), (0, 0), (0, 0), (1, 1), (1, 1)), mode=beyond)
    return padded[..., 2:, 1:-1] - padded[..., :-2, 1:-1], padded[..., 1:-1, 2:] - padded[..., 1:-1, :-2]
