"""Silent: channels that never change though they are pressed: nothing in them is to be explained.

A sensor may measure the normal force only, and a wire or a hall element may fail alone. No gain, however small, is the
cause of a reading that is one and the same number throughout.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.problem import PRESSED, Problem

AXES = "xyz"
CLEAR = 0.6  # N, beyond any dead band
FRAMES = 8  # in which a taxel is pressed so, at least
WITHIN = 15.0  # times what is tolerated of its place, that a contact must press on a taxel to be on it
SHARE = 0.2  # of the peak, beyond any zero that readings cut below 0 hide
MOST = 8  # that are listed


def silent_channels(problem: Problem) -> NDArray[np.bool_]:
    """``(pads, 3, rows, cols)`` channels that take part, and never change where rounding or a gate would not hold them.

    Where all of a pad's axis never change, that is so of them all if other channels read forces that are half as large.
    """
    alive = problem.alive
    still = alive & (np.ptp(problem.measured, axis=0) == 0)
    if not still.any():
        return still
    pressed = pressed_beyond(problem, max(CLEAR, SHARE * problem.peak, 2 * problem.step))
    silent = still & (pressed.sum(axis=0) >= FRAMES)
    for pad, axis in np.argwhere((still | ~alive).all(axis=(2, 3)) & still.any(axis=(2, 3))):
        silent[pad, axis] |= still[pad, axis] & _is_missing(problem, int(pad), int(axis), still)
    return silent


def _is_missing(problem: Problem, pad: int, axis: int, still: NDArray[np.bool_]) -> bool:
    force = np.abs(problem.simulated)
    size = float(np.quantile(force[:, pad, axis].max(axis=(1, 2)), 0.998))
    if size <= max(2 * problem.step, PRESSED * problem.peak):
        return False
    smaller = (force > size / 4) & (force < size / 2) & ~still
    read = problem.measured != np.median(problem.measured, axis=0)
    return bool(smaller.any() and read[smaller].mean() > 0.5)


def silent_in_words(silent: NDArray[np.bool_], pads: tuple[str, ...]) -> tuple[str, ...]:
    """What to tell of channels that are left out.

    Args:
        silent: ``(pads, 3, rows, cols)``.
        pads: The pads' names.
    """
    whole = silent.all(axis=(2, 3))
    warnings = []
    if whole.any():
        axes = [" and ".join(AXES[axis] for axis in np.flatnonzero(own)) for own in whole]
        names = ", ".join(f"{own} of pad {pad}" for own, pad in zip(axes, pads, strict=True) if own)
        warnings.append(
            f"{names} never change though the simulation does: the sensor does not measure them, or they are not "
            "connected. They are left out, so nothing is said of them"
        )
    single = np.argwhere(silent & ~whole[:, :, None, None])
    if len(single):
        names = ", ".join(f"{AXES[k]} of pad {pads[p]} ({r}, {c})" for p, k, r, c in single[:MOST])
        more = f" and {len(single) - MOST} more" if len(single) > MOST else ""
        warnings.append(
            f"{names}{more} never change{'s' if len(single) == 1 else ''} though pressed: dead channels of taxels that "
            "answer otherwise. They are left out"
        )
    return tuple(warnings)


def pressed_beyond(problem: Problem, least: float) -> NDArray[np.bool_]:
    """``(T, pads, 3, rows, cols)`` where a force is larger than `least` (N), and its contact surely on the taxel."""
    variance = problem.sigma**2
    tolerated = np.sqrt(variance - variance.min(axis=0))  # large at a contact's edge, which may be beside the taxel
    return np.abs(problem.simulated) > np.maximum(least, WITHIN * tolerated)
