"""Crosstalk: neighbouring taxels read part of each other's load."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.constant import constant, layout_text, read_layout
from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout

NEXT = 1.2
"""Largest distance at which a taxel counts as a nearest neighbour, in pitches."""


@dataclass(frozen=True, eq=False)
class Crosstalk(Transform):
    """Taxels exchange part of their load, more the closer they are.

    With the distance d_ij between taxels i and j in pitches::

        y_k(i) = x_k(i) + strength_k sum_j w(d_ij) (x_k(j) - taken x_k(i))        w(d) = exp((1 - max(d, 1)) / length)

    The gel is one sheet: load on one taxel also moves the magnets beside it. ``strength`` is the share that a nearest
    neighbour receives. Beyond the nearest neighbours, w is multiplied by ``far``, because one kernel seldom fits both.
    Each axis is treated independently; `Poisson` models shear caused by normal force.

    - With ``taken = 1`` the force is conserved exactly: what one taxel gains, another loses. A uniform load is
      unchanged, also at the edge, because nothing is exchanged across it.
    - A magnet that the adjacent sensor also detects adds to that sensor's reading and takes from none: ``taken = 0``.
      This differs from ``taken = 1`` only by a gain in the interior, but not at the edge.
    - On a grid, neighbours are one pitch apart along both axes. Otherwise offsets are divided by the pitch along each
      axis of a taxel's frame, as in `Poisson`, with the mean of both taxels' squared distances. Forces are exchanged in
      the pad frame.

    Source: a fitted mixing matrix of a published 4x8 u-skin-like array, where nearest neighbours receive 0.13 (shear)
    and 0.06 (normal) on average, with both signs; hence negative values are allowed. The kernel's form is ours.

    Attributes:
        strength: ``(..., 3)`` share of x, y and z that a neighbour one pitch away receives.
        length: ``(...)`` distance over which the share decays by a factor of e (pitches).
        far: ``(...)`` factor on the share beyond the nearest neighbours, more than `NEXT` pitches away.
        taken: ``(...)`` share of what its neighbours receive that a taxel loses, 0 to 1.
        layout: Layout of the taxels, if they are not on a grid.
    """

    stage: ClassVar[str] = "gel"

    strength: Any = parameter((0.0, 0.0, 0.0), "k", low=-0.5, high=0.5, typical=(0.01, 0.12))
    length: Any = parameter(0.5, low=0.05, high=20.0, typical=(0.3, 1.0))
    far: Any = parameter(1.0, low=0.0, high=10.0, typical=(0.5, 2.0))
    taken: Any = parameter(1.0, low=0.0, high=1.0, typical=(0.0, 1.0))
    layout: TaxelLayout | None = None

    # set on each instance, but not a field
    _positions: ClassVar[str | None]

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        on_grid = self.layout is None or self.layout.is_grid
        object.__setattr__(self, "_positions", None if on_grid else layout_text(self.layout))  # type: ignore[arg-type]

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        rows, cols = x.shape[-2:]
        if self.layout is not None and (rows, cols) != (self.layout.rows, self.layout.cols):
            raise InvalidValueError(
                f"Crosstalk: layout has {self.layout.rows}x{self.layout.cols} taxels, the tensor {rows}x{cols}"
            )
        distance, near, beyond = (constant(_distances, (rows, cols, self._positions), x)[part] for part in range(3))
        # without the last dimension of a parameter the weights are (*batch, 1, N, N)
        length, far = self.broadcast_parameter("length", x)[..., 0], self.broadcast_parameter("far", x)[..., 0]
        weights = xp.exp((1 - distance) / length) * (near + far * beyond)
        force = xp.reshape(x, (*x.shape[:-2], rows * cols))
        if weights.ndim == 3:  # shared by the whole batch: a single matrix product
            gained = xp.reshape(xp.reshape(force, (-1, rows * cols)) @ weights[0], force.shape)
        else:
            gained = force @ weights
        exchanged = (
            gained - self.broadcast_parameter("taken", x)[..., 0] * force * xp.sum(weights, axis=-1)[..., None, :]
        )
        return x + self.broadcast_parameter("strength", x) * xp.reshape(exchanged, (*exchanged.shape[:-1], rows, cols))


def _distances(rows: int, cols: int, positions: str | None) -> NDArray[np.floating]:
    """``(3, N, N)``: distances in pitches, at least 1; mask of nearest neighbours; mask of those beyond."""
    layout = TaxelLayout(rows, cols, (1.0, 1.0)) if positions is None else read_layout(positions)
    pitch = np.array([layout.pitch[1], layout.pitch[0], math.sqrt(layout.pitch[0] * layout.pitch[1])])
    offsets = layout.positions[:, None] - layout.positions[None, :]
    squared = np.sum((np.einsum("jia,iab->jib", offsets, layout.frames) / pitch) ** 2, axis=-1)
    distance = np.sqrt((squared + squared.T) / 2)
    beyond = distance > NEXT
    return np.stack([np.maximum(distance, 1.0), ~beyond & ~np.eye(rows * cols, dtype=bool), beyond])
