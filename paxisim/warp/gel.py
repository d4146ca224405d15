"""apply_gel: a gel for each world, and an error where `mujoco_warp.set_const` has undone it.

The gel rests on a large ``body_invweight0`` of the pad's body (see `paxisim.models.gel`). `mujoco_warp.set_const`,
which follows a change of masses, recomputes this field, and the pad is then thousands of times stiffer. Therefore the
model carries the weights that were applied, `RECORD`, with which the readout compares.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from paxisim.errors import InvalidValueError, UnsupportedError
from paxisim.models.gel import Gel, is_applied
from paxisim.models.pads import Pads, check_pads
from paxisim.warp.engine import torch, warp
from paxisim.warp.fields import check_mask, view, worlds_of

RECORD = "paxisim_invweight0"
"""Attribute of the Warp model: ``(worlds, nbody)`` inverse weights of pads with a gel, NaN for all other bodies."""

TOLERANCE = 1e-3
"""Share of an inverse weight by which it may differ from that which was applied; float32 rounds by 1e-7."""


def apply_gel(m: Any, model: mujoco.MjModel, pads: Pads, gel: Gel | Sequence[Gel], mask: Any = None) -> None:
    """Give the taxels of each world a gel, as `Gel.apply` does.

    Args:
        m: The Warp model, from `put_worlds`; changed in place.
        model: The model of which it was made. Its time step, cone and ``impratio`` count.
        pads: Pads of the model.
        gel: Gel of all worlds, or one for each.
        mask: Boolean ``(worlds,)``, which worlds to change; default: all.

    Raises:
        InvalidValueError: The number of gels is not that of the worlds, a relaxation time is too short for the time
            step, the mask has another shape, or the pads belong to another model.
    """
    check_pads(model, pads)
    worlds = worlds_of(m)
    gels = [gel] if isinstance(gel, Gel) else list(gel)
    if not isinstance(gel, Gel) and len(gels) != worlds:
        raise InvalidValueError(f"expected one gel or {worlds}, one for each world, got {len(gels)}")
    scratch = copy.copy(model)
    geoms = pads.geoms.reshape(-1)
    new: dict[str, list[Any]] = {name: [] for name in ("geom_solref", "geom_solimp", "geom_friction")}
    weights = []
    for each in gels:
        each.apply(scratch, pads)
        for name, values in new.items():
            values.append(getattr(scratch, name)[geoms])
        weights.append(scratch.body_invweight0[pads.bodies, 0])
    device = view(m, "geom_solref").device
    mask = check_mask(mask, worlds, device)
    for name, values in new.items():
        _write(view(m, name), geoms, np.stack(values), mask)
    priority = view(m, "geom_priority")
    priority[geoms] = torch.as_tensor(scratch.geom_priority[geoms], dtype=priority.dtype, device=priority.device)
    record = _record(m)
    for field in (view(m, "body_invweight0")[..., 0], record):
        _write(field, pads.bodies, np.stack(weights), mask)


def _write(field: Any, columns: Any, values: Any, mask: Any) -> None:
    """Write values ``(worlds or 1, columns, ...)`` into columns of a field ``(worlds, all columns, ...)``."""
    columns = torch.as_tensor(columns, device=field.device)
    old = field[:, columns]
    new = torch.as_tensor(values, dtype=field.dtype, device=field.device)
    field[:, columns] = torch.where(mask.reshape(-1, *[1] * (old.ndim - 1)), new, old)


def _record(m: Any) -> Any:
    """Return the model's record as a tensor, with as many worlds as the weights have now."""
    if not hasattr(m, RECORD):
        return _new_record(m)
    record = warp.to_torch(getattr(m, RECORD))
    if record.shape == m.body_invweight0.shape:
        return record
    return _new_record(m).copy_(record)  # the weights were shared by all worlds and are no longer


def _new_record(m: Any) -> Any:
    """Give the model an empty record, and return it as a tensor."""
    field = m.body_invweight0
    record = warp.full(field.shape, np.nan, dtype=float, device=field.device)
    setattr(m, RECORD, record)
    return warp.to_torch(record)


def record_gel(m: Any, model: mujoco.MjModel, pads: Pads) -> None:
    """Note which inverse weights a gel has given the pads of a model that was just put on the device."""
    record = _new_record(m)
    for body, geoms in zip(pads.bodies, pads.geoms, strict=True):
        if is_applied(model, geoms):
            record[:, body] = view(m, "body_invweight0")[:, body, 0]


def restore_gel(m: Any) -> None:
    """Write the inverse weights that a gel gave the pads again. Nothing waits for the device."""
    if hasattr(m, RECORD):
        record, weights = warp.to_torch(getattr(m, RECORD)), view(m, "body_invweight0")[..., 0]
        weights.copy_(torch.where(record.isnan(), weights, record))


def check_gel(m: Any) -> None:
    """Check that the gels are as they were applied. This waits for the device.

    Args:
        m: The Warp model, from `put_worlds`.

    Raises:
        UnsupportedError: `mujoco_warp.set_const` has undone a gel.
    """
    if not hasattr(m, RECORD):
        return
    record, weights = warp.to_torch(getattr(m, RECORD)), view(m, "body_invweight0")[..., 0]
    undone = torch.nonzero((weights - record).abs() > TOLERANCE * record)
    if len(undone):
        world, body = undone[0].tolist()
        applied = float(record[world % len(record), body])
        raise UnsupportedError(
            f"a pad's gel is undone in {len(torch.unique(undone[:, 0]))} of {len(weights)} worlds: body_invweight0 of "
            f"body {body} is {float(weights[world, body]):.4g} instead of {applied:.4g}. mujoco_warp.set_const "
            "resets it: call paxisim.warp.apply_gel after it, or in mjlab add the event paxisim.warp.RenewPads"
        )
