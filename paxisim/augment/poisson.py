"""Poisson: a pressed gel bulges sideways and shears its neighbours (the C of the paper's GCS)."""

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

_SLACK = 1e-3  # pitches; a taxel that is off its place by less changes nothing much


@dataclass(frozen=True, eq=False)
class Poisson(Transform):
    """Shear caused by normal force on neighbouring taxels: a loaded neighbour pushes the gel away from itself.

    Pressed gel gives way sideways and carries the magnets along, so the sensor reads spurious shear. The paper
    convolves the normal force with one antisymmetric kernel for each direction (Method, "Convolution for Poisson
    Effect"; Table I draws c from U(0.1, 0.3)) and does not specify the kernels. Ours, at taxel i::

        y_x(i) = x_x(i) + cx sum_j w(d_ij) u_ij x_z(j)        w(d) = exp(-(d - 1) / falloff) / W for 0 < d <= reach

    and likewise in y. d_ij is the distance in pitches and u_ij the x component of the unit vector from j to i: a loaded
    taxel pushes its right neighbour to +x and the lower one to +y. By default the kernel is 3x3, similar to a Sobel
    kernel.

    - W makes ``c`` dimensionless: a taxel with 1 N on every taxel of its surroundings on one side, along x, and nothing
      on the other side, reads a shear of cx newtons. W is that of a wide grid, also at the rim and off the grid.
    - A uniform load causes no shear in the interior. There is no load beyond the edge, so the rim is pushed outward; a
      load that is not near the rim adds no total shear.
    - The transform is linear: a negative normal force pulls.
    - All pads of an environment share one ``c``, as they are of one product.

    Off the grid, the actual positions are used: the load is the force along a taxel's normal, and directions lie in its
    tangent plane, with x and y as in `TaxelLayout.frames`. The shear is then rotated back into the pad frame.

    Attributes:
        cx: ``(...)`` shear along x as a fraction of the load on one side.
        cy: ``(...)`` shear along y, likewise.
        reach: Reach of a load, in pitches: 1.5 gives a kernel of 3x3 taxels, 2.9 one of 5x5.
        falloff: Distance, in pitches, over which the effect decays by a factor of e.
        layout: Layout of the taxels, if they are not on a grid. On a grid, neighbours are one pitch apart along both
            axes.

    Raises:
        InvalidValueError: Also if `reach` is below 1, or `falloff` is not positive.
    """

    stage: ClassVar[str] = "gel"

    cx: Any = parameter(0.0, low=0.0, typical=(0.1, 0.3))
    cy: Any = parameter(0.0, low=0.0, typical=(0.1, 0.3))
    reach: float = 1.5
    falloff: float = 1.0
    layout: TaxelLayout | None = None

    # set on each instance, but not fields
    _positions: ClassVar[str | None]
    _is_flat: ClassVar[bool]

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        if not 1 <= self.reach < math.inf:
            raise InvalidValueError(f"Poisson: reach must be at least 1 pitch and finite, got {self.reach!r}")
        if not self.falloff > 0:
            raise InvalidValueError(f"Poisson: falloff must be positive, got {self.falloff!r}")
        off_grid = None if self.layout is None or self.layout.is_grid else self.layout
        object.__setattr__(self, "_positions", None if off_grid is None else layout_text(off_grid))
        object.__setattr__(self, "_is_flat", off_grid is None or bool(np.all(off_grid.normals[:, 2] == -1)))

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        xp = namespace(x)
        rows, cols = x.shape[-2:]
        if self.layout is not None and (rows, cols) != (self.layout.rows, self.layout.cols):
            raise InvalidValueError(
                f"Poisson: layout has {self.layout.rows}x{self.layout.cols} taxels, the tensor {rows}x{cols}"
            )
        kernel = constant(_kernel, (rows, cols, float(self.reach), float(self.falloff), self._positions), x)
        cx, cy = self.broadcast_parameter("cx", x), self.broadcast_parameter("cy", x)
        lead = x.shape[:-3]
        if not self._is_flat:
            push = xp.reshape(xp.reshape(x, (-1, 3 * rows * cols)) @ kernel, (*lead, 2, 3, rows, cols))
            return x + cx * push[..., 0, :, :, :] + cy * push[..., 1, :, :, :]
        # loads are along z, pushes along x and y
        load = xp.reshape(x[..., 2, :, :], (-1, rows * cols))
        push = xp.reshape(load @ kernel, (*lead, 2, rows, cols))
        if cx.shape != cy.shape:
            cx, cy = xp.broadcast_arrays(cx, cy)
        shear = x[..., :2, :, :] + xp.concat([cx, cy], axis=-3) * push
        z = x[..., 2:, :, :]
        if shear.shape[:-3] != lead:  # more environments than frames
            z = xp.broadcast_to(z, (*shear.shape[:-3], 1, rows, cols))
        return xp.concat([shear, z], axis=-3)


def _kernel(rows: int, cols: int, reach: float, falloff: float, positions: str | None = None) -> NDArray[np.floating]:
    """Return the kernels of all taxels as a matrix.

    Returns:
        ``(N, 2 N)`` matrix from loads to pushes along x, then y. If normals differ, ``(3 N, 6 N)`` from forces in the
        pad frame to forces in the pad frame: first those of the pushes along each taxel's x, then y.
    """
    layout = TaxelLayout(rows, cols, (1.0, 1.0)) if positions is None else read_layout(positions)
    pitch = np.array([layout.pitch[1], layout.pitch[0], math.sqrt(layout.pitch[0] * layout.pitch[1])])
    frames = layout.frames
    # [j, i]: from taxel j to taxel i, in the frame of i
    offsets = layout.positions[None, :] - layout.positions[:, None]
    offsets = np.einsum("jia,iab->jib", offsets, frames) / pitch
    pushes = _push(offsets, reach, falloff)  # (N, N, 2)
    if np.all(layout.normals[:, 2] == -1):
        return np.concatenate([pushes[..., 0], pushes[..., 1]], axis=1)
    matrix = np.einsum("jk,jia,ila->kjali", frames[:, :, 2], pushes, frames[:, :, :2])
    return matrix.reshape(3 * layout.taxels, 6 * layout.taxels)


def _push(offsets: NDArray[np.floating], reach: float, falloff: float) -> NDArray[np.floating]:
    """Return ``w(d) u``, ``(..., 2)``, of offsets ``(..., 3)`` in pitches."""

    def push(offset: NDArray[np.floating]) -> NDArray[np.floating]:
        d = np.linalg.norm(offset, axis=-1, keepdims=True)
        felt = (d > 1e-9) & (d <= reach + _SLACK)
        d = np.where(felt, d, 1.0)
        return np.where(felt, np.exp((1 - d) / falloff) * offset[..., :2] / d, 0.0)

    span = np.arange(-math.floor(reach), math.floor(reach) + 1)
    y, x = np.meshgrid(span, span[span > 0], indexing="ij")
    one_side = push(np.stack([x, y, np.zeros_like(x)], axis=-1).astype(float))[..., 0].sum()
    return push(offsets) / one_side
