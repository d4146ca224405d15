"""Find the order of the taxels that places presses nearest to where they were requested."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.hw.commissioning.orientation import ORIENTATIONS, Orientation
from paxisim.layout import TaxelLayout


@dataclass(frozen=True, eq=False)
class OrderFit:
    """The layout that fits the presses best.

    Attributes:
        layout: The layout.
        refolded: True if the list of taxels first had to be cut into lines of the grid's other length.
        orientation: The correction applied to the picture after that.
        margin: How much worse the second best layout fits: difference of the mean squared distances in half extents of
            the pad. If presses at the corners are felt halfway to them, a mirrored layout is worse by about 1.5.
        felt: ``(presses, 2)`` position of each press under the best layout, as (x, y) in half extents of the pad.
    """

    layout: TaxelLayout
    refolded: bool
    orientation: Orientation
    margin: float
    felt: NDArray[np.float64]


def fit_order(layout: TaxelLayout, presses: NDArray[np.float64], asked: NDArray[np.float64]) -> OrderFit:
    """Find the layout that fits the presses best.

    The candidates for a grid are three pictures, each turned and mirrored in eight ways: the one shown by `layout`, and
    those of its list of taxels cut into rows or into columns. Points on a curved surface can only be turned and
    mirrored. A layout scores by how close the force lies, taxel by taxel, to the requested places. This penalises both
    a press in the wrong corner and a press that is torn to pieces.

    Args:
        layout: Layout that the presses were read with.
        presses: ``(presses, rows, cols)`` normal force (N) in that layout.
        asked: ``(presses, 2)`` requested positions, as (x, y) in half extents of the pad.
    """
    normal = np.abs(presses).reshape(len(presses), -1)
    if layout.vendor_order is not None:
        normal = normal[:, np.asarray(layout.vendor_order)]
    # use only force above half of the peak: on a small pad, the wide foot of a press says little about its place, and
    # the noise of many far taxels would outweigh it
    normal = np.maximum(normal - 0.5 * normal.max(axis=1, keepdims=True), 0.0)
    weights = normal / normal.sum(axis=1, keepdims=True)
    candidates = list(_candidates(layout))
    places = [_places(candidate) for candidate, _, _ in candidates]
    squared = np.array([np.sum((place[None] - asked[:, None]) ** 2, axis=-1) for place in places])
    misses = np.mean(np.sum(weights * squared, axis=-1), axis=-1)
    best, second = np.argsort(misses, kind="stable")[:2]
    found, orientation, refolded = candidates[best]
    margin = float(misses[second] - misses[best])
    return OrderFit(found, refolded, orientation, margin, weights @ places[best])


def _candidates(layout: TaxelLayout) -> Iterator[tuple[TaxelLayout, Orientation, bool]]:
    """Yield each layout that the bytes could have once, `layout` first."""
    if not layout.is_grid:
        yield from ((orientation.of_points(layout), orientation, False) for orientation in ORIENTATIONS)
        return
    # a picture holds the place of each taxel in the order of the bytes
    wire = np.arange(layout.taxels)
    own = wire if layout.vendor_order is None else np.argsort(layout.vendor_order)
    pictures = (
        own.reshape(layout.rows, layout.cols),
        wire.reshape(layout.rows, layout.cols),
        wire.reshape(layout.cols, layout.rows).T,
    )
    seen = set()
    for i, picture in enumerate(pictures):
        for orientation in ORIENTATIONS:
            turned = orientation.of_picture(picture)
            key = (turned.shape, turned.tobytes())
            if key in seen:
                continue
            seen.add(key)
            if len(seen) == 1:
                yield layout, orientation, False
                continue
            order = tuple(np.argsort(turned.ravel()).tolist())
            rows, cols = turned.shape
            along_y, along_x = layout.pitch
            pitch = (along_x, along_y) if orientation.exchanges else (along_y, along_x)
            in_order = order == tuple(range(len(order)))
            yield TaxelLayout(rows, cols, pitch, vendor_order=None if in_order else order), orientation, i > 0


def _places(layout: TaxelLayout) -> NDArray[np.float64]:
    """Return the taxel positions ``(N, 2)`` as (x, y) in half extents of the pad, in the order of the bytes."""
    points = layout.positions[:, :2]
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    half = np.abs(points).max(axis=0)
    points = points / np.where(half > 0, half, 1.0)
    return points if layout.vendor_order is None else points[np.asarray(layout.vendor_order)]
