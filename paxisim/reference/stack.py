"""Stack: readings of several pads at once, in numpy or torch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from array_api_compat import array_namespace, is_torch_array
from numpy.typing import NDArray

from paxisim.reference.dipoles import field_parts, turned_parts
from paxisim.reference.stiffening import finite_share
from paxisim.reference.unit import Unit

FloatArray = NDArray[np.float64]

BLOCK_SIZE = 16_384
"""Number of magnet fields that numpy computes at once, small enough to stay in the processor's cache."""


class Stack:
    """P pads with the same grid.

    Internal tensors are ``(P, B, components, N)``, with the frames of a batch side by side, so that a pad's matrix is
    applied to all of them at once.
    """

    def __init__(self, units: Sequence[Unit], to_force: FloatArray, thickness: float) -> None:
        """Stack the matrices of the pads.

        Args:
            units: The pads.
            to_force: ``(3, 3, N)`` calibration of the maker, from the sensor's axes to newtons (N/T).
            thickness: Thickness of the gel (m).
        """
        self._thickness = thickness
        every = {name: np.ascontiguousarray([getattr(unit, name) for unit in units]) for name in Unit._fields}
        view = every.pop("view")
        self._near = units[0].near
        self._values = {name: every[name] for name in ("motion", "far")} | {
            "moments": every["moments"][:, None],
            "offsets": every["offsets"][:, None],
            "alone": every["magnets_alone"][:, None],
            "view": view[:, None],
            "to_force": to_force[None, None],
            "readout": np.einsum("ijn,pjkn->pikn", to_force, view)[:, None],
        }
        self._kinds: dict[Any, SimpleNamespace] = {}

    def split(self, force: Any) -> Any:
        """Reshape ``(..., P, 3, rows, cols)`` to ``(P, B, 3, N)``."""
        pads, rows, cols = force.shape[-4], force.shape[-2], force.shape[-1]
        flat = force.reshape((math.prod(force.shape[:-4]), pads, 3, rows * cols))
        return array_namespace(flat).permute_dims(flat, (1, 0, 2, 3))

    def joined(self, parts: Any, like: Any) -> Any:
        """Reshape ``(P, B, 3, N)`` to the shape of `like`, ``(..., P, 3, rows, cols)``."""
        return array_namespace(parts).permute_dims(parts, (1, 0, 2, 3)).reshape(like.shape)

    def motion(self, force: Any) -> Any:
        """Return displacement (m) and rotation (rad) of the magnets, ``(P, B, 6, N)``, by ``(P, B, 3, N)`` newtons."""
        like = self.arrays(force)
        pads, frames, _, count = force.shape
        linear = (force.reshape((pads, frames, 3 * count)) @ like.motion).reshape((pads, frames, 6, count))
        return linear * finite_share(linear[:, :, 2:3] * (1 / self._thickness))

    def change(self, force: Any) -> Any:
        """Return the change of the flux density (T) at the Hall sensors, ``(P, B, 3, N)``, by as many newtons."""
        like, moved = self.arrays(force), self.motion(force)
        pads, frames, _, count = moved.shape
        far = moved.reshape((pads, frames, 6 * count)) @ like.far
        block = max(1, BLOCK_SIZE // (pads * self._near.size))
        if is_torch_array(force) or frames <= block:
            near = self._near_field(like, moved)
        else:
            starts = range(0, frames, block)
            near = np.concatenate([self._near_field(like, moved[:, at : at + block]) for at in starts], axis=1)
        return near - like.at_rest + far.reshape(force.shape)

    def read(self, change: Any) -> Any:
        """Return the reading (N), ``(P, B, 3, N)``, for a change of the field."""
        return apply(self.arrays(change).readout, change)

    def arrays(self, like: Any) -> SimpleNamespace:
        """Return the constants with the array type, dtype and device of `like`; made once."""
        key = like.dtype, getattr(like, "device", None)
        if key not in self._kinds:
            found = SimpleNamespace(**{name: as_kind(value, like) for name, value in self._values.items()})
            found.near = as_kind(self._near.reshape(-1), like)
            rest = found.moments * 0
            found.at_rest = self._near_field(found, array_namespace(rest).concat([rest, rest], axis=2))
            self._kinds[key] = found
        return self._kinds[key]

    def _near_field(self, like: SimpleNamespace, moved: Any) -> Any:
        """Return the field (T) of the nearest magnets, ``(P, B, 3, N)``, moved by ``(P, B, 6, N)``."""
        xp = array_namespace(moved)
        shape = (*moved.shape[:2], *self._near.shape)

        def of_near(part: Any) -> Any:
            return xp.take(part, like.near, axis=-1).reshape(shape)

        moments = turned_parts(
            [like.moments[:, :, axis] for axis in range(3)], [moved[:, :, 3 + axis] for axis in range(3)]
        )
        offsets = [like.offsets[:, :, axis] - of_near(moved[:, :, axis]) for axis in range(3)]
        fields = field_parts([of_near(moment) for moment in moments], offsets)
        return xp.stack([part.sum(-2) for part in fields], axis=2)


def apply(matrices: Any, vectors: Any) -> Any:
    """Multiply the matrices of each taxel, ``(..., 3, 3, N)``, with vectors, ``(..., 3, N)``."""
    return (matrices * vectors[..., None, :, :]).sum(-2)


def as_kind(value: NDArray[Any], like: Any) -> Any:
    """Convert an array to the type, dtype and device of `like`; integer arrays stay integers."""
    is_float = np.issubdtype(value.dtype, np.floating)
    if not is_torch_array(like):
        return value.astype(np.result_type(like.dtype, np.float32)) if is_float else value
    import torch

    return torch.tensor(value).to(like.device, like.dtype if is_float else None)
