"""Effects outside the vocabulary of `paxisim.diagnose`: a diagnosis should say that something is left over.

Sizes 0 to 1 run from visible to large. Effects with a mean that the vocabulary could name (a mean delay, a mean gain)
are centred, so that no name is the right one.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from scipy.ndimage import uniform_filter1d
from scipy.signal import lfilter

from .bench import Bench, Form, Run, between, either
from .presses import FINE, Array


def _latest(events: np.ndarray) -> np.ndarray:
    """Return for each sample the index of the latest event at or before it; the first sample is one."""
    index = np.where(events, np.arange(len(events)), 0)
    return np.maximum.accumulate(index)


def hum(rng: Generator, bench: Bench, size: float) -> Run:
    """Mains hum of 50 or 60 Hz, aliased by the frames; each channel has a phase and an amplitude of its own."""
    shape = (bench.shape[0], 3, *bench.shape[1:])
    amplitude = bench.count * between(1, 6, size) * rng.uniform(0.5, 1, shape)
    phase = 2 * np.pi * float(rng.choice([50.0, 60.0])) * bench.plan.frames
    shift = rng.uniform(0, 2 * np.pi, shape)
    return lambda x: x + amplitude * np.sin(phase[:, None, None, None, None] + shift)


def bursts(rng: Generator, bench: Bench, size: float) -> Run:
    """Bursts of noise of 0.1 to 0.4 s on some rows, as of a loose plug, twenty to forty in a recording."""
    frames, (pads, rows, cols) = bench.plan.frames, bench.shape
    loud = np.zeros((len(frames), pads, 1, rows, 1))
    for _ in range(int(rng.integers(20, 41))):
        start, where = rng.choice(frames), rng.integers(rows)
        loud[(frames >= start) & (frames < start + rng.uniform(0.1, 0.4)), rng.integers(pads), :, where] = 1
    noise = bench.count * between(2, 12, size) * rng.normal(size=(len(frames), pads, 3, rows, cols))
    return lambda x: x + loud * noise


def mullins(rng: Generator, bench: Bench, size: float) -> Run:
    """Filled rubber softens below the largest load it ever had (Mullins): y = x (1 - d (1 - |x| / largest))."""
    depth = between(0.1, 0.5, size)

    def run(x: Array) -> Array:
        load = np.abs(x) / bench.reaches
        largest = np.maximum.accumulate(load, axis=0)
        return x * (1 - depth * (largest - load) / (largest + 0.05))

    return run


def speed_gain(rng: Generator, bench: Bench, size: float) -> Run:
    """Gain that depends on the speed of loading, equally on the way up and down."""
    depth, speed = between(0.08, 0.5, size), rng.uniform(1, 3)  # of the reach per second

    def run(x: Array) -> Array:
        rate = np.abs(np.gradient(uniform_filter1d(x[:, :, 2:], 11, axis=0), 1 / FINE, axis=0)) / bench.reach[2]
        return x * (1 - depth * (np.tanh(rate / speed) - 0.3))

    return run


def row_scan(rng: Generator, bench: Bench, size: float) -> Run:
    """Rows are read one after the other and stamped as one frame: delays of +-10 to +-60 ms, 0 on average."""
    delay = between(0.01, 0.06, size) * np.linspace(-1, 1, bench.shape[1]) * either(rng)

    def run(x: Array) -> Array:
        y = np.empty_like(x)
        at = np.arange(len(x)) / FINE
        for row, late in enumerate(delay):
            i = np.clip((at - late) * FINE, 0, len(x) - 1)
            low = np.minimum(i.astype(int), len(x) - 2)
            share = (i - low)[:, None, None, None]
            y[:, :, :, row] = (1 - share) * x[low, :, :, row] + share * x[low + 1, :, :, row]
        return y

    return run


def gain_control(rng: Generator, bench: Bench, size: float) -> Run:
    """Gain control by the total force of the pad, with a lag of 0.1 to 0.5 s."""
    depth, pole = between(0.1, 0.6, size), np.exp(-1 / (FINE * rng.uniform(0.1, 0.5)))
    scale = bench.force[:, :, 2].sum(axis=(2, 3)).max()

    def run(x: Array) -> Array:
        total = x[:, :, 2].sum(axis=(2, 3)) / scale
        slow = np.asarray(lfilter([1 - pole], [1, -pole], total, axis=0))[:, :, None, None, None]
        return x * (1 + 0.3 * depth) / (1 + depth * slow)

    return run


def crossed_axes(rng: Generator, bench: Bench, size: float) -> Run:
    """Two wires are swapped between axes: x or y of one loaded taxel against z of its neighbour."""
    cols = bench.shape[2]
    pad, row, col = bench.loaded(0.5)[rng.integers(len(bench.loaded(0.5)))]
    beside = (row, col + 1) if col + 1 < cols else (row, col - 1)
    axis = int(rng.integers(2))

    def run(x: Array) -> Array:
        y = x.copy()
        y[:, pad, axis, row, col] = x[:, pad, 2, beside[0], beside[1]]
        y[:, pad, 2, beside[0], beside[1]] = x[:, pad, axis, row, col]
        return y

    return run


def hold(rng: Generator, bench: Bench, size: float) -> Run:
    """Sample and hold at 12 to 4 Hz: the stream repeats its last value; half a period early, so 0 late on average."""
    period = 1 / between(12, 4, size)
    frames = bench.plan.frames
    slot = np.floor(frames / period)
    first = _latest(np.diff(slot, prepend=-1) > 0)
    ahead = np.minimum(first + round(period * bench.plan.rate / 2), len(frames) - 1)
    return lambda x: x[ahead]


def dropped(rng: Generator, bench: Bench, size: float) -> Run:
    """Frames are lost in runs of 2 to 8 and replaced by the last one that arrived."""
    share, lost, count = between(0.1, 0.5, size), np.zeros(len(bench.plan.frames), bool), len(bench.plan.frames)
    while lost.mean() < share:
        start = int(rng.integers(1, count))
        lost[start : start + int(rng.integers(2, 9))] = True
    return lambda x: x[_latest(~lost)]


def warm_gain(rng: Generator, bench: Bench, size: float) -> Run:
    """Gain that follows the temperature by 1 to 6 % per kelvin, right on average: a magnet that weakens."""
    change = bench.plan.temperature - bench.plan.temperature.mean()
    gain = 1 - between(0.01, 0.06, size) * change[:, None, None, None, None]
    return lambda x: x * gain


def breathing(rng: Generator, bench: Bench, size: float) -> Run:
    """Gain that swings at 0.2 to 1.5 Hz, as of a bad supply."""
    wave = np.sin(2 * np.pi * rng.uniform(0.2, 1.5) * bench.plan.time + rng.uniform(0, 6))
    gain = 1 + between(0.05, 0.3, size) * wave[:, None, None, None, None]
    return lambda x: x * gain


OUTSIDERS = (
    Form("foreign", "hum", hum, digital=True),
    Form("foreign", "bursts", bursts, digital=True),
    Form("foreign", "mullins", mullins),
    Form("foreign", "speed_gain", speed_gain),
    Form("foreign", "row_scan", row_scan),
    Form("foreign", "gain_control", gain_control),
    Form("foreign", "crossed_axes", crossed_axes, sized=False),
    Form("foreign", "hold", hold, digital=True),
    Form("foreign", "dropped", dropped, digital=True),
    Form("foreign", "warm_gain", warm_gain),
    Form("foreign", "breathing", breathing),
)
