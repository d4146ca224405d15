"""Room for contacts and constraint rows of one world, from the model.

MuJoCo Warp allocates both beforehand. Its own defaults (48 contacts, 64 rows) are far too few for pads: it then drops
contacts, and forces become nonsense.
"""

from __future__ import annotations

import mujoco
import numpy as np

from paxisim.models.pads import Pads, are_spheres

# a flat face on a box makes four contacts, and five where an edge of the face cuts off a corner; a sphere makes one,
# or two where objects meet; so does a box whose contacts are merged
_CONTACTS = {"box": 5, "sphere": 2}
_MERGED = 2
_OTHERS = 64
"""Contacts of everything but the pads, as an object on a table or between walls."""


def sizes(model: mujoco.MjModel, pads: Pads, merge: bool = False) -> tuple[int, int]:
    """Return the numbers of contacts and of constraint rows for which one world of the model has room.

    Enough for one object on each taxel of every pad, all other constraints at once and `_OTHERS` further contacts.

    Args:
        model: The compiled model.
        pads: Pads of the model.
        merge: Whether the contacts of a box taxel become one for each object before rows are made of them.

    Returns:
        ``nconmax`` and ``njmax`` of `mujoco_warp.put_data`.
    """
    spheres = int(are_spheres(model, pads.geoms.reshape(-1)).sum())
    boxes = pads.geoms.size - spheres
    on_pads = _CONTACTS["sphere"] * spheres + _CONTACTS["box"] * boxes
    with_rows = _CONTACTS["sphere"] * spheres + _MERGED * boxes if merge else on_pads
    largest = int(model.geom_condim.max())
    rows = _rows(model, 3) * with_rows + _rows(model, largest) * _OTHERS + _other_rows(model)
    return on_pads + _OTHERS, rows


def _rows(model: mujoco.MjModel, condim: int) -> int:
    """Return the constraint rows of a contact."""
    pyramidal = int(model.opt.cone) == int(mujoco.mjtCone.mjCONE_PYRAMIDAL)
    return 2 * (condim - 1) if pyramidal and condim > 1 else condim


def _other_rows(model: mujoco.MjModel) -> int:
    """Return the most rows that equalities, friction and limits can have."""
    equalities = 6 * model.neq
    friction = int(np.sum(model.dof_frictionloss > 0) + np.sum(model.tendon_frictionloss > 0))
    limits = 2 * int(np.sum(model.jnt_limited) + np.sum(model.tendon_limited))
    return equalities + friction + limits
