"""Contents of the live view at one moment: positions, colours and arrows of the taxels. No drawing, no I/O.

Lengths are in mm. The pads are placed side by side along x, each seen from outside (x right, y down). The simulated
pads are placed below the measured ones, and the residual below both. On a flat grid, colours and arrows are those of
`plot_pads`. On a curved pad, the normal force is the component along the taxel's own normal, and the shear is the
remainder, in three dimensions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.viz.colors import taxel_colors

_GAP = 3.0  # gap between pads in pitches, which holds the names
_SHORTEST = 0.02  # arrows shorter than this fraction of a pitch are omitted, as in `plot_pads`
_FAINTEST = 0.5  # N: lower limit of the automatic scale, so that the noise of a sensor at rest stays faint
_FADE = 10.0  # s: time constant of the automatic scale's decay after a peak


@dataclass(frozen=True, eq=False)
class Moment:
    """Tensors at one moment.

    Attributes:
        time: Time (s).
        measured: ``(pads, 3, rows, cols)`` newtons, pad frames, or None.
        simulated: The same for the simulation, or None.
    """

    time: float
    measured: NDArray[np.floating] | None = None
    simulated: NDArray[np.floating] | None = None

    def tensors(self) -> dict[str, NDArray[np.floating]]:
        """Return the available tensors by name, and ``"residual"``, measured - simulated, if both are available."""
        found = {"measured": self.measured, "simulated": self.simulated}
        tensors = {name: force for name, force in found.items() if force is not None}
        if self.measured is not None and self.simulated is not None:
            tensors["residual"] = self.measured - self.simulated
        return tensors


class Scene:
    """Arrangement of the pads in one view.

    Attributes:
        pads: Names of the pads.
        lines: Names of the tensors drawn, one line of pads each, from top to bottom.
        flat: Whether all pads are flat grids, for which two dimensions suffice.
        shape: Shape of one tensor, ``(pads, 3, rows, cols)``.
        pitch: Smallest pitch (mm), the length of an arrow at full shear.
        radius: Radius of a drawn taxel (mm).
        positions: ``(pads, N, 3)`` taxel centres (mm) in the first line.
        offsets: ``(lines, 3)`` shift of each line relative to the first (mm).
        headings: ``(pads, 3)`` positions of the pads' names (mm).
        margins: ``(lines, 3)`` positions of the lines' names (mm).
        bounds: ``(2, 2)`` smallest and largest x, y (mm) of the view, including the names.
    """

    def __init__(self, layouts: Sequence[TaxelLayout], pads: Sequence[str], tensors: Sequence[str]) -> None:
        """Arrange the pads.

        Args:
            layouts: ``(pads,)`` layouts of the same rows and columns.
            pads: ``(pads,)`` different names.
            tensors: ``"measured"``, ``"simulated"`` or both.

        Raises:
            InvalidValueError: There are no pads, the names are not unique or not one per pad, the layouts have
                different shapes, or a tensor is unknown.
        """
        if not layouts or len(layouts) != len(pads) or len(set(pads)) != len(pads):
            raise InvalidValueError(f"expected a unique name for each of {len(layouts)} pads, got {tuple(pads)}")
        if len({layout.shape for layout in layouts}) > 1:
            raise InvalidValueError("pads with different rows or columns do not fit in one tensor")
        if not tensors or not set(tensors) <= {"measured", "simulated"}:
            raise InvalidValueError(f"tensors must be 'measured', 'simulated' or both, got {tuple(tensors)}")
        both = ("measured", "simulated", "residual")
        self.lines: tuple[str, ...] = both if len(set(tensors)) == 2 else (tensors[0],)
        self.pads = tuple(pads)
        self.flat = all(layout.is_grid for layout in layouts)
        self.shape = (len(layouts), *layouts[0].shape)
        self.pitch = 1e3 * min(min(layout.pitch) for layout in layouts)
        self.radius = 0.46 * self.pitch
        self._normals = np.stack([layout.normals for layout in layouts])
        local = 1e3 * np.stack([layout.positions for layout in layouts])
        footprint = 0.5e3 * np.max([layout.pitch for layout in layouts], axis=0)[::-1]
        low, high = local[..., :2].min(axis=1) - footprint, local[..., :2].max(axis=1) + footprint
        gap = _GAP * self.pitch
        left = np.concatenate([[0.0], np.cumsum(high[:, 0] - low[:, 0] + gap)[:-1]])
        top, bottom = low[:, 1].min(), high[:, 1].max()
        self.positions = (
            local + np.stack([left - low[:, 0], np.full_like(left, -top), np.zeros_like(left)], -1)[:, None]
        )
        self.offsets = np.arange(len(self.lines))[:, None] * np.array([0.0, bottom - top + gap, 0.0])
        middle = left + (high[:, 0] - low[:, 0]) / 2
        self.headings = np.stack([middle, np.full_like(middle, -gap / 2), np.zeros_like(middle)], axis=-1)
        self.margins = self.offsets + [-gap, (bottom - top) / 2, 0.0]
        greatest = [left[-1] + high[-1, 0] - low[-1, 0] + gap, self.offsets[-1, 1] + bottom - top + gap]
        self.bounds = np.array([[-3 * gap, -2 * gap], greatest])

    def check(self, force: NDArray[np.floating]) -> None:
        """Raise `InvalidValueError` unless `force` has the shape of these pads."""
        if force.shape != self.shape:
            raise InvalidValueError(f"expected a tensor of shape {self.shape}, got {force.shape}")

    def split(self, force: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Split forces into normal and shear components.

        Args:
            force: ``(..., pads, 3, rows, cols)`` newtons, pad frames.

        Returns:
            ``(..., pads, N)`` normal forces, positive for compression, and ``(..., pads, N, 3)`` shear forces.
        """
        taxels = np.asarray(force, dtype=np.float64).reshape(*force.shape[:-2], -1).swapaxes(-1, -2)
        normal = -np.einsum("...pnk,pnk->...pn", taxels, self._normals)
        return normal, taxels + normal[..., None] * self._normals

    def colors(self, normal: NDArray[np.float64], vmax: float) -> NDArray[np.uint8]:
        """Convert ``(..., N)`` normal forces to ``(..., N, 4)`` RGBA; full red at `vmax` newtons."""
        as_tensor = np.broadcast_to(normal[..., None, None, :], (*normal.shape[:-1], 3, 1, normal.shape[-1]))
        return np.rint(255 * taxel_colors(as_tensor, vmax)[..., 0, :, :]).astype(np.uint8)

    def arrows(
        self, shear: NDArray[np.float64], shear_max: float
    ) -> list[tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]]:
        """Return the arrows of each pad in the first line, in order of the moments.

        Args:
            shear: ``(T, pads, N, 3)`` newtons.
            shear_max: Shear force (N) whose arrow is one pitch long.

        Returns:
            For each pad, the ``(T,)`` number of arrows at each moment, ``(A, 3)`` tails above the taxels' surface and
            ``(A, 3)`` vectors (mm). Arrows that are too short to be visible or that are not finite are omitted.
        """
        vectors = shear * (self.pitch / shear_max)
        length = np.linalg.norm(vectors, axis=-1)
        shown = (length > _SHORTEST * self.pitch) & np.isfinite(length)
        tails = self.positions + 1.1 * self.radius * self._normals  # the drawn taxels would hide tails inside them
        tails = np.broadcast_to(tails, vectors.shape)
        masks = shown.swapaxes(0, 1)
        return [(mask.sum(axis=1), tails[:, i][mask], vectors[:, i][mask]) for i, mask in enumerate(masks)]


class Scale:
    """Forces for full colour and for an arrow one pitch long: given, or a recent peak that decays over seconds.

    Attributes:
        vmax: Normal force (N) of full red.
        shear_max: Shear force (N) whose arrow is one pitch long.
    """

    def __init__(self, vmax: float | None = None, shear_max: float | None = None) -> None:
        """Set the scale.

        Args:
            vmax: Normal force (N) of full red. Default: automatic.
            shear_max: Shear force (N) whose arrow is one pitch long. Default: automatic.

        Raises:
            InvalidValueError: A given force is not positive and finite.
        """
        for name, given in (("vmax", vmax), ("shear_max", shear_max)):
            if given is not None and not (np.isfinite(given) and given > 0):
                raise InvalidValueError(f"{name} must be a positive finite force in N, got {given!r}")
        self._given = (vmax, shear_max)
        self.vmax, self.shear_max = (_FAINTEST if given is None else float(given) for given in self._given)
        self._time: float | None = None

    def update(self, time: float, normal: NDArray[np.float64], shear: NDArray[np.float64]) -> None:
        """Update the automatic scale with the forces at `time`.

        Args:
            time: Time (s); if it runs backwards, the scale does not decay.
            normal: Normal forces (N), any shape.
            shear: ``(..., 3)`` shear forces (N).
        """
        kept = 1.0 if self._time is None else float(np.exp(min(0.0, self._time - time) / _FADE))
        self._time = time
        if self._given[0] is None:
            self.vmax = max(_FAINTEST, self.vmax * kept, largest(np.abs(normal)))
        if self._given[1] is None:
            self.shear_max = max(_FAINTEST, self.shear_max * kept, largest(np.linalg.norm(shear, axis=-1)))


def largest(values: NDArray[np.floating]) -> float:
    """Return the largest finite value, at least 0; 0 if there is none."""
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))
