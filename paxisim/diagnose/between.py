"""Between: a sequence as a curve through its frames, for what is as fast as the frames themselves.

Drawn straight from frame to frame a fast motion is cut at its peaks, which looks like a low-pass; and a delay by half
the time between frames, which makes each reading of two, would be one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

FINE = 0.01  # s between the points that are put in
LONG = 0.15  # s between two frames, beyond which nothing is known of what lies between
_NODES = 4


@dataclass(frozen=True, eq=False)
class Curve:
    """Points between the frames of a sequence, each on the cubic through the four frames about it.

    Attributes:
        time: ``(M,)`` seconds, the frames' own among them.
        own: ``(T,)`` which of them are the frames'.
        weights: ``(M, T)`` of the frames in each point.
    """

    time: NDArray[np.float64]
    own: NDArray[np.int64]
    weights: csr_array

    def __call__(self, x: NDArray[np.floating]) -> NDArray[np.floating]:
        """``(T, ...)`` at the frames as ``(M, ...)`` at the points."""
        return (self.weights @ x.reshape(len(x), -1)).reshape(-1, *x.shape[1:])


def curve_through(time: NDArray[np.float64]) -> Curve | None:
    """The points between frames at these times (s); None where frames are close already, too few or out of order."""
    gaps = np.diff(time)
    if len(time) < _NODES or gaps.min() <= 0:
        return None
    parts = np.where(gaps < LONG, np.maximum(np.round(gaps / FINE), 1), 1).astype(int)
    if parts.max() == 1:
        return None
    before = np.append(np.repeat(np.arange(len(gaps)), parts), len(gaps))  # the frame before each point
    own = np.append(0, np.cumsum(parts))
    way = (np.arange(len(before)) - own[before]) / np.append(parts, 1)[before]
    points = time[before] + way * np.append(gaps, 0.0)[before]
    nodes = np.clip(before - 1, 0, len(time) - _NODES)[:, None] + np.arange(_NODES)
    at = time[nodes]
    weights = np.ones_like(at)
    for one in range(_NODES):
        for other in range(_NODES):
            if other != one:
                weights[:, one] *= (points - at[:, other]) / (at[:, one] - at[:, other])
    rows = np.repeat(np.arange(len(points)), _NODES)
    matrix = csr_array((weights.ravel(), (rows, nodes.ravel())), shape=(len(points), len(time)))
    return Curve(points, own, matrix)
