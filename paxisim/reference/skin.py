"""MagneticSkin: the field at the chips below a magnetic skin from the forces on its contact cells."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import InvalidValueError
from paxisim.layer.response import layer_response
from paxisim.layout import TaxelLayout
from paxisim.reference.dipoles import field, field_parts, jacobian, turned_parts
from paxisim.reference.skin_design import SkinDesign
from paxisim.reference.stiffening import finite_share

FloatArray = NDArray[np.float64]

MICROTESLA = 1e6
"""Microtesla per tesla."""
BLOCK_SIZE = 400_000
"""Number of dipole fields that are computed at once, small enough to stay in memory for any number of frames."""


class MagneticSkin:
    """A magnetic skin over a board of magnetometers, such as AnySkin.

    Forces on the contact cells deform the skin, an elastic layer bonded to its base. The magnets in it move and turn
    with it. Each chip below reads the change of the sum of their dipole fields, in its own axes. The result has the
    shape, order, axes and unit of the tensor that `open_sensor` reads with the profile of the same name.

    Example::

        skin = paxisim.MagneticSkin("anyskin")
        force = readout.read(data)  # (pads, 3, 10, 10) newtons, from a gripper with attach(..., sensor="anyskin")
        flux = skin.read(force)  # (pads, 3, 1, 5) microtesla

    Attributes:
        design: The design of the skin.
        layout: Contact cells, the layout of the forces.
        rest: ``(3, 1, chips)`` field of the undeformed skin (uT), which a reading that was not zeroed adds.
    """

    def __init__(self, design: SkinDesign | str) -> None:
        """Prepare the matrices, which takes up to a few seconds for a new thickness.

        Args:
            design: A design, or the name of one; see `SkinDesign.named`.

        Raises:
            UnknownNameError: There is no design of this name.
            InvalidValueError: `design` is neither a design nor a name.
        """
        if isinstance(design, str):
            design = SkinDesign.named(design)
        if not isinstance(design, SkinDesign):
            raise InvalidValueError(f"expected a SkinDesign or the name of one, got {type(design).__name__}")
        self.design, self.layout = design, design.cells
        places, moments = design.dipoles()
        self._moments = np.stack([0 * moments, 0 * moments, moments], axis=-1)  # (M, 3)
        depth = design.layer.thickness + design.gap
        chips = np.array([(x, y, depth) for x, y in design.chips])
        self._offsets = chips[:, None] - places  # (chips, M, 3)
        cos, sin, no = np.cos(design.turns), np.sin(design.turns), np.zeros(len(chips))
        self._view = np.stack([[cos, sin, no], [-sin, cos, no], [no, no, no + 1]])  # (own axis, pad axis, chips)
        spread = np.broadcast_to(self._moments, self._offsets.shape)
        self._motion = _motion(design, places)  # (3 N, 6 M)
        # [chip, dipole, field, motion] to (6 M, 3, chips)
        slopes = jacobian(spread, self._offsets).transpose(1, 3, 2, 0).reshape(self._motion.shape[1], -1)
        self._linear = self._motion @ slopes
        self._at_rest = field(spread, self._offsets).sum(axis=1).T  # (3, chips)
        self.rest = self._seen(self._at_rest)[:, None, :]

    def read(self, force: ArrayLike, *, linear: bool = False, outside: ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
        """Return the change of the flux density at the chips since zeroing, without noise.

        Args:
            force: ``(..., 3, rows, cols)`` newtons on the contact cells.
            linear: Whether to take the field as linear in the forces, which is a thousand times faster and right for
                small loads only: for a press on 2x2 cells of AnySkin it is wrong by up to 6 % of the reading at 0.1 N
                and by half at 1 N, since an even magnetisation cancels most of the linear part; for eFlesh by up to
                13 % at 1 N. Otherwise the skin stiffens as it is compressed, and the fields of the moved magnets are
                summed.
            outside: ``(..., 3)`` change of an external flux density since zeroing (uT, pad frame), such as that of
                the earth when the hand turns; broadcast against the leading axes of `force`.

        Returns:
            ``(..., 3, 1, chips)`` microtesla, float64, each chip in its own axes.

        Raises:
            InvalidValueError: The shapes do not fit, or a value is not finite.
        """
        force, outside = _finite("force", force), _finite("outside", outside)
        self.layout.check(force)
        if outside.shape[-1:] != (3,):
            raise InvalidValueError(f"expected outside as (..., 3) microtesla, got {outside.shape}")
        lead = force.shape[:-3]
        try:
            np.broadcast_to(outside, (*lead, 3))
        except ValueError as error:
            raise InvalidValueError(
                f"outside of shape {outside.shape} does not fit forces of shape {force.shape}: expected {(*lead, 3)}"
            ) from error
        loads = force.reshape(-1, 3 * self.layout.taxels)
        chips = len(self.design.chips)
        change = (loads @ self._linear).reshape(-1, 3, chips) if linear else self._exact(loads)
        change = change.reshape(*lead, 3, chips) + outside[..., None] / MICROTESLA
        return self._seen(change)[..., None, :]

    def measure(
        self, force: ArrayLike, rng: np.random.Generator, *, linear: bool = False, outside: ArrayLike = (0.0, 0.0, 0.0)
    ) -> FloatArray:
        """Return the same as `read`, with the noise and the counts of the chips.

        The counts are those of the change since zeroing.
        """
        flux = self.read(force, linear=linear, outside=outside)
        noise, step = (np.array(values)[:, None, None] for values in (self.design.noise, self.design.step))
        flux = flux + noise * rng.standard_normal(flux.shape)
        counted = step > 0
        return np.where(counted, step * np.rint(flux / np.where(counted, step, 1)), flux)

    def motion(self, force: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return displacement (m) and rotation (rad) of each dipole of the design, each ``(..., 3, M)``.

        Args:
            force: ``(..., 3, rows, cols)`` newtons on the contact cells.

        Raises:
            InvalidValueError: The shape does not fit, or a value is not finite.
        """
        force = _finite("force", force)
        self.layout.check(force)
        moved = self._moved(force.reshape(-1, 3 * self.layout.taxels))
        moved = moved.transpose(0, 2, 1).reshape(*force.shape[:-3], 6, -1)
        return moved[..., :3, :], moved[..., 3:, :]

    def _moved(self, loads: FloatArray) -> FloatArray:
        """Return the motion ``(B, M, 6)`` of the dipoles, limited as in a rod that stiffens when it is compressed."""
        moved = (loads @ self._motion).reshape(len(loads), -1, 6)
        return moved * finite_share(moved[..., 2:3] / self.design.layer.thickness)

    def _exact(self, loads: FloatArray) -> FloatArray:
        """Return the change of the field (T), ``(B, 3, chips)``, in blocks of frames."""
        block = max(1, BLOCK_SIZE // self._offsets[..., 0].size)
        total = np.empty((len(loads), 3, len(self.design.chips)))
        for start in range(0, len(loads), block):
            moved = self._moved(loads[start : start + block])[:, None]
            turned = turned_parts(list(self._moments.T), [moved[..., 3 + axis] for axis in range(3)])
            offsets = [self._offsets[..., axis] - moved[..., axis] for axis in range(3)]
            for axis, part in enumerate(field_parts(turned, offsets)):
                total[start : start + block, axis] = part.sum(-1)
        return total - self._at_rest

    def _seen(self, flux: FloatArray) -> FloatArray:
        """Convert ``(..., 3, chips)`` from tesla in the pad frame to microtesla in the chips' own axes."""
        return MICROTESLA * np.sum(self._view * flux[..., None, :, :], axis=-2)

    def __repr__(self) -> str:
        """Return the numbers of cells and chips."""
        return f"MagneticSkin({self.layout.rows}x{self.layout.cols} cells, {len(self.design.chips)} chips)"


def _finite(name: str, values: Any) -> FloatArray:
    """Return finite numbers as a float64 array."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidValueError(f"{name} must be an array of numbers, got {type(values).__name__}") from error
    if not np.isfinite(array).all():
        raise InvalidValueError(f"{name} must be finite")
    return array


def _motion(design: SkinDesign, places: FloatArray) -> FloatArray:
    """Return displacements and rotations of the dipoles per force on the cells, ``(3 N, 6 M)``."""
    layer = design.layer
    cells, count = design.cells.positions[:, :2], design.cells.taxels
    full = np.empty((3, count, len(places), 6))  # [force, loaded cell, dipole, motion]
    for depth in np.unique(places[:, 2]):
        here = places[:, 2] == depth
        beside = (places[here, :2] - cells[:, None]).reshape(-1, 2)
        unique, where = np.unique(np.round(beside, 9), axis=0, return_inverse=True)
        response = _response(unique.tobytes(), float(depth), layer.thickness, layer.poisson, design.cells)
        full[:, :, here] = response[where.reshape(-1)].reshape(count, -1, 6, 3).transpose(3, 0, 1, 2) / layer.modulus
    return full.reshape(3 * count, -1)


@lru_cache(maxsize=16)
def _response(points: bytes, depth: float, thickness: float, poisson: float, cells: TaxelLayout) -> FloatArray:
    """Return the response of a layer of unit modulus at points, ``(n, 6, 3)``, so that units share the slow part."""
    offsets = np.frombuffer(points).reshape(-1, 2)
    return np.concatenate(layer_response(offsets, depth, thickness, 1.0, poisson, cells.pitch), axis=1)
