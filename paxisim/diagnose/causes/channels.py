"""Channels: which channels are loaded, and which are silent."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.problem import Problem
from paxisim.diagnose.rules import CHECKS
from paxisim.logs.memory import PRESSED_SHARE


def silent_channels(problem: Problem) -> NDArray[np.bool_]:
    """``(pads, 3, rows, cols)`` channels in use that never change under forces too large for rounding or a dead band.

    A sensor may measure the normal force only, and a single wire or Hall element may fail. A gain, however small,
    cannot cause a constant reading. If no channel of a pad and axis ever changes, all of them count as silent, provided
    that other channels read forces half as large.
    """
    alive = problem.alive
    still = alive & (np.ptp(problem.measured, axis=0) == 0)
    if not still.any():
        return still
    pressed = pressed_beyond(problem, max(CHECKS.force, CHECKS.share * problem.peak, 2 * problem.noise.step))
    silent = still & (pressed.sum(axis=0) >= CHECKS.samples)
    force, reads = np.abs(problem.simulated), problem.measured != np.median(problem.measured, axis=0)
    for pad, axis in np.argwhere((still | ~alive).all(axis=(2, 3)) & still.any(axis=(2, 3))):
        size = float(force[:, pad, axis].max())
        smaller = (force > size / 4) & (force < size / 2) & ~still
        if size > max(2 * problem.noise.step, PRESSED_SHARE * problem.peak) and smaller.any():
            silent[pad, axis] |= still[pad, axis] & (reads[smaller].mean() > 0.5)
    return silent


def loaded_taxels(problem: Problem) -> NDArray[np.bool_]:
    """``(T, pads, rows, cols)`` where a normal force presses a taxel so clearly that it should respond."""
    clear = pressed_beyond(problem, max(CHECKS.pressed * problem.peak, CHECKS.force)) & (problem.simulated > 0)
    return clear[:, :, 2]


def pressed_beyond(problem: Problem, least: float) -> NDArray[np.bool_]:
    """``(T, pads, 3, rows, cols)`` where a force exceeds `least` (N) and the contact is certainly on the taxel."""
    variance = problem.noise.sigma**2
    tolerated = np.sqrt(variance - variance.min(axis=0))  # large at the edge of a contact, where it may miss the taxel
    return np.abs(problem.simulated) > np.maximum(least, CHECKS.on_taxel * tolerated)
