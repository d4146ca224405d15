"""Effects of a sensor's electronics on timing: low-pass filters and latency."""

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import bessel, fftconvolve, lfilter, sosfilt

from hidden.exam.world import RATE, Effect, at_times, size


def hann(force, cutoff):
    """Filter with a causal Hann window."""
    length = max(round(0.72 / cutoff * RATE), 3)
    kernel = np.hanning(length + 2)[1:-1]
    kernel = (kernel / kernel.sum()).reshape(-1, 1, 1, 1)[None]
    return fftconvolve(force, kernel, axes=1)[:, : force.shape[1]]


def cascade(force, cutoff, stages):
    """Filter with running means in series."""
    length = max(round(0.443 / cutoff / np.sqrt(stages) * RATE), 2)
    for _ in range(stages):
        force = uniform_filter1d(force, length, axis=1, origin=(length - 1) // 2, mode="nearest")
    return force


def low_pass(rng, world, strength):
    """A low-pass filter with a cut-off of 15 Hz down to 1 Hz."""
    cutoff = size(strength, 15, 1)
    form = str(rng.choice(["bessel", "hann", "one_pole", "running_means"]))
    order, stages = int(rng.integers(2, 5)), int(rng.integers(1, 4))

    def apply(force):
        rest = force[:, :1]
        moving = force - rest
        if form == "bessel":
            sections = bessel(order, cutoff, fs=RATE, norm="mag", output="sos")
            return rest + sosfilt(sections, moving, axis=1)
        if form == "one_pole":
            keep = np.exp(-2 * np.pi * cutoff / RATE)
            return rest + lfilter([1 - keep], [1, -keep], moving, axis=1)
        return rest + (hann(moving, cutoff) if form == "hann" else cascade(moving, cutoff, stages))

    truth = {"cutoff": cutoff, "form": form}
    truth |= {"bessel": {"order": order}, "running_means": {"stages": stages}}.get(form, {})
    return Effect(truth, apply)


def latency(rng, world, strength):
    """A delay of 5 to 120 ms, with or without a converter that has its own clock."""
    delay = size(strength, 0.005, 0.12)
    form = str(rng.choice(["delay", "converter"]))
    rate, phase = float(rng.choice([91.0, 176.0])), rng.random()
    time = np.arange(world.opening.shape[1]) / RATE - delay
    if form == "converter":  # the mean delay, including that of the clock, equals `delay`
        time = (np.floor((time + 0.5 / rate) * rate + phase) - phase) / rate
    return Effect({"delay": delay, "form": form}, lambda force: at_times(force, time))
