"""Pieces: uninterrupted stretches of a recording, processed side by side as a batch.

A transform with memory processes a recording frame by frame. Its memory does not extend from one piece to another, so
one pass over the longest piece processes all of them.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.transform import Transform
from paxisim.diagnose.between import curve_through


class Pieces:
    """Pieces of a recording, in groups that are each padded to one length.

    A piece is padded with its last frame while time continues. The padding follows the piece and cannot affect it.
    """

    def __init__(self, time: NDArray[np.float64], spans: Sequence[slice], between: bool = False) -> None:
        """Lay out the pieces.

        Args:
            time: ``(T,)`` seconds.
            spans: The frames of each piece.
            between: Whether to interpolate between the frames, see `curve_through`.
        """
        self._curves = [curve_through(time[span]) if between else None for span in spans]
        times = [time[span] if curve is None else curve.time for span, curve in zip(spans, self._curves, strict=True)]
        self._spans = spans
        self._groups: list[tuple[list[int], NDArray[np.float64]]] = []
        alike: dict[int, list[int]] = {}  # pieces of equal length within a factor of 2
        for number, own in enumerate(times):
            alike.setdefault(len(own).bit_length(), []).append(number)
        for members in alike.values():
            length = max(len(times[number]) for number in members)
            self._groups.append((members, np.stack([_longer(times[number], length) for number in members], axis=1)))

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
        for members, time in self._groups:
            spans, curves = [self._spans[n] for n in members], [self._curves[n] for n in members]
            points = [x[span] if curve is None else curve(x[span]) for span, curve in zip(spans, curves, strict=True)]
            given = {name: _beside([c[span] for span in spans], len(time)) for name, c in covariates.items()}
            made = transform.run(_beside(points, len(time)), time, given)
            for place, (span, curve) in enumerate(zip(spans, curves, strict=True)):
                out[span] = made[: span.stop - span.start, place] if curve is None else made[curve.own, place]
        return out


def _longer(time: NDArray[np.float64], length: int) -> NDArray[np.float64]:
    """Times extended at the median interval, or at 1 s for a single time."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    return np.append(time, time[-1] + step * np.arange(1, length + 1 - len(time)))


def _beside(pieces: Sequence[NDArray[np.floating]], length: int) -> NDArray[np.floating]:
    """``(length, pieces, ...)`` values side by side; the last value of each piece is repeated."""
    out = np.empty((length, len(pieces), *pieces[0].shape[1:]), dtype=pieces[0].dtype)
    for place, own in enumerate(pieces):
        out[: len(own), place], out[len(own) :, place] = own, own[-1]
    return out


def in_one_piece(time: NDArray[np.float64], episodes: Sequence[slice]) -> tuple[slice, ...]:
    """The episodes, merged where they follow one another without a break."""
    breaks = np.diff(time, prepend=-np.inf)
    usual = 1.5 * float(np.median(breaks[1:]))
    starts = [span.start for span in episodes if not 0 < breaks[span.start] <= usual]
    return tuple(slice(a, b) for a, b in itertools.pairwise([*starts, len(time)]))
