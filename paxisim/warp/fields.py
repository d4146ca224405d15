"""Fields of a MuJoCo Warp model that have a value per world."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.warp.engine import torch, warp

SURFACE = ("geom_pos", "geom_size", "geom_aabb", "geom_rbound")
"""Fields in which a pad's surface shows: the cubes, and the bounds by which the broad phase prunes."""
GEL = ("geom_solref", "geom_solimp", "geom_friction", "body_invweight0")
"""Fields in which a pad's gel shows."""


def expand(m: Any, names: tuple[str, ...], worlds: int) -> None:
    """Give each world its own copy of fields that all worlds share in a model from `mujoco_warp.put_model`."""
    for name in names:
        shared = getattr(m, name)
        values = np.repeat(shared.numpy()[:1], worlds, axis=0)
        setattr(m, name, warp.array(values, dtype=shared.dtype, device=shared.device))


def view(m: Any, name: str) -> Any:
    """Return a field as a torch tensor ``(worlds, ...)`` that shares its memory."""
    return warp.to_torch(getattr(m, name))


def taxel_lookup(model: mujoco.MjModel, geoms: NDArray[np.int64], device: Any) -> Any:
    """Return the index of each geom of the model among the taxels `geoms`, -1 for other geoms, as a Warp array."""
    taxel = np.full(model.ngeom, -1, np.int32)
    taxel[geoms.reshape(-1)] = np.arange(geoms.size)
    return warp.array(taxel, dtype=int, device=device)


def worlds_of(m: Any) -> int:
    """Return the number of worlds that have surfaces and gels of their own."""
    return m.geom_pos.shape[0]


def check_mask(mask: Any, worlds: int, device: Any) -> Any:
    """Return a mask of worlds as a boolean tensor ``(worlds,)`` on the device; default: all.

    Raises:
        InvalidValueError: The mask has another shape or is not boolean.
    """
    if mask is None:
        return torch.ones(worlds, dtype=torch.bool, device=device)
    mask = torch.as_tensor(mask, device=device)
    if mask.shape != (worlds,) or mask.dtype != torch.bool:
        raise InvalidValueError(
            f"mask must be boolean of shape ({worlds},), one for each world, got {mask.dtype} of {tuple(mask.shape)}"
        )
    return mask
