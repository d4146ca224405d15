"""`TactileReadout` against MuJoCo's own contact forces, static equilibrium and the sign convention."""

import itertools

import mujoco
import numpy as np
import pytest
from pressing import (
    JOINTS,
    LAYOUT,
    OBJECTS,
    TILTED,
    WEIGHT,
    attached,
    give_gap,
    place_object,
    push,
    rotation,
    scene,
    squeezed,
    turned,
)
from scipy.spatial.transform import Rotation

from paxisim import Gel, InvalidValueError, Mount, Pad, TactileReadout, TaxelLayout, UnsupportedError, find_pads
from paxisim.models.readout import SLEEP

EXACT = 1e-9  # N
CONES = ("elliptic", "pyramidal")
cones = pytest.mark.parametrize("cone", CONES)


def reference(model, data, pads) -> np.ndarray:
    """Return the tensor from a plain loop over the contacts, with their forces from MuJoCo's own function."""
    taxels = {}
    for pad, geoms in enumerate(pads.geoms):
        for index, geom in enumerate(geoms):
            taxels[int(geom)] = (pad, *divmod(index, pads.layout.cols))
    result, wrench = np.zeros(pads.shape), np.zeros(6)
    for number in range(data.ncon):
        contact = data.contact[number]
        mujoco.mj_contactForce(model, data, number, wrench)
        on_second = contact.frame.reshape(3, 3).T @ wrench[:3]
        for geom, force in ((contact.geom[0], -on_second), (contact.geom[1], on_second)):
            if int(geom) in taxels:
                pad, row, col = taxels[int(geom)]
                result[pad, :, row, col] += rotation(data, pads, pad).T @ force
    return result


def assert_exact(readout, model, data) -> None:
    """Check that the reading equals the reference and is not zero for lack of contact."""
    expected = reference(model, data, readout.pads)
    assert np.abs(expected).max() > 0.01
    np.testing.assert_allclose(readout.read_exact(data), expected, rtol=0, atol=EXACT)


# against MuJoCo's own function


def test_equals_the_sum_of_contact_forces():
    for shape, pads_first, joint, cone in itertools.product(OBJECTS, (True, False), JOINTS, CONES):
        print(shape, "pads first" if pads_first else "object first", joint, cone)
        model, pads, data = scene(shape, pads_first=pads_first, joint=joint, cone=cone)
        readout = TactileReadout(model, pads)
        for _ in range(3):
            push(model, data, pads, [0.8, -0.5, 3.0], 5)
            assert_exact(readout, model, data)
        total = readout.read(data).sum(axis=(0, 2, 3))
        assert total[2] > 1
        assert np.all(np.abs(total[:2]) > 0.05)


@cones
@pytest.mark.parametrize("condims", [(3, 3), (3, 3, 3, 3), (1, 3), (4, 1, 4, 3), (3, 3, 6, 3), (1, 6, 3, 1, 4)])
def test_one_contact_a_taxel(condims, cone):
    """Contacts have any condim, one is inactive, and any number of other constraints come before them.

    With more rows for some contacts and fewer for others, the total may equal that of contacts with three rows each.
    """
    count = len(condims)
    balls = "".join(
        f'<body><joint type="slide" axis="0 0 1"/><joint type="slide" axis="1 1 0"/>'
        f'<geom type="sphere" size="0.0015" pos="{(col - 2) * 4e-3} 0 -0.0014" mass="0.01"/></body>'
        for col in range(count)
    )
    dry = '<body><joint name="dry{}" type="hinge"/><geom size="0.01" pos="1 {} 0" mass="1"/></body>'
    world = f"""<mujoco><option cone="{cone}" gravity="0.5 0.5 9"/><worldbody><body name="carrier"/>
      {balls}{"".join(dry.format(i, i) for i in range(2))}</worldbody></mujoco>"""
    model, pads, data = attached(world, Pad(TaxelLayout(1, 5, 4e-3)), Mount("carrier"))
    readout = TactileReadout(model, pads)
    model.geom_condim[pads.geoms[0, :count]] = condims
    mujoco.mj_step(model, data, 3)
    assert sorted(data.contact.dim) == sorted(condims)
    assert_exact(readout, model, data)
    positions = model.geom_pos.copy()
    for others, waiting in np.ndindex(3, count):
        model.dof_frictionloss[-2:] = np.arange(2) < others
        model.geom_pos[:] = positions
        model.geom_gap[:] = model.geom_margin[:] = 0
        model.geom_pos[pads.geoms[0, waiting], 2] += 0.5e-3
        give_gap(model, data, pads.geoms[0, waiting : waiting + 1])
        assert sorted(data.contact.dim) == sorted(condims)
        assert np.sum(data.contact.efc_address < 0) == 1
        assert data.nefc > others
        assert_exact(readout, model, data)


def test_rows_of_a_pyramidal_cone_that_look_like_those_of_an_elliptic_one():
    """The last of four contacts with four rows has the same address as the last of five with three rows."""
    places = [(-3, -3), (3, -3), (-3, 3), (3, 3), (0, 0)]
    balls = "".join(
        f"""<body pos="{x * 1e-3} {y * 1e-3} {-1.2e-3 if waits else -0.98e-3}"><freejoint/>
        <geom {'name="waits"' if waits else ""} type="sphere" size="0.001" mass="0.1"/></body>"""
        for waits, (x, y) in zip([0, 0, 0, 1, 0], places, strict=True)
    )
    world = f'<mujoco><worldbody><body name="f"/>{balls}</worldbody></mujoco>'
    model, pads, data = attached(world, Pad(TaxelLayout(1, 1, 10e-3)), Mount("f"))
    data.qvel[0::6], data.qvel[2::6] = 0.05, 0.1
    give_gap(model, data, [model.geom("waits").id])
    assert data.contact.efc_address.tolist() == [0, 4, 8, -1, 12]
    assert_exact(TactileReadout(model, pads), model, data)


@cones
def test_contacts_within_their_gap_carry_nothing(cone):
    """A contact that is listed but not active has no constraint: its address is -1."""
    model, pads, data = scene(cone=cone)
    readout = TactileReadout(model, pads)
    place_object(model, data, pads, [0, 0, -0.5e-3 - OBJECTS["box"][1]])
    give_gap(model, data, pads.geoms[0])
    for others in (False, True):
        model.dof_frictionloss[:] = 0.1 * others
        place_object(model, data, pads, [0, 0, -0.5e-3 - OBJECTS["box"][1]])
        assert data.ncon > 0
        assert (data.nefc > 0) == others
        assert not readout.read(data).any()
    place_object(model, data, pads, [0, 0, -0.1])
    assert data.ncon == 0
    force = readout.read(data)
    assert force.shape == pads.shape
    assert not force.any()


def test_a_cloth_on_a_pad_counts_for_the_taxels_it_touches():
    """A flex has no geom: MuJoCo writes -1, which must not be taken for the model's last geom, here a taxel."""
    cloth = """<flexcomp name="cloth" type="grid" dim="2" count="5 5 1" spacing="0.003 0.003 0.003" pos="0 0 0.003"
      mass="0.01" radius="0.001"><contact selfcollide="none"/><edge equality="true"/></flexcomp>"""
    floor = '<geom name="floor" type="box" size="0.1 0.1 0.001" pos="0.1 0 0.001"/>'
    world = f"""<mujoco><option timestep="0.001" cone="elliptic"/><worldbody>{floor}{cloth}
      <body name="carrier"/></worldbody></mujoco>"""
    # the left half of the cloth lies on the pad, the right half on the floor
    model, pads, data = attached(world, Pad(LAYOUT), Mount("carrier", pos=(-0.009, 0, 0.002), quat=(0, 1, 0, 0)))
    assert pads.geoms.max() == model.ngeom - 1
    readout = TactileReadout(model, pads)
    mujoco.mj_step(model, data, 30)
    touched = set(data.contact.geom.reshape(-1).tolist())
    assert {-1, model.geom("floor").id} <= touched
    assert touched & set(pads.geoms[0].tolist())
    assert_exact(readout, model, data)


@cones
def test_pads_that_touch_each_other(cone):
    """Only overridden contact bits allow this; each contact counts for both taxels, with opposite forces."""
    into_low = " ".join(map(str, Rotation.from_quat(np.roll(TILTED, -1)).as_matrix()[:, 2]))
    world = f"""<mujoco><option cone="{cone}" gravity="0 0 0"/><worldbody><body name="low"/>
      <body name="high"><joint type="slide" axis="{into_low}"/>{WEIGHT}</body></worldbody></mujoco>"""
    mounts = [Mount("low", quat=TILTED), Mount("high", quat=tuple(turned(TILTED)))]
    model, pads, data = attached(world, Pad(LAYOUT), *mounts)
    data.qpos[0] = 1e-4
    data.qvel[0] = 0.01
    readout = TactileReadout(model, pads)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    model.geom_contype[pads.geoms] = model.body_contype[pads.bodies] = 1
    mujoco.mj_step(model, data)
    assert_exact(readout, model, data)
    force = readout.read_exact(data)
    assert np.all(force[:, 2].sum(axis=(1, 2)) > 0.1)
    totals = [rotation(data, pads, pad) @ force[pad].sum(axis=(1, 2)) for pad in (0, 1)]
    np.testing.assert_allclose(totals[0], -totals[1], atol=EXACT)


# signs and places


def unit(vector) -> np.ndarray:
    return vector / np.linalg.norm(vector)


@pytest.mark.parametrize(
    ("shape", "pads_first", "quat"),
    [
        ("box", True, (1, 0, 0, 0)),
        ("box", False, TILTED),
        ("mesh", True, (0.5, -0.5, 0.5, 0.5)),
        ("cylinder", True, TILTED),
    ],
)
def test_signs_press_drag_right_drag_down(shape, pads_first, quat):
    """Pressing reads +z, dragging right (towards the last column) +x, dragging down (towards the last row) +y."""
    model, pads, data = scene(shape, pads_first=pads_first, quat=quat)
    readout = TactileReadout(model, pads)
    # take the directions from the taxels' world positions, not from any frame's axes
    grid = data.geom_xpos[pads.geoms[0]].reshape(3, 4, 3)
    right = unit(grid[1, -1] - grid[1, 0])
    down = unit(grid[-1, 1] - grid[0, 1])
    into_pad = unit(grid.mean(axis=(0, 1)) - data.body("object").xpos)
    into_pad = unit(into_pad - right * (right @ into_pad) - down * (down @ into_pad))
    for drag, expected in ((0 * right, (0, 0, 2)), (right, (1, 0, 2)), (down, (0, 1, 2)), (-down, (0, -1, 2))):
        data.body("object").xfrc_applied[:3] = 2 * into_pad + drag
        mujoco.mj_step(model, data, 50)
        total = readout.read(data)[0].sum(axis=(1, 2))
        np.testing.assert_allclose(total, expected, atol=0.3)


def test_a_curved_pad_is_read_in_the_pads_frame():
    angles = np.radians([-40, -15, 10, 35])
    normals = np.column_stack([np.sin(angles), 0 * angles, -np.cos(angles)])
    layout = TaxelLayout(1, 4, (8e-3, 4e-3), positions=0.012 * normals + [0, 0, 0.012], normals=normals)
    model, pads, data = scene("sphere", pad=Pad(layout))
    readout = TactileReadout(model, pads)
    for index, normal in enumerate(normals):
        place_object(model, data, pads, layout.positions[index] + normal * (OBJECTS["sphere"][1] - 0.2e-3))
        assert_exact(readout, model, data)
        force = readout.read_exact(data)[0, :, 0, index]
        np.testing.assert_allclose(unit(force), -normal, atol=1e-3)


@cones
def test_several_pads_in_the_order_asked_for_equal_the_embedded_contact_sensors(cone):
    """The sensors give the force on the object, in the world frame."""
    pad = Pad(LAYOUT, gel=Gel(modulus=3e6, thickness=1e-3), sensors="contact")
    model, pads, data = squeezed("box", cone=cone, pad=pad)
    mujoco.mj_step(model, data, 20)
    force = TactileReadout(model, pads).read_exact(data)
    assert np.all(force[:, 2].max(axis=(1, 2)) > 0.1)
    assert not np.allclose(force[0], force[1])
    for pad, name in enumerate(pads.names):
        for row, col in np.ndindex(3, 4):
            sensor = data.sensor(f"{name}_force_{row}_{col}").data
            np.testing.assert_allclose(rotation(data, pads, pad).T @ -sensor, force[pad, :, row, col], atol=EXACT)
    swapped, one = (find_pads(model, names=names) for names in (pads.names[::-1], pads.names[1:]))
    np.testing.assert_array_equal(TactileReadout(model, swapped).read_exact(data), force[::-1])
    np.testing.assert_array_equal(TactileReadout(model, one).read_exact(data), force[1:])


# one reading after another


def test_read_rounds_the_exact_value_to_float32_and_changes_nothing():
    model, pads, data = scene()
    readout = TactileReadout(model, pads)
    assert readout.pads is pads
    for cone in (mujoco.mjtCone.mjCONE_PYRAMIDAL, mujoco.mjtCone.mjCONE_ELLIPTIC):
        model.opt.cone = cone
        push(model, data, pads, [0.8, -0.5, 3.0], 5)
        assert_exact(readout, model, data)
    before = data.efc_force.copy(), data.contact.frame.copy()
    force, exact = readout.read(data), readout.read_exact(data)
    assert (force.dtype, exact.dtype) == (np.float32, np.float64)
    assert force.shape == pads.shape == (1, 3, 3, 4)
    np.testing.assert_array_equal(force, exact.astype(np.float32))
    for array, now in zip(before, (data.efc_force, data.contact.frame), strict=True):
        np.testing.assert_array_equal(array, now)
    kept = force.copy()
    push(model, data, pads, [0, 0, 3.0], 5)
    readout.read(data)
    np.testing.assert_array_equal(force, kept)


def test_out_is_written_and_returned_or_refused():
    model, pads, data = scene()
    readout = TactileReadout(model, pads)
    stacked = np.full((4, *pads.shape), np.nan, dtype=np.float32)
    assert np.shares_memory(readout.read(data, out=stacked[2]), stacked)
    np.testing.assert_array_equal(stacked[2], readout.read(data))
    assert np.isnan(stacked[[0, 1, 3]]).all()
    strided = np.zeros((*pads.shape, 2), dtype=np.float32)[..., 0]
    np.testing.assert_array_equal(readout.read(data, out=strided), readout.read(data))
    readout.accumulate(data)
    for shape, dtype in (((1, 3, 3, 4), "float64"), ((3, 3, 4), "float32"), ((1, 3, 4, 3), "float32")):
        with pytest.raises(InvalidValueError, match=rf"float32 of shape \(1, 3, 3, 4\), got {dtype}"):
            readout.read(data, out=np.zeros(shape, dtype))
        with pytest.raises(InvalidValueError, match=f"got {dtype}"):
            readout.mean(out=np.zeros(shape, dtype))
    np.testing.assert_array_equal(readout.mean(), readout.read(data), err_msg="the refused calls lost no data")


def test_mean_over_substeps():
    model, pads, data = scene()
    readout = TactileReadout(model, pads)
    readout.accumulate(data)
    readout.reset()
    for substeps in (25, 4):  # each mean starts afresh
        with pytest.raises(InvalidValueError, match="accumulate"):
            readout.mean()
        reads = []
        for _ in range(substeps):
            push(model, data, pads, [0.8, -0.5, 3.0], 1)
            readout.accumulate(data)
            reads.append(readout.read_exact(data))
        assert np.ptp(reads, axis=0).max() > 1e-3
        out = np.empty(pads.shape, dtype=np.float32)
        assert readout.mean(out=out) is out
        np.testing.assert_allclose(out, np.mean(reads, axis=0), rtol=1e-6, atol=1e-9)


@pytest.mark.skipif(not SLEEP, reason="this MuJoCo has no sleeping bodies")
def test_a_model_whose_bodies_sleep_is_refused():
    model, pads, data = scene()
    push(model, data, pads, [0, 0, 1.0], 5)
    readout = TactileReadout(model, pads)
    assert readout.read(data).any()
    model.opt.enableflags |= SLEEP
    with pytest.raises(UnsupportedError, match=r'sleep.*would read as 0 N: remove <flag sleep="enable"/>'):
        readout.read(data)
