"""Contact merging: each taxel gets one contact per object in place of the four that a flat face makes.

MuJoCo Warp calls the function from `contact_merger` after collision detection, as its ``callback.contactfilter``. It
makes no constraint rows for a contact whose type is 0.

At rest a contact at depth r with impedance d carries ``f = k d r / R``, where ``R = (1 - d) / d * W`` and W is the sum
of both bodies' ``body_invweight0``. The merged contact replaces n such springs: its f and 1/R are their sums, its depth
is their mean, and its position is their centre of force. W belongs to the bodies, whose other contacts may be single,
so the merged contact cannot have a W of its own. Instead, its impedance gives the sum of 1/R (for equal depths,
n times ``d / (1 - d)``), and its ``solref`` is rescaled to keep f and the damping. All rows of a contact, with both
friction cones, are proportional to this R.
"""

# pyright: reportInvalidTypeForm=false
# no `from __future__ import annotations`: Warp compiles by the types that the annotations are
from collections.abc import Callable
from typing import Any

import mujoco

from paxisim.errors import InvalidValueError
from paxisim.models.pads import Pads, are_spheres
from paxisim.warp.engine import warp as wp
from paxisim.warp.fields import taxel_lookup
from paxisim.warp.kernels import taxel_of

_VEC5 = wp.types.vector(length=5, dtype=wp.float32)
_CONSTRAINT = wp.constant(1)  # mujoco_warp.ContactType.CONSTRAINT, which not all versions export
_LOWEST, _HIGHEST = wp.constant(1e-4), wp.constant(0.9999)  # MuJoCo clips impedances to mjMINIMP and mjMAXIMP
_PARALLEL = wp.constant(1.0 - 1e-6)  # cosine of the largest angle between merged normals, 0.08 degrees


def contact_merger(model: mujoco.MjModel, pads: Pads, device: Any) -> Callable[[Any, Any], None]:
    """Return the function of a Warp model and its data that merges the contacts of each box taxel and object.

    It waits for nothing, so a CUDA graph can contain it. Contacts with other normals, with adhesion, from collision
    sensors, or with a positive ``solref`` (of a contact pair) stay as they are.

    Raises:
        InvalidValueError: A box taxel has a positive ``solref``, so its stiffness is not that of a gel.
    """
    boxes = pads.geoms[~are_spheres(model, pads.geoms)]
    if (model.geom_solref[boxes] > 0).any():
        raise InvalidValueError(
            "merging contacts needs taxels with the negative solref of a gel, but some have a time constant: "
            "call Gel.apply first"
        )
    lookup = taxel_lookup(model, boxes, device)

    def merge(m: Any, d: Any) -> None:
        contact = d.contact
        newest = wp.full((d.nworld, boxes.size), -1, dtype=int, device=device)
        following = wp.empty(d.naconmax, dtype=int, device=device)
        wp.launch(
            _list_contacts,
            dim=d.naconmax,
            inputs=[
                lookup,
                d.nacon,
                contact.geom,
                contact.worldid,
                contact.type,
                contact.dist,
                contact.includemargin,
                contact.solref,
                contact.solreffriction,
                getattr(contact, "adhesion", None),
            ],
            outputs=[newest, following],
            device=device,
        )
        wp.launch(
            _merge_lists,
            dim=newest.shape,
            inputs=[newest, contact.geom, contact.frame, contact.includemargin, contact.geomcollisionid],
            outputs=[following, contact.dist, contact.pos, contact.solref, contact.solimp, contact.type],
            device=device,
        )

    return merge


@wp.kernel
def _list_contacts(
    taxel_of_geom: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    geoms: wp.array(dtype=wp.vec2i),
    world_of: wp.array(dtype=wp.int32),
    kind: wp.array(dtype=wp.int32),
    dist: wp.array(dtype=wp.float32),
    margin: wp.array(dtype=wp.float32),
    solref: wp.array(dtype=wp.vec2),
    solref_friction: wp.array(dtype=wp.vec2),
    adhesion: wp.array(dtype=wp.float32),
    newest: wp.array2d(dtype=wp.int32),
    following: wp.array(dtype=wp.int32),
):
    """Put each contact that may be merged into the linked list of its world and taxel."""
    contact = wp.tid()
    if contact >= count[0] or kind[contact] != _CONSTRAINT or dist[contact] >= margin[contact]:
        return
    # versions before 4.0 have no adhesion
    if adhesion.shape[0] > 0 and adhesion[contact] != 0.0:
        return
    if solref[contact][0] > 0.0 or solref[contact][1] > 0.0 or wp.length_sq(solref_friction[contact]) > 0.0:
        return
    # all contacts of two taxels with each other are in the same list
    taxel = wp.max(taxel_of(geoms[contact][0], taxel_of_geom), taxel_of(geoms[contact][1], taxel_of_geom))
    if taxel >= 0:
        following[contact] = wp.atomic_exch(newest, world_of[contact], taxel, contact)


@wp.func
def _sorted(newest: int, order: wp.array(dtype=wp.int32), following: wp.array(dtype=wp.int32)):
    """Sort a linked list by the numbers of contacts within their geom pair, and return its first contact."""
    first = wp.int32(-1)
    contact = wp.int32(newest)
    while contact >= 0:
        later = following[contact]
        before = wp.int32(-1)
        after = wp.int32(first)
        while after >= 0 and order[after] < order[contact]:
            before = after
            after = following[after]
        following[contact] = after
        if before < 0:
            first = contact
        else:
            following[before] = contact
        contact = later
    return first


@wp.func
def _impedance(solimp: _VEC5, depth: float):
    """Return MuJoCo's impedance at a depth."""
    low = wp.clamp(solimp[0], _LOWEST, _HIGHEST)
    high = wp.clamp(solimp[1], _LOWEST, _HIGHEST)
    if low == high or solimp[2] <= 1e-15:
        return 0.5 * (low + high)
    middle = wp.clamp(solimp[3], _LOWEST, _HIGHEST)
    power = wp.max(solimp[4], 1.0) - 1.0
    x = wp.min(depth / solimp[2], 1.0)
    share = x * wp.pow(x / middle, power)
    if x > middle:
        share = 1.0 - (1.0 - x) * wp.pow((1.0 - x) / (1.0 - middle), power)
    return low + share * (high - low)


@wp.kernel
def _merge_lists(
    newest: wp.array2d(dtype=wp.int32),
    geoms: wp.array(dtype=wp.vec2i),
    frames: wp.array(dtype=wp.mat33),
    margin: wp.array(dtype=wp.float32),
    order: wp.array(dtype=wp.int32),
    following: wp.array(dtype=wp.int32),
    dist: wp.array(dtype=wp.float32),
    pos: wp.array(dtype=wp.vec3),
    solref: wp.array(dtype=wp.vec2),
    solimp: wp.array(dtype=_VEC5),
    kind: wp.array(dtype=wp.int32),
):
    """Merge the contacts in the list of one world and taxel, pair by pair, into the first of each pair."""
    world, taxel = wp.tid()
    # a sorted list gives the same sums in every run, although the order in which threads write contacts varies
    lead = _sorted(newest[world, taxel], order, following)
    while lead >= 0:
        if kind[lead] == _CONSTRAINT:
            merged = wp.int32(0)
            springs = wp.float32(0.0)  # sum of 1/R, in units of 1/W
            depths = wp.float32(0.0)  # sum of r/R
            forces = wp.float32(0.0)  # sum of f/k
            moments = wp.vec3(0.0, 0.0, 0.0)
            contact = wp.int32(lead)
            while contact >= 0:
                if (
                    kind[contact] == _CONSTRAINT
                    and geoms[contact] == geoms[lead]
                    and wp.dot(frames[contact][0], frames[lead][0]) > _PARALLEL
                ):
                    depth = margin[contact] - dist[contact]
                    impedance = _impedance(solimp[contact], depth)
                    spring = impedance / (1.0 - impedance)
                    springs += spring
                    depths += spring * depth
                    forces += spring * impedance * depth
                    moments += spring * impedance * depth * (pos[contact] - pos[lead])
                    merged += 1
                    if contact != lead:
                        kind[contact] = 0
                contact = following[contact]
            if merged > 1:
                impedance = wp.min(springs / (1.0 + springs), _HIGHEST)
                depth = depths / springs
                # of the rounded impedance, by which MuJoCo Warp computes R
                spring = impedance / (1.0 - impedance)
                highest = wp.clamp(solimp[lead][1], _LOWEST, _HIGHEST)
                stiffness = solref[lead][0] / (highest * highest)
                damping = solref[lead][1] / highest
                solref[lead] = wp.vec2(stiffness * forces * impedance / (spring * depth), damping * impedance)
                solimp[lead] = _VEC5(impedance, impedance, solimp[lead][2], solimp[lead][3], solimp[lead][4])
                dist[lead] = margin[lead] - depth
                pos[lead] += moments / forces
        lead = following[lead]
