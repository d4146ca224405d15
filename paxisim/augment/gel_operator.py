"""GelOperator: what the soft layer makes of the loads on neighbouring taxels, in any direction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.constant import constant, layout_text, read_layout
from paxisim.augment.modes import each_mode
from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, Transform
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout

DISTANCES = {2: (1.0, math.sqrt(2), 2.0), 5: (1.0, math.sqrt(2), 2.0, math.sqrt(5), math.sqrt(8), 3.0)}
"""Distances (pitches) of the values of one ring (2 values) and of two rings (5), and where the last falls to zero."""
KINDS = ("shear", "along", "poisson", "lift", "normal")
"""What a neighbour's load causes, each with a value for every distance."""
SKEWED = ("shear_skew", "poisson_skew")
"""Half the differences of `shear` and of `poisson` between x and y."""
LOST = ("shear", "shear_skew", "normal")
"""Kinds by which a neighbour reads a load on the same axis, of which the loaded taxel may lose as much."""


@dataclass(frozen=True, eq=False)
class GelOperator(Transform):
    """Every taxel reads part of the loads on its neighbours, as a layer without a preferred direction allows.

    With s the shear (x, y) and n the normal force (z) of a load, d the distance from taxel j to taxel i (pitches) and e
    the unit vector from j to i::

        y_s(i) = (1 + own_shear) s(i)  + sum_j [shear(d) s(j) + along(d) e (e . s(j)) + poisson(d) e n(j)]
        y_n(i) = (1 + own_normal) n(i) + sum_j [lift(d) e . s(j) + normal(d) n(j)]

    These are all linear maps from forces to readings that turn with the layer and are the same in a mirror: one ring of
    neighbours has 12 numbers, two rings have 27. In the words of the field:

    - ``poisson``: shear from a neighbour's normal load, the Poisson effect; positive where a load pushes the gel away.
    - ``normal``: normal force from neighbours, crosstalk.
    - ``along`` and ``shear``: shear from a neighbour's shear, most of it along the line between the two.
    - ``lift``: normal force from a neighbour's shear.

    A sensor whose x and y differ, or the paper's Poisson effect with two strengths, also has ``shear_skew`` and
    ``poisson_skew``: what is added to the reading of x and subtracted from that of y.

    The values are given at the distances of a grid's neighbours: M = 2 at 1 and sqrt(2) pitches, M = 5 also at 2,
    sqrt(5) and sqrt(8); M = 1 is one value at all distances. In between they are interpolated linearly, and from the
    last they fall to zero at the next distance of a grid. Off the grid, distances and directions are those of the
    actual positions, forces are taken in each taxel's frame (`TaxelLayout.frames`), and the reading is turned back into
    the pad frame.

    `Poisson` is the paper's operator, with one of these kinds only; `Crosstalk` treats each axis on its own. A layer in
    which magnets move needs all kinds: see `paxisim.nominal_operator`.

    Attributes:
        own_shear: ``(...)`` change of a taxel's own gain for shear.
        own_normal: ``(...)`` change of a taxel's own gain for normal force.
        shear: ``(..., M)`` shear by a neighbour's shear, in any direction.
        along: ``(..., M)`` shear by that part of a neighbour's shear that points from it to the taxel.
        poisson: ``(..., M)`` shear away from a neighbour by its normal force.
        lift: ``(..., M)`` normal force by a neighbour's shear towards the taxel.
        normal: ``(..., M)`` normal force by a neighbour's normal force.
        shear_skew: ``(..., M)`` half the difference of `shear` between x and y.
        poisson_skew: ``(..., M)`` half the difference of `poisson` between x and y.
        taken: ``(...)`` share of what its neighbours read on the same axis (`shear` and `normal`) that a taxel itself
            does not read: 0 if it was calibrated alone, 1 under flat presses. Taxels at the edge lose less.
        layout: Layout of the taxels, if they are not on a grid. On a grid, neighbours are one pitch apart along both
            axes.

    Raises:
        InvalidValueError: Also if M is not 1, 2 or 5, or 2 in one kind and 5 in another.
    """

    stage: ClassVar[str] = "gel"

    own_shear: Any = parameter(0.0, low=-1.0, high=10.0, typical=(-0.3, 0.1))
    own_normal: Any = parameter(0.0, low=-1.0, high=10.0, typical=(-0.3, 0.1))
    shear: Any = parameter((0.0,), "m", low=-2.0, high=2.0, typical=(-0.15, 0.0))
    along: Any = parameter((0.0,), "m", low=-2.0, high=2.0, typical=(0.5, 0.9))
    poisson: Any = parameter((0.0,), "m", low=-2.0, high=2.0, typical=(0.1, 0.4))
    lift: Any = parameter((0.0,), "m", low=-2.0, high=2.0, typical=(-0.2, 0.0))
    normal: Any = parameter((0.0,), "m", low=-2.0, high=2.0, typical=(-0.1, 0.1))
    shear_skew: Any = parameter((0.0,), "m", low=-2.0, high=2.0, typical=(-0.05, 0.05))
    poisson_skew: Any = parameter((0.0,), "m", low=-2.0, high=2.0, typical=(-0.1, 0.1))
    taken: Any = parameter(0.0, low=0.0, high=1.0, typical=(0.0, 1.0))
    layout: TaxelLayout | None = None

    # set on each instance, but not fields
    _positions: ClassVar[str | None]
    _distances: ClassVar[int]

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        kinds = (*KINDS, *SKEWED)
        counts = {np.shape(getattr(self, kind))[-1] for kind in kinds} - {1}
        if len(counts) > 1 or not counts <= DISTANCES.keys():
            raise InvalidValueError(
                "GelOperator: each kind needs values for the same 2 or 5 distances, or one value, got "
                + ", ".join(f"{kind} {tuple(np.shape(getattr(self, kind)))}" for kind in kinds)
            )
        on_grid = self.layout is None or self.layout.is_grid
        object.__setattr__(self, "_positions", None if on_grid else layout_text(self.layout))  # type: ignore[arg-type]
        object.__setattr__(self, "_distances", max(counts, default=2))

    @classmethod
    def fitted(
        cls,
        force: NDArray[np.floating],
        reading: NDArray[np.floating],
        *,
        rings: int = 1,
        layout: TaxelLayout | None = None,
    ) -> GelOperator:
        """Return the operator without skew that turns forces into readings with the least squared error.

        Args:
            force: ``(..., 3, rows, cols)`` forces on the taxels (N).
            reading: What the sensor reads of them (N), of the same shape, without an offset.
            rings: Rings of neighbours, 1 or 2.
            layout: Layout of the taxels, if they are not on a grid.

        Raises:
            InvalidValueError: The shapes differ, `rings` is neither 1 nor 2, or a value is not finite.
        """
        force, reading = np.asarray(force, dtype=np.float64), np.asarray(reading, dtype=np.float64)
        if force.shape != reading.shape or force.ndim < 3 or force.shape[-3] != 3:
            raise InvalidValueError(
                "GelOperator.fitted: expected forces and readings of one shape (..., 3, rows, cols), got "
                f"{force.shape} and {reading.shape}"
            )
        if rings not in (1, 2):
            raise InvalidValueError(f"GelOperator.fitted: rings must be 1 or 2, got {rings!r}")
        if not (np.isfinite(force).all() and np.isfinite(reading).all()):
            raise InvalidValueError("GelOperator.fitted: forces and readings must be finite; leave out unknown frames")
        distances = 2 if rings == 1 else 5
        off_grid = None if layout is None or layout.is_grid else layout
        positions = None if off_grid is None else layout_text(off_grid)
        rows, cols = force.shape[-2:]
        basis = operator_basis(rows, cols, distances, positions)[: 2 + len(KINDS) * distances]
        flat, added = force.reshape(-1, basis.shape[1]), (reading - force).reshape(-1, basis.shape[1])
        # normal equations, as the columns of all frames together would not fit into memory
        moments, towards = flat.T @ flat, flat.T @ added
        turned = np.einsum("jk,nki->nji", moments, basis)
        gram = np.einsum("aji,bji->ab", basis, turned)
        right = np.einsum("aji,ji->a", basis, towards)
        found = np.linalg.lstsq(gram, right, rcond=1e-12)[0]
        values = {kind: tuple(found[2 + k * distances :][:distances].tolist()) for k, kind in enumerate(KINDS)}
        return cls(float(found[0]), float(found[1]), **values, layout=off_grid)

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        rows, cols = x.shape[-2:]
        if self.layout is not None and (rows, cols) != (self.layout.rows, self.layout.cols):
            raise InvalidValueError(
                f"GelOperator: layout has {self.layout.rows}x{self.layout.cols} taxels, the tensor {rows}x{cols}"
            )
        own = [self.broadcast_parameter(name, x)[..., 0, 0, 0] for name in ("own_shear", "own_normal", "taken")]
        names = (*KINDS, *SKEWED)
        kinds = [self.broadcast_parameter(kind, each_mode(x))[..., 0, 0, 0, 0] for kind in names]
        lost = [own[2] * kinds[names.index(kind)] for kind in LOST]
        numbers = (*own[:2], *kinds, *lost)
        batch = xp.broadcast_arrays(*(part[..., 0] for part in numbers))[0].shape
        lengths = (1, 1, *[self._distances] * (len(kinds) + len(lost)))
        parts = [xp.broadcast_to(part, (*batch, length)) for part, length in zip(numbers, lengths, strict=True)]
        values = xp.concat(parts, axis=-1)
        basis = constant(operator_basis, (rows, cols, self._distances, self._positions), x)
        count, size = basis.shape[0], basis.shape[1]
        flat = xp.reshape(x, (*x.shape[:-3], size))
        if values.ndim == 1:  # shared by the whole batch: a single matrix product
            matrix = xp.reshape(values @ xp.reshape(basis, (count, size * size)), (size, size))
            moved = xp.reshape(xp.reshape(flat, (-1, size)) @ matrix, flat.shape)
        else:
            added = (flat[..., None, None, :] @ basis)[..., 0, :]  # (*batch, pads, numbers, size)
            moved = (values[..., None, None, :] @ added)[..., 0, :]
        return x + xp.reshape(moved, (*moved.shape[:-1], 3, rows, cols))


def operator_basis(rows: int, cols: int, distances: int, positions: str | None = None) -> NDArray[np.floating]:
    """Return what each of an operator's numbers adds to the reading, as matrices from forces to readings.

    Args:
        rows: Rows of taxels.
        cols: Columns of taxels.
        distances: Number of distances, 2 or 5.
        positions: `layout_text` of a layout that is not a grid.

    Returns:
        ``(numbers, 3 N, 3 N)``: own_shear, own_normal, then the values of each of `KINDS` and `SKEWED` by distance,
        then what the loaded taxel loses by each of `LOST`. Rows are forces, columns readings, both with components
        before taxels as in the tensor.
    """
    layout = TaxelLayout(rows, cols, (1.0, 1.0)) if positions is None else read_layout(positions)
    pitch = np.array([layout.pitch[1], layout.pitch[0], math.sqrt(layout.pitch[0] * layout.pitch[1])])
    frames, count = layout.frames, layout.taxels
    offsets = layout.positions[None, :] - layout.positions[:, None]  # [j, i]: from taxel j to taxel i
    seen_from = [np.einsum("jia,iab->jib", offsets, frames) / pitch, np.einsum("jia,jab->jib", offsets, frames) / pitch]
    distance = np.sqrt(np.mean([np.sum(one**2, axis=-1) for one in seen_from], axis=0))
    to_i, to_j = (_directions(one[..., :2]) for one in seen_from)
    weights = _hats(distance, DISTANCES[distances])  # (distances, j, i)
    # [force component, reading component, j, i] in the frames of the taxels
    alone = np.eye(count)
    local = np.zeros((2 + (len(KINDS) + len(SKEWED) + len(LOST)) * distances, 3, 3, count, count))
    local[0, 0, 0] = local[0, 1, 1] = local[1, 2, 2] = alone
    shear, along, poisson, lift, normal, *skewed, shear_lost, skew_lost, normal_lost = local[2:].reshape(
        -1, distances, *local.shape[1:]
    )
    shear[:, 0, 0] = shear[:, 1, 1] = weights
    normal[:, 2, 2] = weights
    for a in range(2):
        poisson[:, 2, a] = weights * to_i[..., a]
        lift[:, a, 2] = weights * to_j[..., a]
        for b in range(2):
            along[:, a, b] = weights * to_j[..., a] * to_i[..., b]
    for skew, kind in zip(skewed, (shear, poisson), strict=True):
        skew[:, :, 0], skew[:, :, 1] = kind[:, :, 0], -kind[:, :, 1]
    for lost, kind in zip((shear_lost, skew_lost, normal_lost), (shear, skewed[0], normal), strict=True):
        lost[:] = -kind.sum(axis=-1, keepdims=True) * alone
    matrices = np.einsum("jpa,nabji,iqb->npjqi", frames, local, frames)
    return matrices.reshape(len(local), 3 * count, 3 * count)


def _directions(offsets: NDArray[np.floating]) -> NDArray[np.floating]:
    lengths = np.linalg.norm(offsets, axis=-1, keepdims=True)
    return np.divide(offsets, lengths, out=np.zeros_like(offsets), where=lengths > 1e-9)


def _hats(distance: NDArray[np.floating], knots: tuple[float, ...]) -> NDArray[np.floating]:
    """Return the weight of each knot but the last at each distance; closer than the first it is 1, at 0 it is 0."""
    nearer = np.maximum(distance, knots[0])
    hats = np.stack([np.interp(nearer, knots, np.eye(len(knots))[k]) for k in range(len(knots) - 1)])
    return np.where(distance > 1e-9, hats, 0.0)
