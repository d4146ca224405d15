"""Checks of a compiled model for what takes the gel or the load away from its pads.

MuJoCo decides by geom which contacts there are and whose stiffness and friction they have: contact bits, priorities,
explicit pairs and the override flag can each leave a pad without its gel, or with a reading of 0.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.models.pads import Pads, highest_priority_met, meets_pads

_MOST_NAMED = 3


def warn_of_contacts(model: mujoco.MjModel, pads: Pads) -> None:
    """Warn, at the caller outside paxisim, of each kind of trouble in `contact_doubts`."""
    for doubt in contact_doubts(model, pads):
        level, frame = 1, sys._getframe()
        while frame is not None and frame.f_globals.get("__name__", "").startswith("paxisim."):
            level, frame = level + 1, frame.f_back
        warnings.warn(doubt, stacklevel=level)


def contact_doubts(model: mujoco.MjModel, pads: Pads) -> list[str]:
    """Return a sentence for each kind of trouble.

    - The override flag replaces the gel of all taxels.
    - A geom or flex that pads can touch has at least their priority. `Gel.apply` rules this out.
    - Taxels are frictionless (condim 1).
    - Explicit contact pairs name taxels, or geoms in front of or level with a pad.
    - The contact bits of an object let it pass through a pad. An object is a body that moves; the kinematic trees that
      carry pads or that an actuator drives are taken for robots.

    Args:
        model: The compiled model.
        pads: Pads of the model.
    """
    checks = (_overridden, _outranked, _frictionless, _paired, _passing)
    return [doubt for check in checks for doubt in check(model, pads)]


def _overridden(model: mujoco.MjModel, pads: Pads) -> Iterator[str]:
    if model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        yield (
            'the pads have no gel: <flag override="enable"/> gives all contacts the stiffness and friction of '
            "o_solref, o_solimp and o_friction; remove it from the model's option"
        )


def _outranked(model: mujoco.MjModel, pads: Pads) -> Iterator[str]:
    highest, lowest = highest_priority_met(model, pads), int(model.geom_priority[pads.geoms].min())
    if highest >= lowest:
        yield (
            f"the pads lose their gel on objects of priority {highest}, since their taxels have priority {lowest}: "
            "apply the gel (Gel.apply, TactileGripper.bind), which raises it"
        )


def _frictionless(model: mujoco.MjModel, pads: Pads) -> Iterator[str]:
    bare = (model.geom_condim[pads.geoms] == 1).any(axis=1)
    if bare.any():
        yield f"pads feel no shear, since taxels have condim 1 instead of 3: {_listed(_names(pads, bare.tolist()))}"


def _names(pads: Pads, which: Iterable[bool]) -> list[str]:
    return [repr(name) for name, chosen in zip(pads.names, which, strict=True) if chosen]


def _listed(words: Sequence[str]) -> str:
    more = len(words) - _MOST_NAMED
    return ", ".join(words[:_MOST_NAMED]) + (f" and {more} more" if more > 0 else "")


def _paired(model: mujoco.MjModel, pads: Pads) -> Iterator[str]:
    if not model.npair:
        return
    from paxisim.models.mount_checks import hiding_geoms

    pairs = np.stack([model.pair_geom1, model.pair_geom2], axis=1)
    words = [" with ".join(sorted(repr(model.geom(geom).name) for geom in pair)) for pair in pairs.tolist()]

    def naming(geoms) -> list[str]:
        return [word for word, named in zip(words, np.isin(pairs, geoms).any(axis=1), strict=True) if named]

    if with_taxels := naming(pads.geoms):
        yield (
            "explicit contact pairs replace the gel and friction of the taxels that they name; remove "
            f"{_listed(with_taxels)}"
        )
    tree = model.body_rootid[model.geom_bodyid[pairs]]
    to_others = np.zeros(model.ngeom, dtype=bool)
    to_others[pairs[tree[:, 0] != tree[:, 1]]] = True
    hiding = [geom for geoms in hiding_geoms(model, pads, to_others) for geom in geoms]
    if with_hiding := naming(hiding):
        yield (
            "explicit contact pairs let geoms in front of a pad, or level with it, take its load; remove "
            f"{_listed(with_hiding)}"
        )


def _passing(model: mujoco.MjModel, pads: Pads) -> Iterator[str]:
    meets = meets_pads(model, pads)[:, : model.ngeom]
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    if model.npair:
        for one, other in ((model.pair_geom1, model.pair_geom2), (model.pair_geom2, model.pair_geom1)):
            collides[one] = True
            for met, taxels in zip(meets, pads.geoms, strict=True):
                met[other[np.isin(one, taxels)]] = True
    tree, link = model.body_rootid[model.geom_bodyid], model.body_weldid[model.geom_bodyid]
    link = np.where(model.body_mocapid[tree] < 0, link, tree)  # MuJoCo counts mocap bodies as welded to the world
    objects = collides & (link != 0)
    if not (objects & ~meets.all(axis=0)).any():
        return
    objects &= ~np.isin(tree, [*model.body_rootid[pads.bodies], *_driven_trees(model)])
    passing = [np.setdiff1d(link[objects], link[objects & met]) for met in meets]
    found = np.unique(np.concatenate(passing))
    if not found.size:
        return
    missed = [bool(np.isin(found, bodies).any()) for bodies in passing]
    words = []
    for body in found.tolist():
        geom = int(np.flatnonzero(objects & (link == body))[0])
        bits = f"contype {model.geom_contype[geom]}, conaffinity {model.geom_conaffinity[geom]}"
        words.append(f"{model.body(body).name or f'body {body}'!r} ({bits})")
    taxel = int(pads.geoms[missed.index(True), 0])
    contype, conaffinity = int(model.geom_contype[taxel]), int(model.geom_conaffinity[taxel])
    if conaffinity:
        remedy = f"add {conaffinity & -conaffinity} to the contype of their geoms"
    elif contype:
        remedy = f"add {contype & -contype} to the conaffinity of their geoms"
    else:
        remedy = "give the pads contact bits"
    yield (
        f"objects pass through pads, which read 0: {_listed(words)} through {_listed(_names(pads, missed))} "
        f"(contype {contype}, conaffinity {conaffinity}); {remedy}"
    )


def _driven_trees(model: mujoco.MjModel) -> NDArray[np.int32]:
    """Return the root bodies of the kinematic trees that actuators drive."""
    of_joint, of_site = model.jnt_bodyid, model.site_bodyid
    bodies = []
    for kind, target in zip(model.actuator_trntype.tolist(), model.actuator_trnid[:, 0].tolist(), strict=True):
        if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
            bodies.append(of_joint[target])
        elif kind in (int(mujoco.mjtTrn.mjTRN_SITE), int(mujoco.mjtTrn.mjTRN_SLIDERCRANK)):
            bodies.append(of_site[target])
        elif kind == int(mujoco.mjtTrn.mjTRN_BODY):
            bodies.append(target)
        elif kind == int(mujoco.mjtTrn.mjTRN_TENDON):
            first, count = int(model.tendon_adr[target]), int(model.tendon_num[target])
            wraps = slice(first, first + count)
            for of, wrap in ((of_joint, mujoco.mjtWrap.mjWRAP_JOINT), (of_site, mujoco.mjtWrap.mjWRAP_SITE)):
                bodies.extend(of[model.wrap_objid[wraps][model.wrap_type[wraps] == int(wrap)]])
    return model.body_rootid[np.array(bodies, dtype=int)]
