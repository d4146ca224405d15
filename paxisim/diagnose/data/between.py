"""Between: cubic interpolation between frames, for effects as fast as the frame rate.

Linear interpolation cuts off the peaks of fast motions, which resembles a low-pass filter. A delay by half a frame
interval, which averages neighbouring frames, would then be mistaken for one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FINE_STEP = 0.01  # s between interpolated points
MAX_GAP = 0.15  # s; longer gaps between frames are not interpolated
_NODES = 4


@dataclass(frozen=True, eq=False)
class Curve:
    """Points at and between the frames of a sequence, as weighted sums of the frames.

    Attributes:
        time: ``(M,)`` seconds, including those of the frames.
        own: ``(T,)`` indices of the frames.
        nodes: ``(M, n)`` indices of the frames that each point is made of, in order.
        weights: ``(M, n)`` weights of these frames.
    """

    time: NDArray[np.float64]
    own: NDArray[np.int64]
    nodes: NDArray[np.int64]
    weights: NDArray[np.float64]


def at_frames(time: NDArray[np.float64]) -> Curve:
    """The frames at these times (s) and no points between them."""
    own = np.arange(len(time))
    return Curve(time, own, own[:, None], np.ones((len(own), 1)))


def curve_through(time: NDArray[np.float64]) -> Curve:
    """Points between frames at these times (s), each on the cubic through the four nearest frames.

    If the frames are close enough, too few or not in order, there is nothing between them.
    """
    gaps = np.diff(time)
    parts = np.where(gaps < MAX_GAP, np.maximum(np.round(gaps / FINE_STEP), 1), 1).astype(int)
    if len(time) < _NODES or gaps.min() <= 0 or parts.max() == 1:
        return at_frames(time)
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
    return Curve(points, own, nodes, weights)
