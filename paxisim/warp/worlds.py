"""put_worlds: a compiled model with pads as many worlds of MuJoCo Warp, with room for their contacts."""

from __future__ import annotations

import copy
from typing import Any

import mujoco

from paxisim.errors import InvalidValueError
from paxisim.models.pads import Pads, check_pads
from paxisim.warp.engine import device_of, mujoco_warp, warp
from paxisim.warp.fields import GEL, SURFACE, expand
from paxisim.warp.gel import record_gel
from paxisim.warp.merging import contact_merger
from paxisim.warp.room import sizes


def put_worlds(
    model: mujoco.MjModel,
    pads: Pads,
    worlds: int,
    *,
    data: mujoco.MjData | None = None,
    device: str | None = None,
    merge: bool = False,
    nconmax: int | None = None,
    njmax: int | None = None,
) -> tuple[Any, Any]:
    """Put copies of a model with pads on a device.

    Beyond `mujoco_warp.put_model` and `mujoco_warp.put_data`, this makes room for the contacts of all taxels, gives
    each world its own surface and gel (see `set_surface` and `apply_gel`), and selects Warp's box collider that agrees
    with MuJoCo's: its default finds other contacts between boxes, and taxels then differ by newtons at high loads.

    Args:
        model: The compiled model, with the gel applied (`attach(...).bind(model)` or `Gel.apply`).
        pads: Pads of the model.
        worlds: Number of worlds.
        data: State in which all worlds start; default: the model's initial state.
        device: Warp's name of the device, e.g. ``"cuda:0"`` or ``"cpu"``; default: Warp's current device.
        merge: Give each box taxel one contact per object in place of the four that a flat face makes, with the same
            force. There are then a quarter of the constraint rows, and `njmax` is smaller by default. The worlds start
            without contacts, until the first ``step`` or ``forward``.
        nconmax: Contacts for which a world has room, on average over the worlds; default: from the model.
        njmax: Constraint rows for which each world has room; default: from the model.

    Returns:
        The ``mujoco_warp.Model`` and the ``mujoco_warp.Data`` of the worlds.

    Raises:
        InvalidValueError: The pads belong to another model, there is less than one world, `data` has more contacts or
            constraints than there is room for, or the taxels whose contacts to merge have no gel.
        UnsupportedError: This machine has no such device.
    """
    check_pads(model, pads)
    on = device_of(device)
    if worlds < 1:
        raise InvalidValueError(f"there must be at least one world, got {worlds}")
    state = mujoco.MjData(model) if data is None else copy.copy(data)
    # Warp takes the poses of what is fixed to the world from here, and never computes them again
    mujoco.mj_forward(model, state)
    if merge:
        _remove_contacts(model, state)  # they are not merged, so there is no room for their rows
    contacts, rows = sizes(model, pads, merge)
    contacts = contacts if nconmax is None else nconmax
    rows = rows if njmax is None else njmax
    if state.ncon > contacts or state.nefc > rows:
        raise InvalidValueError(
            f"the state has {state.ncon} contacts and {state.nefc} constraint rows, more than there is room for: "
            f"put_worlds needs nconmax and njmax above {contacts} and {rows}"
        )
    # Warp has no mid phase and refuses a model that switches MuJoCo's off
    plain = copy.copy(model)
    plain.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    with warp.ScopedDevice(on):
        merger = contact_merger(model, pads, on) if merge else None
        m = mujoco_warp.put_model(plain)
        m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)
        d = mujoco_warp.put_data(model, state, nworld=worlds, nconmax=contacts, njmax=rows)
        m.callback.contactfilter = merger
        expand(m, SURFACE + GEL, worlds)
    record_gel(m, model, pads)
    return m, d


def _remove_contacts(model: mujoco.MjModel, state: mujoco.MjData) -> None:
    """Remove the contacts of a state, but keep the accelerations that they cause for the solver's first guess."""
    warmstart = state.qacc_warmstart.copy()
    without = copy.copy(model)
    without.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    mujoco.mj_forward(without, state)
    state.qacc_warmstart[:] = warmstart
