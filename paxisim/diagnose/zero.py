"""Zero: what a sensor reads without any force, a constant or a drift."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from paxisim.diagnose.problem import FloatArray, Problem

TAUS = (60.0, 120.0, 200.0, 350.0, 600.0, 1200.0)  # s, of a drift


@dataclass(frozen=True, eq=False)
class Zero:
    """What is read without any force.

    Attributes:
        offset: ``(pads, 3, rows, cols)`` N at the recording's first sample.
        amplitude: ``(pads, 3, rows, cols)`` N of the drift's curve ``1 - exp(-t / tau)``.
        tau: Of the drift (s).
        gain: By name of what is to be named, ``(episodes,)`` squared residual (noise units) that it takes away, fitted
            on the other episodes.
    """

    offset: FloatArray
    amplitude: FloatArray
    tau: float
    gain: Mapping[str, FloatArray]

    def at(self, time: FloatArray) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` newtons, `time` in seconds from the first sample."""
        curve = course(time, self.tau)
        return self.offset + curve[:, None, None, None, None] * self.amplitude


def nothing(problem: Problem) -> Zero:
    """No force read where there is none."""
    zeros = np.zeros(problem.alive.shape)
    return Zero(zeros, zeros, TAUS[0], {})


def course(time: FloatArray, tau: float) -> FloatArray:
    """``(T,)`` how far a drift has come, of its amplitude."""
    return -np.expm1(-time / tau)


def best_tau(explained: Callable[[float], float]) -> float:
    """The time constant (s) with which most is explained: the best of `TAUS`, or between its neighbours."""
    tried = [explained(tau) for tau in TAUS]
    best = int(np.argmax(tried))
    around = np.log([TAUS[max(best - 1, 0)], TAUS[min(best + 1, len(TAUS) - 1)]])
    found = minimize_scalar(
        lambda x: -explained(float(np.exp(x))), bounds=tuple(around), method="bounded", options={"xatol": 0.05}
    )
    return float(np.exp(found.x)) if -found.fun > tried[best] else TAUS[best]
