"""Fit: a readout from a recording with a load cell beside the sensor."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.calibrate.delay import MIN_EXPLAINED_SHARE, Delay, fit_delay, half_width
from paxisim.calibrate.lagged import Array, Lagged, Sums
from paxisim.calibrate.linear import LinearCalibration
from paxisim.calibrate.loads import Excitation, Load, excitation_of, find_loads, values_of
from paxisim.errors import InvalidValueError
from paxisim.presses import find_presses
from paxisim.recording import Recording

DEGREES = (1, 2, 3)
RIDGES = (0.0, 1e-4, 1e-3, 1e-2, 1e-1)
"""Regularisation strengths that are tried, in units of the variance of the loads."""
MIN_SAMPLES = 10
"""Minimum number of samples with a known load."""
HELD_OUT_BLOCKS = (5, 20)
"""Minimum and maximum number of held-out blocks."""


def calibrate_readout(
    recording: Recording,
    loads: str | Sequence[str] | Mapping[str, str],
    *,
    degree: int = 1,
    max_delay: float = 0.5,
) -> LinearCalibration:
    """Fit the readout of a sensor whose channels are not in newtons, using loads measured by a reference.

    Least squares gives each channel an offset and a gain for each load. All channels lag the loads by one common delay;
    without it, a filter between sensor and load cell would look like a rotation of the axes. The delay and the gains
    have 95 % intervals. If loads are nearly collinear, ridge regression shrinks their gains, provided that this lowers
    the held-out error. Memory effects are left to the diagnosis, and so is nonlinearity at degree 1.

    Episodes are held out in turn. For a recording with a single episode, the presses are held out, or blocks of time if
    there are no presses.

    Example:
        ```python
        press = paxisim.Recording.load("press_1.sensor.csv")
        readout = paxisim.calibrate_readout(press, "load")
        print(readout)  # delay, gains and held-out error of each channel
        found = paxisim.diagnose(readout.apply(press))
        ```

    Args:
        recording: Recording with the channels in `measured`, in any unit.
        loads: Covariates that hold the load, in newtons and newton-metres, NaN where unknown: a name, up to six names,
            or up to six components ``Fx Fy Fz Tx Ty Tz`` with their covariates, e.g. ``{"Fx": "cell_x"}``. A covariate
            with 3 or 6 values per sample holds the components in this order.
        degree: Highest power of each load, 1 to 3.
        max_delay: Largest delay to search (s), of either sign; reduced if the recording has short pieces.

    Warns:
        UserWarning: The data do not excite a load or cannot separate it from the others, or the delay lies at the end
            of the search range.

    Raises:
        UnknownNameError: There is no such covariate or component.
        InvalidValueError: `measured` is missing, no load varies or most are unknown, no channel responds to them, or
            an argument is out of range.
    """
    if degree not in DEGREES:
        raise InvalidValueError(f"degree must be 1, 2 or 3, got {degree!r}")
    if not 0 <= max_delay < float("inf"):
        raise InvalidValueError(f"max_delay must be a time of at least 0 s, got {max_delay!r}")
    if recording.measured is None:
        raise InvalidValueError("a readout is fitted to the measured tensor, but the recording has none")
    found = find_loads(recording, loads)
    values = values_of(recording, found)
    names = ", ".join(repr(name) for name in dict.fromkeys(load.covariate for load in found))
    known = np.isfinite(values).all(axis=1)
    if known.sum() < MIN_SAMPLES:
        raise InvalidValueError(f"a readout needs a varying load: {names} is known at {int(known.sum())} samples")
    channels = recording.measured.reshape(len(values), -1).astype(np.float64)
    channels[:, np.isnan(channels).all(axis=0)] = 0.0  # never known, so no load can explain them
    known &= np.isfinite(channels).all(axis=1)
    if known.sum() < MIN_SAMPLES:
        raise InvalidValueError(
            f"load and channels are known together at {int(known.sum())} samples, not {MIN_SAMPLES}"
        )
    recording, values, channels = recording[known], values[known], channels[known]
    excitation = excitation_of(found, values)
    if not excitation.excited.any():
        raise InvalidValueError(
            f"a readout needs a varying load: {names} is known at {len(values)} samples and constant"
        )
    lagged = Lagged(recording.time, values[:, excitation.excited], channels, recording.episode, degree)
    block = blocks_of(recording, values)
    delay = fit_delay(lagged, block, max_delay)
    readout = _readout(lagged, block, delay, found, excitation, recording)
    if not readout.used.any():
        raise InvalidValueError(
            f"no channel correlates with {names}: check that loads and channels share one motion and one clock"
        )
    _warn(readout, delay)
    return readout


def blocks_of(recording: Recording, values: Array) -> NDArray[np.intp]:
    """Return the number of the block that each sample is held out with, ``(T,)``."""
    episode = recording.episode
    if len(np.unique(episode)) < HELD_OUT_BLOCKS[0]:
        episode = np.cumsum(np.diff(episode, prepend=episode[0]) != 0)
        if episode[-1] == 0:
            episode = find_presses(recording.time, values).episode
    number = np.cumsum(np.diff(episode, prepend=episode[0]) != 0)
    count = int(number[-1]) + 1
    if count < HELD_OUT_BLOCKS[0]:
        number, count = np.arange(len(number)), len(number)
        return number * (2 * HELD_OUT_BLOCKS[0]) // count
    return number * min(count, HELD_OUT_BLOCKS[1]) // count


def _readout(
    lagged: Lagged,
    block: NDArray[np.intp],
    delay: Delay,
    loads: tuple[Load, ...],
    excitation: Excitation,
    recording: Recording,
) -> LinearCalibration:
    """Fit the readout at a delay; held-out errors and intervals use the delays fitted without each block."""
    is_late = not delay.interval[0] <= 0 <= delay.interval[1]
    value = delay.value if is_late else 0.0
    smooth, sums = lagged.averaged(float(np.abs(delay.replicates).max()), block), lagged.sums(value, block)
    ridge = _least_ridge(smooth.sums(value))
    fitted = smooth.sums(value).total().solve(ridge)[0]
    squares, replicates = [], []
    for number, own in enumerate(delay.replicates):
        at = float(own) if is_late else 0.0
        without = smooth.sums(at).without().solve(ridge)
        squares.append(lagged.sums(at, block).squares(without)[number])
        replicates.append(lagged.gains(smooth.sums(float(own)).without().solve(ridge)[number]))
    count = sums.count.sum()
    variance = (sums.yy.sum(axis=0) - sums.xy[:, 0].sum(axis=0) ** 2 / count) / count
    error = np.sum(squares, axis=0) / count
    explained = 1 - error / np.maximum(variance, 1e-300)
    used = (explained > MIN_EXPLAINED_SHARE) & (variance > 1e-12)
    shape = recording.measured.shape[1:] if recording.measured is not None else ()
    size = len(loads), *shape
    gain, gain_error = np.zeros((len(loads), used.size)), np.full((len(loads), used.size), np.inf)
    gain[excitation.excited] = lagged.gains(fitted)
    gain_error[excitation.excited] = half_width(np.stack(replicates))
    coefficients = np.zeros((lagged.degree, len(loads), used.size))
    offset, coefficients[:, excitation.excited] = lagged.polynomial(fitted)
    return LinearCalibration(
        loads,
        np.where(used, coefficients, 0.0).reshape(lagged.degree, *size),
        np.where(used, offset, lagged.level).reshape(shape),
        np.where(used, gain, 0.0).reshape(size),
        gain_error.reshape(size),
        used.reshape(shape),
        value,
        delay.interval,
        (np.sqrt(error) * lagged.scatter).reshape(shape),
        explained.reshape(shape),
        excitation,
        ridge,
        int(block.max()) + 1,
        str(recording.metadata.get("unit", "")),
    )


def _least_ridge(sums: Sums) -> float:
    """Return the ridge with the lowest held-out error, or 0 if it gains no more than one standard error over none."""
    errors = np.stack([sums.squares(sums.without().solve(ridge)).mean(axis=1) for ridge in RIDGES])  # (ridges, blocks)
    best = int(np.argmin(errors.sum(axis=1)))
    return RIDGES[best] if is_lower(errors[best], errors[0]) else 0.0


def is_lower(errors: Array, than: Array) -> bool:
    """Return whether held-out errors ``(blocks,)`` are lower than others by more than one standard error."""
    gained = than - errors
    return bool(gained.mean() > gained.std(ddof=1) / np.sqrt(len(gained)))


def _warn(readout: LinearCalibration, delay: Delay) -> None:
    found = readout.excitation
    for k, load in enumerate(readout.loads):
        if not found.excited[k]:
            warnings.warn(
                f"the recording does not excite {load.name}: it varies by {found.spread[k]:.2g} {load.unit} only, so "
                f"its gain is unknown and set to 0. Record a motion in which {load.name} changes",
                stacklevel=3,
            )
        elif not found.separable[k]:
            warnings.warn(
                f"the recording does not excite {load.name} apart from the other loads: they explain "
                f"{1 - found.alone[k] ** 2:.1%} of its variance, so its own gain is unknown. Record a motion in which "
                f"{load.name} changes alone",
                stacklevel=3,
            )
    if delay.at_limit:
        warnings.warn(
            f"the delay lies at the end of the search, {delay.value:+.3g} s: it may be larger. Check the clocks of "
            "sensor and load cell, or search further with max_delay",
            stacklevel=3,
        )
