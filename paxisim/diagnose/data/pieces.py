"""Pieces: uninterrupted stretches of a recording, processed side by side as a batch.

A transform with memory processes a recording frame by frame. Its memory does not extend from one piece to another, so
one pass over the longest piece processes all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from paxisim.augment.transform import Transform

FloatArray = NDArray[np.float64]

FINE_STEP = 0.01  # s between interpolated points
MAX_GAP = 0.15  # s; longer gaps between frames are not interpolated
_NODES = 4
BLOCK_VALUES = 40_000  # values per block


class Pieces:
    """Pieces of a recording, in groups of similar length."""

    def __init__(self, time: NDArray[np.float64], spans: Sequence[slice], between: bool = False) -> None:
        """Lay out the pieces.

        Args:
            time: ``(T,)`` seconds.
            spans: The frames of each piece.
            between: Whether to interpolate between the frames, see `curve_through`.
        """
        # interpolated pieces and others apart, and pieces of equal length within a factor of 2 together
        alike: dict[tuple[int, int], list[tuple[slice, Curve]]] = {}
        for span in spans:
            curve = curve_through(time[span]) if between else at_frames(time[span])
            alike.setdefault((curve.nodes.shape[1], len(curve.time).bit_length()), []).append((span, curve))
        self._groups = [_Group(members, len(time)) for members in alike.values()]

    def run(
        self, transform: Transform, x: NDArray[np.floating], covariates: Mapping[str, NDArray[np.float64]]
    ) -> NDArray[np.floating]:
        """Run a transform on the sequence `x`, restarting it for each piece.

        Args:
            transform: Transform with memory.
            x: ``(T, pads, 3, rows, cols)`` newtons.
            covariates: ``(T, ...)`` by name; empty if frames are interpolated.
        """
        out = np.empty_like(x)
        for group in self._groups:
            given = {name: group.beside(values) for name, values in covariates.items()}
            made = transform.run(group.beside(x), group.time, given)
            out[group.frames] = made.reshape(-1, *x.shape[1:])[group.own]
        return out


class _Group:
    """Pieces side by side, padded to one length.

    A piece is padded with its last frame while time continues. The padding follows the piece and cannot affect it.

    Attributes:
        time: ``(length, pieces)`` seconds.
        frames: Frames of the recording that belong to the pieces.
        own: Their places among the ``length * pieces`` points.
    """

    def __init__(self, pieces: Sequence[tuple[slice, Curve]], count: int) -> None:
        """Lay out pieces of a recording of `count` frames."""
        length, width = max(len(curve.time) for _, curve in pieces), len(pieces)
        self.time = np.stack([_longer(curve.time, length) for _, curve in pieces], axis=1)
        self.frames = np.concatenate([np.arange(span.start, span.stop) for span, _ in pieces])
        self.own = np.concatenate([curve.own * width + place for place, (_, curve) in enumerate(pieces)])
        padded = [np.minimum(np.arange(length), len(curve.time) - 1) for _, curve in pieces]
        together = list(zip(padded, pieces, strict=True))
        self._nodes = np.stack([span.start + curve.nodes[at] for at, (span, curve) in together], axis=1)
        weights = np.stack([curve.weights[at] for at, (_, curve) in together], axis=1)
        starts = np.arange(0, weights.size + 1, weights.shape[-1])
        matrix = csr_array((weights.ravel(), self._nodes.ravel(), starts), shape=(length * width, count))
        self._weights = {np.dtype(kind): matrix.astype(kind) for kind in (np.float32, np.float64)}

    def beside(self, values: NDArray[Any]) -> NDArray[Any]:
        """``(T, ...)`` values of a recording as ``(length, pieces, ...)``."""
        if self._nodes.shape[-1] == 1:
            return values[self._nodes[..., 0]]
        points = self._weights[values.dtype] @ values.reshape(len(values), -1)
        return points.reshape(*self.time.shape, *values.shape[1:])


def _longer(time: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """Times extended at the median interval, or at 1 s for a single time."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    return np.append(time, time[-1] + step * np.arange(1, length + 1 - len(time)))


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

    Linear interpolation would cut off the peaks of fast motions, as a low-pass filter does, and a delay by half a frame
    interval, which averages neighbouring frames, would be mistaken for one. If the frames are close enough, too few or
    not in order, there is nothing between them.
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


def in_blocks(values: FloatArray, function: Callable[[slice], FloatArray]) -> FloatArray:
    """Apply a function to ``(T, ...)`` values block by block and concatenate the results.

    Args:
        values: Array that gives the shape of the result; the function is expected to close over its data.
        function: Takes a slice of frames and returns an array with the shape of `values` for that slice.
    """
    out = np.empty_like(values)
    frames = max(BLOCK_VALUES // max(values[:1].size, 1), 1)
    for start in range(0, len(values), frames):
        part = slice(start, start + frames)
        out[part] = function(part)
    return out
