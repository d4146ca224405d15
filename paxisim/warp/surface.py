"""set_surface: heights of the taxels for each world."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.models.pads import Pads, are_spheres, check_pads, half_thickness, inward_axes
from paxisim.models.surface import check_heights
from paxisim.warp.engine import torch, warp
from paxisim.warp.fields import check_mask, view, worlds_of


def set_surface(m: Any, d: Any, model: mujoco.MjModel, pads: Pads, heights: Any, mask: Any = None) -> None:
    """Give the taxels of each world new heights, as `paxisim.set_surface` does.

    MuJoCo Warp computes the poses of geoms that are fixed to the world only once, in `mujoco_warp.put_data`. Therefore
    this also moves the taxels in `d`; those of a fixed pad would otherwise grow to both sides.

    Nothing waits for the device if `heights` and `mask` are tensors there; then only their shapes are checked.

    Args:
        m: The Warp model, from `put_worlds`; changed in place. Worlds share the surface of a model that
            `mujoco_warp.put_model` made.
        d: The Warp data, from `put_worlds`; changed in place.
        model: The model of which it was made.
        pads: Pads of the model.
        heights: Thickness of the cubes (m), ``(worlds, pads, rows, cols)``, or for all worlds ``(pads, rows, cols)`` or
            ``(rows, cols)``; an array or a tensor.
        mask: Boolean ``(worlds,)``, which worlds to change; default: all.

    Raises:
        InvalidValueError: The heights have the wrong shape or are not positive and finite, the mask has another
            shape, or the pads belong to another model.
    """
    check_pads(model, pads)
    pos, size, aabb, rbound = (view(m, name) for name in ("geom_pos", "geom_size", "geom_aabb", "geom_rbound"))
    device, worlds = pos.device, worlds_of(m)
    if not isinstance(heights, torch.Tensor) or heights.device.type == "cpu":
        heights = check_heights(np.asarray(heights), pads.layout)
    shape = (worlds, len(pads), pads.layout.rows, pads.layout.cols)
    if tuple(heights.shape) not in (shape, shape[1:], shape[2:]):
        raise InvalidValueError(f"heights must have shape {shape}, {shape[1:]} or {shape[2:]}, got {heights.shape}")
    half = torch.as_tensor(heights, dtype=torch.float32, device=device).expand(shape).reshape(worlds, -1) / 2
    mask = check_mask(mask, worlds, device)

    def put(values: Any) -> Any:
        return torch.as_tensor(values, device=device, dtype=pos.dtype)

    flat = pads.geoms.reshape(-1)
    geoms = torch.as_tensor(flat, device=device)
    spheres = put(are_spheres(model, flat)).bool()
    half = torch.where(mask[:, None], half, _half_now(size, geoms, spheres))
    inward = inward_axes(model, flat)
    # the backs of the cubes stay where they are, so that changes do not add up rounding errors
    backs = model.geom_pos[flat] + inward * half_thickness(model, flat)[:, None]
    pos[:, geoms] = put(backs) - put(inward) * half[..., None]
    own = size[:, geoms]
    own[..., 2] = torch.where(spheres, own[..., 2], half)
    own[..., 0] = torch.where(spheres, half, own[..., 0])
    size[:, geoms] = own
    aabb[:, geoms, 1] = torch.where(spheres[:, None], half[..., None], own)
    rbound[:, geoms] = torch.where(spheres, half, own.norm(dim=-1))
    bodies = torch.as_tensor(model.geom_bodyid[flat], dtype=torch.long, device=device)
    to_world = warp.to_torch(d.xmat)[:, bodies]
    turned = (to_world @ pos[:, geoms, :, None])[..., 0]
    warp.to_torch(d.geom_xpos)[:, geoms] = warp.to_torch(d.xpos)[:, bodies] + turned


def _half_now(size: Any, geoms: Any, spheres: Any) -> Any:
    """Return half of the heights that the worlds have, ``(worlds, N)``."""
    own = size[:, geoms]
    return torch.where(spheres, own[..., 0], own[..., 2])
