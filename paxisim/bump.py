"""GaussianBump: the uneven surface of the paper's GCS (its G), as taxel heights, independent of a simulator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from array_api_compat import array_namespace, device
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout

DEVIATION_RANGE = (1.0, 3.0)
"""Bounds of the bump's deviations, in taxels (paper, Table I)."""


@dataclass(frozen=True)
class GaussianBump:
    """The paper's surface: cube depth grows with the distance from a centre (Method, "Surface with Gaussian Bumps").

    The depth is ``h = h_min + D / max(D) * (h_max - h_min)`` with
    ``D = sqrt((g_x - x)^2 / s_x^2 + (g_y - y)^2 / s_y^2)``, reduced by `boundary` for taxels on the grid's edge.
    Taxel (row, col) has ``x = col + 0.5, y = row + 0.5``, so that [0, cols] x [0, rows] is the paper's
    domain (its [0, 5] x [0, 6] on the 6x5 grid) with the taxels centred in it. Because D is divided by its maximum,
    only the ratio of the deviations matters.

    Attributes:
        center: ``(g_x, g_y)`` in taxels, x along the columns.
        deviation: ``(s_x, s_y)`` in taxels.
        h_min: Depth at the centre (m). The paper does not specify `h_min`, `h_max` and `boundary`. Ours give a bump of
            0.2 mm around its nominal 1 mm. This is of the order of the indentation of the default gel (0.3 mm under
            5 N on the paper's pad), so a flat load reaches most taxels, very unevenly.
        h_max: Depth at the taxel furthest from the centre (m).
        boundary: Depth subtracted from edge taxels (m). The default is half the bump, so that the edge reads less, as
            the paper observes. If the depth is a recess, the edge protrudes by this amount instead and reads more.
        depth_is: Meaning of the paper's "depth": ``"thickness"`` of the cube (its cubes are W x H x D), which makes the
            centre a dip, or ``"recess"``, which makes the centre a bump of the same range, with a thickness of
            ``h_min + h_max`` minus the depth.

    Raises:
        InvalidValueError: A value is not finite, a depth or deviation is not positive, `h_max` is below `h_min`,
            `boundary` is outside ``[0, h_min)``, or `depth_is` is unknown.
    """

    center: tuple[float, float]
    deviation: tuple[float, float] = (2.0, 2.0)
    h_min: float = 0.9e-3
    h_max: float = 1.1e-3
    boundary: float = 0.1e-3
    depth_is: Literal["thickness", "recess"] = "thickness"

    def __post_init__(self) -> None:
        """Check the values."""
        values = [*self.center, *self.deviation, self.h_min, self.h_max, self.boundary]
        if not np.all(np.isfinite(values)):
            raise InvalidValueError(f"a bump's parameters must be finite, got {self}")
        if min(self.deviation) <= 0 or not 0 < self.h_min <= self.h_max:
            raise InvalidValueError(
                f"a bump needs positive deviations and 0 < h_min <= h_max, got {self.deviation}, "
                f"{self.h_min:g} and {self.h_max:g}"
            )
        if not 0 <= self.boundary < self.h_min:
            raise InvalidValueError(f"boundary must lie in [0, h_min), got {self.boundary:g}")
        if self.depth_is not in ("thickness", "recess"):
            raise InvalidValueError(f"depth_is must be 'thickness' or 'recess', got {self.depth_is!r}")

    @classmethod
    def sample(cls, layout: TaxelLayout, rng: np.random.Generator, **fixed: Any) -> GaussianBump:
        """Draw a bump as in the paper: the centre uniform over the grid, the deviations from U(1, 3) (Table I).

        Args:
            layout: Layout of the taxels.
            rng: Random number generator.
            **fixed: Fields to fix instead of the drawn or default values, e.g. ``h_max=1.2e-3``.
        """
        drawn: dict[str, Any] = {
            "center": tuple(rng.uniform(0, [layout.cols, layout.rows])),
            "deviation": tuple(rng.uniform(*DEVIATION_RANGE, size=2)),
        }
        return cls(**(drawn | fixed))

    def heights(self, layout: TaxelLayout) -> NDArray[np.floating]:
        """Return the cube thickness (m), ``(rows, cols)``.

        Layouts without a grid use their positions, in units of the pitch from the upper left corner, and have
        no boundary.
        """
        return bump_heights(self, layout, np.array(self.center), np.array(self.deviation))


def bump_heights(bump: GaussianBump, layout: TaxelLayout, center: Any, deviation: Any) -> Any:
    """Return the heights of many bumps with their own centres and deviations and the other fields of `bump`.

    Args:
        bump: Bump that gives the depths.
        layout: Layout of the taxels.
        center: ``(..., 2)`` centres in taxels, an array of numpy or torch.
        deviation: ``(..., 2)`` deviations in taxels, of the same kind.

    Returns:
        ``(..., rows, cols)`` thickness (m), as from `GaussianBump.heights`; of the same library, on the same device.
    """
    xp = array_namespace(center, deviation)
    is_grid = layout.rows > 1 and layout.cols > 1
    x, y = (xp.asarray(own, dtype=center.dtype, device=device(center)) for own in _taxel_coordinates(layout, is_grid))
    gx, gy = center[..., 0, None, None], center[..., 1, None, None]
    sx, sy = deviation[..., 0, None, None], deviation[..., 1, None, None]
    distance = xp.sqrt((gx - x) ** 2 / sx**2 + (gy - y) ** 2 / sy**2)
    furthest = xp.max(distance, axis=(-2, -1), keepdims=True)
    share = distance / xp.where(furthest > 0, furthest, xp.ones_like(furthest))
    depth = bump.h_min + share * (bump.h_max - bump.h_min)
    if is_grid:
        edge = np.ones(depth.shape[-2:])
        edge[1:-1, 1:-1] = 0
        depth = depth - bump.boundary * xp.asarray(edge, dtype=depth.dtype, device=device(depth))
    if bump.depth_is == "thickness":
        return depth
    return bump.h_min + bump.h_max - depth


def _taxel_coordinates(layout: TaxelLayout, is_grid: bool) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    if is_grid:
        rows, cols = np.indices((layout.rows, layout.cols))
        return cols + 0.5, rows + 0.5
    corner = layout.positions.min(axis=0)
    x, y = ((layout.positions - corner)[:, :2] / [layout.pitch[1], layout.pitch[0]] + 0.5).T
    shape = (layout.rows, layout.cols)
    return x.reshape(shape), y.reshape(shape)
