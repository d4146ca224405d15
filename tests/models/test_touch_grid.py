"""`TouchGridReadout` returns the tensor of `TactileReadout` or says why it cannot; it never returns another."""

import mujoco
import numpy as np
import pytest
from pressing import JOINTS, LAYOUT, OBJECTS, TILTED, attached, place_object, push, scene, squeezed
from scenes import PAPER

from paxisim import GaussianBump, Mount, Pad, TactileReadout, TaxelLayout, TouchGridReadout, find_pads, set_surface
from paxisim.errors import InvalidValueError, UnsupportedError

SIGN_IS_SOUND = not mujoco.mj_versionString().startswith("3.")
AGREEMENT = 1e-3  # bound on the relative L1 difference; readouts that agree do so to rounding


def pad(layout=LAYOUT, **options):
    return Pad(layout, sensors="touch_grid", **options)


def raw(model, data, pads) -> np.ndarray:
    """Return the raw sensor values, even where the readout refuses them."""
    return np.stack(
        [data.sensor(f"{name}_touch_grid").data.reshape(pads.layout.shape)[[1, 2, 0]] for name in pads.names]
    )


def difference(force, expected) -> float:
    """Return the relative L1 difference."""
    total = np.abs(expected).sum()
    assert total > 0.01
    return float(np.abs(force - expected).sum() / total)


def assert_agrees_or_refuses(model, data, pads) -> bool:
    """Return whether it was read, and check that a refused reading would have been wrong."""
    exact = TactileReadout(model, pads).read_exact(data)
    try:
        force = TouchGridReadout(model, pads).read(data)
    except UnsupportedError:
        assert difference(raw(model, data, pads), exact) > AGREEMENT
        return False
    assert force.dtype == np.float32
    assert difference(force, exact) < AGREEMENT
    return True


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("layout", [LAYOUT, PAPER], ids=["3x4", "12x10"])
def test_a_box_behind_the_pad_in_the_tree_is_read_by_every_version(layout, joint):
    model, pads, data = scene("box", joint=joint, pad=pad(layout))
    for _ in range(3):
        push(model, data, pads, [0.8, -0.5, 3.0], 5)
        assert assert_agrees_or_refuses(model, data, pads)
    out = np.full(pads.shape, np.nan, dtype=np.float32)
    readout = TouchGridReadout(model, pads)
    assert readout.read(data, out=out) is out
    np.testing.assert_array_equal(out, readout.read(data))
    for wrong in (np.zeros(pads.shape), np.zeros(pads.shape[1:], dtype=np.float32)):
        with pytest.raises(InvalidValueError, match="float32 of shape"):
            readout.read(data, out=wrong)
    place_object(model, data, pads, [0, 0, -0.1])
    assert not readout.read(data).any()


@pytest.mark.parametrize("bump", [None, GaussianBump((3.0, 8.0), (1.0, 2.0)), GaussianBump((5, 6), depth_is="recess")])
@pytest.mark.parametrize("shape", OBJECTS)
def test_pegs_on_flat_and_bumped_pads(shape, bump):
    for pads_first in (True, False):
        heights = None if bump is None else bump.heights(PAPER)
        model, pads, data = scene(shape, pads_first=pads_first, pad=pad(PAPER, heights=heights))
        push(model, data, pads, [0.4, -0.3, 2.0], 10)
        taxel_is_second = np.isin(data.contact.geom[:, 1], pads.geoms)
        # MuJoCo orders the geoms of a contact by type, and geoms of the same type by id
        assert np.all(taxel_is_second == (shape not in ("mesh", "box") or (shape == "box" and not pads_first)))
        if SIGN_IS_SOUND or not taxel_is_second.any():
            assert assert_agrees_or_refuses(model, data, pads)
            continue
        version = rf"wrong sign before MuJoCo 4\.0 \(this is {mujoco.__version__}\).*'object' on 'carr"
        with pytest.raises(UnsupportedError, match=version):
            TouchGridReadout(model, pads).read(data)
        assert difference(-raw(model, data, pads), TactileReadout(model, pads).read_exact(data)) < AGREEMENT


def test_two_pads_each_read_their_own():
    # the object comes after both pads in the tree, so that the taxels come first
    for cone in ("elliptic", "pyramidal"):
        model, pads, data = squeezed("box", cone=cone, pad=pad(PAPER), order=("fixed", "moving", "object"))
        mujoco.mj_step(model, data, 20)
        force = TouchGridReadout(model, pads).read(data)
        assert np.all(force[:, 2].sum(axis=(1, 2)) > 0.1)
        assert difference(force, TactileReadout(model, pads).read(data)) < AGREEMENT
        swapped = find_pads(model, names=pads.names[::-1])
        np.testing.assert_array_equal(TouchGridReadout(model, swapped).read(data), force[::-1])


@pytest.mark.parametrize("seeds", [range(8), pytest.param(range(8, 40), marks=pytest.mark.slow)], ids=["few", "many"])
def test_whatever_is_read_is_right(seeds):
    """For random pads, surfaces, margins, objects and places, the readouts agree, or a wrong one is refused."""
    for seed in seeds:
        print("seed", seed)
        rng = np.random.default_rng(seed)
        layout = [LAYOUT, PAPER, PAPER.pool(2, 2)][rng.integers(3)]
        bump = GaussianBump.sample(layout, rng).heights(layout)
        heights = [None, rng.uniform(0.5e-3, 1.5e-3, (layout.rows, layout.cols)), bump][rng.integers(3)]
        shape, joint, cone = (rng.choice(list(names)) for names in (OBJECTS, JOINTS, ("elliptic", "pyramidal")))
        model, pads, data = scene(
            shape, joint=joint, cone=cone, quat=rng.normal(size=4), pad=pad(layout, heights=heights)
        )
        if rng.random() < 0.2:
            model.geom_margin[pads.geoms] = model.body_margin[pads.bodies] = 1e-3
        place = [*rng.uniform(-0.4, 0.4, 2) * layout.size[::-1], rng.uniform(0.3e-3, 1e-3) - OBJECTS[shape][1]]
        place_object(model, data, pads, place)
        push(model, data, pads, [*rng.uniform(-2, 2, 2), rng.uniform(2, 8)], 3)
        assert_agrees_or_refuses(model, data, pads)


# what is refused


def test_contacts_sorted_into_another_taxels_bin():
    """The plugin assigns a contact to a bin by the angle at which it sees the contact."""
    model, pads, data = scene("mesh", pad=pad(PAPER))
    readout = TouchGridReadout(model, pads)
    assert readout.read(data).any()
    # seen from half a metre, a surface 3 mm higher looks 70 um further out at the pad's edge
    set_surface(model, pads, np.full((12, 10), 4e-3))
    place_object(model, data, pads, [6e-3, 6e-3, 0.2e-3 - 3e-3 - OBJECTS["mesh"][1]])
    with pytest.raises(UnsupportedError, match=r"taxel \(\d+, \d+\) of pad 'carrier_pad'.*another taxel's bin"):
        readout.read(data)
    assert not assert_agrees_or_refuses(model, data, pads)


def test_a_fingers_own_contacts():
    finger = '<geom name="finger" type="box" size="0.002 0.004 0.004" pos="-0.011 0 -0.0011"/>'
    block = '<body name="block" pos="0 0 -0.003"><freejoint/><geom type="mesh" mesh="block" mass="0.1"/></body>'
    world = f"""<mujoco><option cone="elliptic" gravity="0 0 9"/><asset><mesh name="block" vertex="-.012 -.003 -.003
      .012 -.003 -.003  .012 .003 -.003  -.012 .003 -.003 -.012 -.003 .003  .012 -.003 .003  .012 .003 .003
      -.012 .003 .003"/></asset><worldbody><body name="finger">{finger}</body>{block}</worldbody></mujoco>"""
    model, pads, data = attached(world, pad(), Mount("finger", pos=(0.002, 0, -1e-4)))
    mujoco.mj_step(model, data, 5)
    with pytest.raises(UnsupportedError, match="other geoms on the pad's finger"):
        TouchGridReadout(model, pads).read(data)
    assert TactileReadout(model, pads).read(data).any()
    model.geom("finger").contype[:] = model.geom("finger").conaffinity[:] = 0
    mujoco.mj_step(model, data)
    assert assert_agrees_or_refuses(model, data, pads)


def test_another_pad_on_the_same_finger():
    """Each of the two sensors counts the contacts of both pads."""
    plate = '<body pos="0 0 -0.002"><freejoint/><geom type="box" size="0.02 0.006 0.002" mass="0.5"/></body>'
    world = f"""<mujoco><option cone="elliptic" gravity="0 0 9"/><worldbody><body name="finger"/>{plate}
      </worldbody></mujoco>"""
    mounts = [Mount("finger", pos=(x, 0, 0), name=name) for x, name in ((-0.009, "a"), (0.009, "b"))]
    model, pads, data = attached(world, pad(), *mounts)
    mujoco.mj_step(model, data, 5)
    assert np.all(TactileReadout(model, pads).read(data)[:, 2].sum(axis=(1, 2)) > 0.1)
    for names in (pads.names, pads.names[:1], pads.names[1:]):
        with pytest.raises(UnsupportedError, match="another pad's included"):
            TouchGridReadout(model, find_pads(model, names=names)).read(data)


def test_contacts_of_flexes_and_disabled_sensors():
    cloth = """<flexcomp name="cloth" type="grid" dim="2" count="4 4 1" spacing="0.003 0.003 0.003" pos="0 0 0.003"
      mass="0.01" radius="0.001"><contact selfcollide="none"/><edge equality="true"/></flexcomp>"""
    world = f"""<mujoco><option timestep="0.001" cone="elliptic"/><worldbody>{cloth}<body name="carrier"/>
      </worldbody></mujoco>"""
    model, pads, data = attached(world, pad(), Mount("carrier", pos=(0, 0, 0.002), quat=(0, 1, 0, 0)))
    mujoco.mj_step(model, data, 30)
    assert -1 in data.contact.geom
    assert difference(raw(model, data, pads), TactileReadout(model, pads).read(data)) > AGREEMENT
    with pytest.raises(UnsupportedError, match="flexes"):
        TouchGridReadout(model, pads).read(data)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
    with pytest.raises(UnsupportedError, match="sensors are disabled"):
        TouchGridReadout(model, pads).read(data)


def test_pads_without_a_flat_grid_of_cubes_with_gaps_or_without_the_sensor():
    normals = [[np.sin(a), 0, -np.cos(a)] for a in (-0.2, 0.2)]
    with pytest.raises(UnsupportedError, match=r"flat grid.*TactileReadout"):
        pad(TaxelLayout(1, 2, 4e-3, [[-2e-3, 0, 0], [2e-3, 0, 0]], normals))
    model, pads, _ = scene("box", pad=pad(), quat=TILTED)
    model.geom_size[pads.geoms, :2] = LAYOUT.pitch[0] / 2
    with pytest.raises(UnsupportedError, match=r"contiguous.*bin edges.*50 um"):
        TouchGridReadout(model, pads)
    model.geom_pos[pads.geoms[0, 0], 0] += 1e-3  # bent after it was built
    with pytest.raises(UnsupportedError, match="flat grid"):
        TouchGridReadout(model, find_pads(model))
    for sensors in (None, "contact"):
        model, pads, _ = scene("box", pad=Pad(LAYOUT, sensors=sensors))
        with pytest.raises(InvalidValueError, match=r"'carrier_pad' has no touch_grid .*Pad\(sensors='touch_grid'\)"):
            TouchGridReadout(model, pads)
