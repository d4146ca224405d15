"""Streams that are no measurement of the simulated motion at all, or not in its units or on its clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from .motion import draw_plan
from .presses import Array
from .sensor import Sensor, draw_sensor

STREAMS = ("another", "shuffled", "clocks", "milli")


def broken(what: str, rng: Generator, sensor: Sensor) -> Array:
    """Return the measured tensor ``(N, pads, 3, rows, cols)`` of a broken recording.

    Args:
        what: ``another`` motion of an equal sensor; the motion's own episodes ``shuffled``; ``clocks`` that differ by
            2 s; or ``milli``, newtons written as millinewtons.
        rng: Source of all draws.
        sensor: The sensor of the recording, without effects.
    """
    measured = sensor.read()
    if what == "another":
        while True:
            plan = draw_plan(rng)
            if (plan.pads, plan.rows, plan.cols) == sensor.bench.shape:
                break
        return np.resize(draw_sensor(rng, plan).read(), measured.shape)
    if what == "shuffled":
        numbers = np.unique(sensor.bench.plan.episode)
        order = np.roll(numbers, int(rng.integers(1, len(numbers))))  # none stays in its place
        parts = [measured[sensor.bench.plan.episode == n] for n in order]
        return np.concatenate(parts)
    if what == "clocks":
        return replace(sensor, jitter=sensor.jitter + float(rng.choice([-2.0, 2.0]))).read()
    return 1000 * measured
