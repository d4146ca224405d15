"""Drift: the zero reading drifts over minutes."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.kinds import BaselineCause
from paxisim.diagnose.causes.parameters import Values
from paxisim.diagnose.data.problem import FloatArray, Problem

MIN_EPISODES = 4
MIN_SECONDS = 30.0
SHAPES = tuple(
    (tau, start)
    for start in (0.0, 60.0, 120.0, 240.0, 480.0)  # the gauge: the sensor may have been zeroed before the recording
    for tau in (60.0, 120.0, 250.0, 500.0, 1000.0, 4000.0)
    if start <= 2 * tau  # later, the drift has settled and is a constant
)

NUMBERS = {"tau": "", "start": "seconds from zeroing to the start of the recording"}


def _curve(problem: Problem, shape: Values) -> FloatArray:
    seconds = problem.time - problem.time[0]
    return -np.expm1(-(seconds + shape[1]) / shape[0])[None]


def _needs_time(problem: Problem) -> str:
    long = problem.runs_through and problem.time[-1] - problem.time[0] > MIN_SECONDS
    return (
        ""
        if long and len(problem.episodes) >= MIN_EPISODES
        else "a slow drift is visible only over several episodes on one clock"
    )


DRIFT = BaselineCause(
    name="drift",
    order=77,
    make=lambda amounts, shape, p: augment.Drift(amplitude=amounts, tau=shape[0], start=shape[1]),
    excites="sessions",
    amounts="amplitude",
    curves=_curve,
    numbers=NUMBERS,
    shapes=SHAPES,
    misfit=0.02,
    price=7.0,
    barred=_needs_time,
    words="The zero reading drifts over minutes.",
    picture="zero_in_time",
)
