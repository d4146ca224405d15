"""Outliers: where a model is far off, as at the edge of a contact that is not quite where the simulation has it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paxisim.diagnose.problem import FloatArray, Problem

FAR = 2.5  # times the noise, beyond which a sample counts less


def without_outliers(problem: Problem, prediction: FloatArray) -> Problem:
    """The problem with samples that `prediction` misses by far counting the less the farther off they are.

    A taxel that the edge of a contact crosses reads by many times its noise otherwise if the contact is a tenth of a
    millimetre off. A few such samples outweigh a small effect that all the others show.

    Args:
        problem: The recording.
        prediction: ``(T, pads, 3, rows, cols)`` newtons, with the problem's zero.
    """
    off = np.abs(problem.residual(prediction)) / FAR
    return replace(problem, sigma=problem.sigma * np.maximum(off, 1.0) ** 2)
