"""Pieces: uninterrupted stretches of a recording, processed side by side as a batch.

A transform with memory processes a recording frame by frame. Its memory does not extend from one piece to another, so
one pass over the longest piece processes all of them.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from paxisim.augment.transform import Transform
from paxisim.diagnose.data.between import Curve, at_frames, curve_through


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


def in_one_piece(time: NDArray[np.float64], episodes: Sequence[slice]) -> tuple[slice, ...]:
    """The episodes, merged where they follow one another without a break."""
    breaks = np.diff(time, prepend=-np.inf)
    usual = 1.5 * float(np.median(breaks[1:]))
    starts = [span.start for span in episodes if not 0 < breaks[span.start] <= usual]
    return tuple(slice(a, b) for a, b in itertools.pairwise([*starts, len(time)]))
