"""Merged contacts: the forces of unmerged ones, a quarter of the rows, and nothing else changed."""

import mujoco
import numpy as np
import pytest
from held import held, needs_warp, warped

import paxisim
from paxisim.errors import InvalidValueError
from paxisim.models.gel import Gel
from paxisim.models.pads import find_pads

pytestmark = needs_warp
CONES = ["elliptic", "pyramidal"]
CONSTRAINT, SENSOR = 1, 2


def both(scene, worlds=4):
    """The same worlds without and with merging, each with its own surface and load."""
    return [warped(scene, worlds, merge=merge) for merge in (False, True)]


def assert_alike(found, expected, sums, taxels):
    """Compare pad sums with the load, and taxels with the largest of their world."""
    load = expected.sum(axis=(-2, -1))[:, :, 2].max(axis=1)
    total = np.linalg.norm((found - expected).sum(axis=(-2, -1)), axis=-1).max(axis=1)
    assert (total / load).max() < sums
    peak = np.abs(expected).max(axis=(1, 2, 3, 4))
    assert (np.abs(found - expected).max(axis=(1, 2, 3, 4)) / peak).max() < taxels


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("peg", ["box", "tilted"])
def test_a_peg_that_slides_gives_the_same_forces(peg, cone):
    plain, merged = both(held(peg, cone=cone, free=False))
    for _ in range(20):
        expected, found = plain.step(), merged.step()
        assert_alike(found, expected, 1e-4, 1e-4)
    assert expected[:, :, 2].max() > 0.1


@pytest.mark.parametrize("cone", CONES)
def test_a_peg_that_turns_settles_at_the_same_forces(cone):
    plain, merged = both(held("box", cone=cone))
    for _ in range(80):
        expected, found = plain.step(), merged.step()
    assert_alike(found, expected, 5e-3, 1e-2)


def test_there_are_a_quarter_of_the_rows():
    scene = held("box", free=False)
    plain, merged = both(scene)
    for each in (plain, merged):
        each.step()
    taxels = scene[1].geoms.size
    assert (plain.d.nefc.numpy() == 3 * 4 * taxels).all()
    assert (merged.d.nefc.numpy() == 3 * taxels).all()
    assert merged.d.njmax == plain.d.njmax - 3 * 3 * taxels  # room for two contacts a taxel instead of five


def test_each_world_has_its_gel_also_where_it_stiffens():
    """The stiffest impedance of MuJoCo allows a quarter of the stiffening of four contacts, so solref has the rest."""
    gels = [Gel(), Gel(modulus=200e3), Gel(modulus=20e3, thickness=0.25e-3), Gel(modulus=20e3, thickness=0.2e-3)]
    plain, merged = both(held("box", free=False))
    for each in (plain, merged):
        each.apply(gels)
        each.d.ctrl.fill_(8.0)
    for _ in range(150):
        expected, found = plain.step(), merged.step()
    assert_alike(found, expected, 1e-3, 1e-2)
    np.testing.assert_allclose(merged.d.qpos.numpy(), plain.d.qpos.numpy(), atol=2e-7)
    deepest = -plain.d.contact.dist.numpy()[: plain.d.nacon.numpy()[0]].min()
    assert deepest > 0.65 * gels[3].thickness


def contacts(worlds, **changes):
    """Give the contacts of the data new values, after collision detection."""
    import mujoco_warp

    mujoco_warp.forward(worlds.m, worlds.d)
    for name, change in changes.items():
        field = getattr(worlds.d.contact, name)
        values = field.numpy().copy()
        change(values)
        field.assign(values)


def merge(merged, plain):
    """Merge contacts of data without merging, as MuJoCo Warp does after collision detection."""
    merged.m.callback.contactfilter(merged.m, plain.d)


def state(worlds, count, names=("dist", "pos", "solref", "solimp", "type")):
    return {name: getattr(worlds.d.contact, name).numpy()[:count].copy() for name in names}


def test_other_contacts_are_untouched():
    scene = held("box")
    plain, merged = both(scene, 2)
    other = scene[0].geom("object").id

    def other_geoms_and_flexes(geom):
        geom[:4], geom[4:8] = other, -1

    def inactive(dist):
        dist[8:12] = 1e-3

    def sensors(kind):
        kind[12:16] = CONSTRAINT | SENSOR

    def of_pairs(solref):
        solref[16:20] = 0.02, 1.0

    contacts(plain, geom=other_geoms_and_flexes, dist=inactive, type=sensors, solref=of_pairs)
    count = int(plain.d.nacon.numpy()[0])
    before = state(plain, count)
    merge(merged, plain)
    after = state(plain, count)
    for name, values in before.items():
        np.testing.assert_array_equal(after[name][:20], values[:20], err_msg=name)
    assert np.bincount(after["type"][20:]).tolist() == [(count - 20) * 3 // 4, (count - 20) // 4]


def test_only_equal_normals_are_merged():
    plain, merged = both(held("box"), 2)

    def turned(frame):
        frame[2:4] = frame[2:4, [0, 2, 1]] * [[[1], [1], [-1]]]  # only the tangents
        frame[6:8] = frame[6:8, [1, 2, 0]]

    contacts(plain, frame=turned)
    merge(merged, plain)
    kind = plain.d.contact.type.numpy()
    assert kind[:4].tolist() == [1, 0, 0, 0]
    assert kind[4:8].tolist() == [1, 0, 1, 0]


def test_the_order_of_contacts_does_not_matter():
    """On a GPU, threads write the contacts of all pairs at once."""
    plain, merged = both(held("box"), 3)
    plain.step()
    names = ("geom", "worldid", "frame", "includemargin", "geomcollisionid", "solreffriction", "adhesion")
    names = (*[name for name in names if hasattr(plain.d.contact, name)], "dist", "pos", "solref", "solimp", "type")
    count = int(plain.d.nacon.numpy()[0])
    before = state(plain, count, names)
    found = []
    for seed in (None, 0, 1):
        order = np.arange(count) if seed is None else np.random.default_rng(seed).permutation(count)
        for name, values in before.items():
            field = getattr(plain.d.contact, name)
            field.assign(np.concatenate([values[order], field.numpy()[count:]]))
        merge(merged, plain)
        after = state(plain, count, names)
        back = np.argsort(order)
        found.append({name: values[back] for name, values in after.items()})
    for other in found[1:]:
        for name, values in found[0].items():
            np.testing.assert_array_equal(other[name], values, err_msg=name)


def test_worlds_start_without_contacts():
    model, pads, data = scene = held("box")
    plain, merged = both(scene, 2)
    assert plain.read().any()
    assert not merged.read().any()
    assert merged.step().any()
    # the solver's first guess has the contacts
    _, d = paxisim.warp.put_worlds(model, pads, 2, data=data, device="cpu", merge=True)
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(d.qacc_warmstart.numpy()[0], data.qacc_warmstart, rtol=1e-5, atol=1e-6)


def test_sphere_taxels_have_one_contact_anyway():
    plain, merged = both(held("box", taxels="spheres"), 2)
    assert (plain.d.njmax, plain.d.naconmax) == (merged.d.njmax, merged.d.naconmax)


def test_taxels_without_a_gel_are_an_error():
    model, pads, data = held("box", gel=False)
    paxisim.warp.put_worlds(model, pads, 1, data=data, device="cpu", merge=True)  # the file has a gel too
    model.geom_solref[pads.geoms] = 0.02, 1.0
    with pytest.raises(InvalidValueError, match=r"negative solref of a gel.*call Gel.apply"):
        paxisim.warp.put_worlds(model, find_pads(model), 1, data=data, device="cpu", merge=True)
