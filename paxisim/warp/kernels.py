"""Warp kernels: contact forces summed over the taxels, and NaN for worlds whose forces would be wrong."""

# pyright: reportInvalidTypeForm=false
# no `from __future__ import annotations`: Warp compiles by the types that the annotations are
from paxisim.warp.engine import warp as wp

_FRICTION = wp.types.vector(length=5, dtype=wp.float32)


@wp.func
def taxel_of(geom: int, taxel_of_geom: wp.array(dtype=wp.int32)):
    """Return the index of the taxel among those of all pads, or -1 for other geoms and for a flex."""
    if geom < 0:
        return -1
    return taxel_of_geom[geom]


@wp.kernel
def sum_contacts(
    pyramidal: bool,
    rows: int,
    taxels: int,
    taxel_of_geom: wp.array(dtype=wp.int32),
    body_of_pad: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    geoms: wp.array(dtype=wp.vec2i),
    frames: wp.array(dtype=wp.mat33),
    friction: wp.array(dtype=_FRICTION),
    dim: wp.array(dtype=wp.int32),
    address: wp.array2d(dtype=wp.int32),
    world_of: wp.array(dtype=wp.int32),
    efc_force: wp.array2d(dtype=wp.float32),
    xmat: wp.array2d(dtype=wp.mat33),
    out: wp.array2d(dtype=wp.float32),
):
    """Add the force of one contact to its taxels: ``out`` is ``(worlds, pads * 3 * taxels)``."""
    contact = wp.tid()
    if contact >= count[0]:
        return
    pair = geoms[contact]
    world = world_of[contact]
    condim = dim[contact]
    first = address[contact, 0]
    # a contact within its gap has no constraint; the address of one for which there was no room is beyond the rows
    if first < 0 or first >= rows:
        return
    force = wp.vec3(0.0, 0.0, 0.0)
    if pyramidal and condim > 1:
        # two edges per tangent: the normal force is the sum of all edges
        for edge in range(2 * (condim - 1)):
            row = address[contact, edge]
            if row >= 0 and row < rows:
                value = efc_force[world, row]
                force[0] += value
                if edge == 0:
                    force[1] += value * friction[contact][0]
                elif edge == 1:
                    force[1] -= value * friction[contact][0]
                elif edge == 2:
                    force[2] += value * friction[contact][1]
                elif edge == 3:
                    force[2] -= value * friction[contact][1]
    else:
        for axis in range(wp.min(condim, 3)):
            row = address[contact, axis]
            if row >= 0 and row < rows:
                force[axis] = efc_force[world, row]
    # the rows of a frame are the normal, from the first geom to the second, and the two tangents; the force acts on
    # the second geom, its reaction on the first
    in_world = wp.transpose(frames[contact]) * force
    for side in range(2):
        taxel = taxel_of(pair[side], taxel_of_geom)
        if taxel >= 0:
            pad = taxel // taxels
            sign = 2.0 * float(side) - 1.0
            on_pad = wp.transpose(xmat[world, body_of_pad[pad]]) * in_world * sign
            for axis in range(3):
                wp.atomic_add(out, world, (pad * 3 + axis) * taxels + taxel - pad * taxels, on_pad[axis])


@wp.kernel
def mark_wrong(
    drops: int,
    rows: int,
    contacts: int,
    tolerance: float,
    overflow: wp.array(dtype=wp.int32),
    nefc: wp.array(dtype=wp.int32),
    nacon: wp.array(dtype=wp.int32),
    ncollision: wp.array(dtype=wp.int32),
    weights: wp.array2d(dtype=wp.vec2),
    applied: wp.array2d(dtype=wp.float32),
    bodies: wp.array(dtype=wp.int32),
    out: wp.array2d(dtype=wp.float32),
):
    """Make the reading of a world NaN if contacts were dropped or its gel is undone."""
    world = wp.tid()
    wrong = (overflow[world] & drops) != 0 or nefc[world] > rows or nacon[0] > contacts or ncollision[0] > contacts
    for pad in range(bodies.shape[0]):
        # worlds share the fields of a model that put_worlds did not make
        weight = weights[world % weights.shape[0], bodies[pad]][0]
        expected = applied[world % applied.shape[0], bodies[pad]]
        # false for NaN, which stands for no gel to compare with
        if wp.abs(weight - expected) > tolerance * expected:
            wrong = True
    if wrong:
        for i in range(out.shape[1]):
            out[world, i] = wp.nan
