"""Real: the eFlesh presses as forces on a pad of 1x5 taxels, and smooth regressions of them.

The channels are fields (microtesla), and the load cell gives one force. The load on each taxel is unknown. Therefore
**one** factor converts all channels of a recording to newtons: the summed gain of the five normal channels, as fitted
by `paxisim.calibrate_readout` to the *other* recording. The five normal forces then add up to about the load, and the
pattern over the channels remains that of the sensor. A gain for each channel would turn it into fifteen copies of one
curve, in which swapped taxels, crosstalk and coupling between axes could not be seen. The sensor's x serves as the
normal axis, because pressing is positive there in all five magnetometers; its z and y are the two shears.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

import paxisim

Floats = NDArray[np.float64]
AXES = (2, 1, 0)
"""Axes of the sensor that serve as x, y and z of the pad."""
SETTLED = (3, 2)
"""Number of presses at the start of each recording in which the sensor had not settled; they are left out."""
USED = (slice(4, 9), slice(3, 10))
"""Presses of each recording that cases are made of; those around them only train the regressions."""
GRID = 0.05  # s, sampling interval at which the motion is smoothed
TAUS = (0.5, 2.0, 8.0, 30.0)  # s, time constants of the load history that a regression sees
RIDGE = 1e-4
LOAD, DEPTH = 33.0, 12.0  # N and mm, range of the motion


@dataclass(frozen=True, eq=False)
class Real:
    """A recording as forces.

    Attributes:
        time: ``(T,)`` seconds.
        force: ``(T, 3, 5)`` newtons.
        press: ``(T,)`` number of the press.
        load: ``(T,)`` newtons, force of the load cell.
        depth: ``(T,)`` mm, depth of the indenter.
        covariates: Position of the robot, ``(T,)`` each.
        field: ``(T, 1, 3, 1, 5)`` channels as recorded (microtesla).
        noise: ``(3, 5)`` newtons, standard deviation of the sensor's noise, from second differences.
        first: Number of the first press in which the sensor had settled.
        used: Presses that cases are made of.
    """

    time: Floats
    force: Floats
    press: NDArray[np.int64]
    load: Floats
    depth: Floats
    covariates: dict[str, Floats]
    field: NDArray[np.float32]
    noise: Floats
    first: int
    used: slice


def load_both(folder: Path) -> tuple[Real, Real]:
    """Load both recordings, each converted to newtons with the readout fitted to the other.

    Args:
        folder: Folder that holds ``press_1`` and ``press_2``, see `paxisim.logs.eflesh`.
    """
    both = [paxisim.Recording.load(folder / f"press_{n}.sensor.csv", missing="drop") for n in (1, 2)]
    readouts = [paxisim.calibrate_readout(recording, "load") for recording in both]
    out = []
    for recording, readout, first, used in zip(both, reversed(readouts), SETTLED, USED, strict=True):
        assert recording.measured is not None
        field = recording.measured[:, 0, AXES, 0].astype(np.float64)
        offset, gain = readout.offset[0, AXES, 0], readout.gain[0, 0, AXES, 0]
        force = (field - offset) / gain[2].sum()
        load = recording.covariates["load"]
        rest = {name: values for name, values in recording.covariates.items() if name != "load"}
        out.append(
            Real(
                recording.time, force, paxisim.find_presses(recording.time, load).episode, load,
                1e3 * (rest["robot_z"].max() - rest["robot_z"]), rest, recording.measured,
                np.diff(force, 2, axis=0).std(axis=0) / np.sqrt(6), first, used,
            )
        )  # fmt: skip
    return out[0], out[1]


def regressions() -> tuple[str, ...]:
    """Return the names of the regressions."""
    return tuple(_BUILD)


def simulate(real: Real, name: str) -> Floats:
    """``(T, 3, 5)`` newtons, prediction of each press by a regression fitted to the other presses.

    Args:
        real: The recording.
        name: One of `regressions`. ``fine`` and ``coarse`` are ridge regressions on Gaussian bumps over depth and load
            and on the history of the load; the bumps over depth differ between loading and unloading and change
            linearly from press to press. ``mean`` is the mean of the other presses at the same time since the press
            began, with a linear trend from press to press.
    """
    out = np.zeros_like(real.force)
    design = _BUILD[name](real)
    for number in np.unique(real.press):
        train = (real.press != number) & (real.press >= real.first)
        out[real.press == number] = _predicted(design, real.force, train, real.press == number)
    return out


def leaves(real: Real, simulated: Floats) -> Floats:
    """``(3, 5)`` RMS residual of a regression in the used presses, in units of the sensor's noise."""
    used = np.isin(real.press, np.arange(real.used.start, real.used.stop))
    return np.sqrt(np.mean((real.force - simulated)[used] ** 2, axis=0)) / real.noise


def _predicted(design: Floats, force: Floats, train: NDArray[np.bool_], test: NDArray[np.bool_]) -> Floats:
    middle, scale = design[train].mean(axis=0), design[train].std(axis=0) + 1e-9
    x, y = (design - middle) / scale, force.reshape(len(force), -1)
    zero = y[train].mean(axis=0)
    normal = x[train].T @ x[train] + RIDGE * train.sum() * np.eye(x.shape[1])
    weights = np.linalg.solve(normal, x[train].T @ (y[train] - zero))
    return (x[test] @ weights + zero).reshape(-1, *force.shape[1:])


def _bells(values: Floats, count: int) -> Floats:
    """``(T, count)`` Gaussian bumps with centres from 0 to 1."""
    centres = np.linspace(0, 1, count)
    return np.exp(-0.5 * ((values[:, None] - centres) * (count - 1)) ** 2)


def _ridge(real: Real, count: int, width: float) -> Floats:
    load, depth = _smooth(real.time, real.load, width) / LOAD, _smooth(real.time, real.depth, width) / DEPTH
    down = np.tanh(8 * (depth - _relaxed(real.time, depth, 1.5)))[:, None]
    run = np.linspace(-1, 1, len(real.time))[:, None]
    past = np.stack([_relaxed(real.time, load, tau) for tau in TAUS], axis=1)
    bells = _bells(depth, count)
    parts = (_bells(load, count), bells, bells * down, down, past, past * depth[:, None])
    return np.concatenate([*parts, bells * run, run, bells * down * run], axis=1)


def _mean(real: Real) -> Floats:
    """Gaussian bumps over the time since a press began, and the same with a linear trend from press to press."""
    since = np.empty(len(real.time))
    for number in np.unique(real.press):
        own = real.press == number
        depth = _smooth(real.time[own], real.depth[own], 0.3)
        down = np.argmax(depth > DEPTH / 2)  # halfway down, because presses are cut in the middle of a rest
        since[own] = real.time[own] - real.time[own][down]
    run = np.linspace(-1, 1, len(real.time))[:, None]
    bells = _bells(np.clip((since + 12) / 40, 0, 1), 60)
    return np.concatenate([bells, bells * run], axis=1)


def _smooth(time: Floats, values: Floats, width: float) -> Floats:
    grid = np.arange(time[0], time[-1], GRID)
    return np.interp(time, grid, gaussian_filter1d(np.interp(grid, time, values), width / GRID))


def _relaxed(time: Floats, values: Floats, tau: float) -> Floats:
    """``(T,)`` first-order low-pass of `values` with time constant `tau` (s)."""
    out, share = values.copy(), -np.expm1(-np.diff(time) / tau)
    for i in range(1, len(values)):
        out[i] = out[i - 1] + share[i - 1] * (values[i] - out[i - 1])
    return out


_BUILD = {
    "fine": lambda real: _ridge(real, 16, 0.3),
    "coarse": lambda real: _ridge(real, 10, 0.6),
    "mean": _mean,
}
