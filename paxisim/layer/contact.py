"""Contact of a rigid object with a soft layer: which cells it loads, and with which forces.

The loads are those of Signorini's problem without friction: no cell is pulled, none is indented by less than the object
demands, and a cell that carries load is indented by just that (Johnson, *Contact Mechanics*, 1985, section 5.9). On
cells this is a linear complementarity problem, solved by block principal pivoting (Judice and Pires, Computers &
Operations Research 21, 1994), which ends for every positive definite matrix.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve
from scipy.optimize import brentq

from paxisim.errors import InvalidValueError

FloatArray = NDArray[np.float64]

_TOLERANCE = 1e-9  # of the indentation: smaller violations of a condition are rounding
_PATIENCE = 3  # exchanges of whole blocks that may fail to improve before cells are exchanged one by one


def indented(compliance: FloatArray, gap: FloatArray, depth: float) -> FloatArray:
    """Return the loads on the cells of a layer into which a rigid object is pressed.

    Args:
        compliance: ``(N, N)`` deflection of each cell per newton on each cell (m/N), symmetric and positive definite.
        gap: ``(N,)`` distance of the object from each cell where it first touches (m), infinite where it never does.
        depth: Distance that the object moves into the layer from there (m).

    Returns:
        ``(N,)`` loads (N), zero or positive.
    """
    wanted = np.asarray(depth - gap, dtype=np.float64)
    loaded, loads = wanted > 0, np.zeros(len(wanted))
    fewest, patience = len(wanted) + 1, _PATIENCE
    scale = float(np.max(wanted, initial=0.0))
    while True:
        loads[:] = 0
        if loaded.any():
            loads[loaded] = solve(compliance[np.ix_(loaded, loaded)], wanted[loaded], assume_a="pos")
        short = wanted - compliance @ loads
        wrong = np.where(loaded, loads < 0, short > _TOLERANCE * scale)
        count = int(wrong.sum())
        if not count:
            return loads
        if count < fewest:
            fewest, patience = count, _PATIENCE
        elif patience:
            patience -= 1
        else:
            wrong[: np.flatnonzero(wrong)[-1]] = False
        loaded ^= wrong


def pressed(compliance: FloatArray, gap: FloatArray, force: float) -> tuple[FloatArray, float]:
    """Return the loads on the cells under a rigid object that is pressed with a force and does not tilt.

    Args:
        compliance: See `indented`.
        gap: See `indented`.
        force: Force on the object (N).

    Returns:
        ``(N,)`` loads (N), which sum to the force, and the depth (m) of the object beyond where it first touches.

    Raises:
        InvalidValueError: The force is not positive and finite.
    """
    if not 0 < force < np.inf:
        raise InvalidValueError(f"expected a positive force in N, got {force!r}")
    gap = np.asarray(gap, dtype=np.float64) - np.min(gap)
    # no entry of a positive definite matrix exceeds its diagonal: the cell touched first sinks by at most this
    deepest = float(force * compliance.diagonal().max())

    def missing(depth: float) -> float:
        return float(indented(compliance, gap, depth).sum()) - force

    depth = float(brentq(missing, 0.0, 1.001 * deepest, xtol=1e-9 * deepest, rtol=1e-10))  # type: ignore[arg-type]
    loads = indented(compliance, gap, depth)
    return loads * (force / loads.sum()), depth
