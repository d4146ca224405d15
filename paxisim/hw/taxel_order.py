"""Which order of the taxels puts presses nearest to where they were asked for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.hw.orientation import ORIENTATIONS, Orientation
from paxisim.layout import TaxelLayout


@dataclass(frozen=True, eq=False)
class OrderFit:
    """The layout that fits presses best.

    Attributes:
        layout: That layout.
        refolded: True if the list of taxels had to be cut into lines of the grid's other length first.
        orientation: What was done to the picture then.
        margin: By how much the second best layout fits worse, as the mean of squared distances in half extents of
            the pad; where presses at the corners are felt halfway to them, a mirrored layout is worse by about 1.5.
        felt: ``(presses, 2)`` where each press lies under the best layout, as (x, y) in half extents of the pad.
    """

    layout: TaxelLayout
    refolded: bool
    orientation: Orientation
    margin: float
    felt: NDArray[np.float64]


def fit_order(layout: TaxelLayout, presses: NDArray[np.float64], asked: NDArray[np.float64]) -> OrderFit:
    """Find the layout that fits presses best.

    A grid can be turned and mirrored in eight ways, of the picture that `layout` shows and of those that its list of
    taxels gives when it is cut into rows or into columns. Points on a curved surface can be turned and mirrored only.
    A layout is the better the closer the force lies, taxel by taxel, to the places asked for, so both a press
    in the wrong corner and one torn to pieces speak against it.

    Args:
        layout: The layout that the presses were read with.
        presses: ``(presses, rows, cols)`` normal force (N) in that layout.
        asked: ``(presses, 2)`` where they should be, as (x, y) in half extents of the pad.
    """
    normal = np.abs(presses).reshape(len(presses), -1)
    if layout.vendor_order is not None:
        normal = normal[:, np.asarray(layout.vendor_order)]
    # only what rises above half of the peak: the wide foot of a press on a small pad says little of where it is, and
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
    """All layouts that the bytes could have, `layout` first, each once."""
    if not layout.is_grid:
        yield from ((orientation.of_points(layout), orientation, False) for orientation in ORIENTATIONS)
        return
    # a picture holds for each taxel its place in the order of the bytes
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
    """``(N, 2)`` taxels as (x, y) in half extents of the pad, in the order of the bytes."""
    points = layout.positions[:, :2]
    points = points - (points.min(axis=0) + points.max(axis=0)) / 2
    half = np.abs(points).max(axis=0)
    points = points / np.where(half > 0, half, 1.0)
    return points if layout.vendor_order is None else points[np.asarray(layout.vendor_order)]
