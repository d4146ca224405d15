"""WarpTactileReadout against TactileReadout on MuJoCo's own engine, with bumps and loads of each world's own."""

import mujoco
import numpy as np
import pytest
from held import Engine, Warped, bumps, differences, held, loads, needs_warp, warped

import paxisim
from paxisim.errors import InvalidValueError
from paxisim.models.gel import Gel
from paxisim.models.pads import find_pads

pytestmark = needs_warp
cones = pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])


@cones
def test_64_worlds_read_what_mujoco_reads(cone):
    found, _ = differences(held("box", cone=cone, free=False), 64, 200)
    assert found.max() < 1e-4


@cones
def test_a_box_that_turns_differs_in_single_steps_only(cone):
    """Its contacts jump where two separating axes are equally deep: the last digit decides which of them counts."""
    found, _ = differences(held("box", cone=cone), 16, 100)
    assert np.quantile(found, 0.999) < 1e-4
    assert found.max() < 1e-2


@cones
@pytest.mark.parametrize("peg", ["mesh", "sphere", "cylinder"])
def test_other_pegs_differ_no_more_than_mujoco_does_from_itself(peg, cone):
    """Round objects have contacts that a tenth of a micrometre moves from taxel to taxel."""
    found, moved = differences(held(peg, cone=cone), 24, 120)
    for share in (0.5, 0.99):
        assert np.quantile(found, share) < 1e-4 + 3 * np.quantile(moved, share)


def test_sphere_taxels_read_the_same():
    found, _ = differences(held("box", taxels="spheres"), 8, 60)
    assert np.quantile(found, 0.999) < 1e-4


def test_pads_on_a_moving_hand_read_the_same():
    model, pads, data = held(fixed=False)
    worlds, engine = (kind(model, pads, data, bumps(4, pads), loads(4)) for kind in (Warped, Engine))
    for _ in range(30):
        reading, expected = worlds.step(), engine.step()
    np.testing.assert_allclose(reading, expected, atol=1e-4)


@cones
def test_the_taxels_sum_to_the_load_and_the_weight(cone):
    worlds, forces = warped(held("box", cone=cone), 4), loads(4)
    for _ in range(300):
        reading = worlds.step()
    total = reading.sum(axis=(-2, -1))
    np.testing.assert_allclose(total[:, :, 2], np.stack([forces, forces], axis=1), rtol=2e-3)
    # gravity is along y of both pads, up to the sign
    np.testing.assert_allclose(np.abs(total[:, :, 1]).sum(axis=1), 0.03 * 9.81, rtol=0.05)


def test_a_read_is_a_tensor_of_the_pads_in_their_order_that_the_next_one_overwrites():
    import torch

    scene = model, pads, _ = held()
    worlds = warped(scene)
    worlds.step()
    first = worlds.readout.read(worlds.m, worlds.d)
    assert isinstance(first, torch.Tensor)
    assert first.dtype == torch.float32
    assert first.shape == (2, 2, 3, 4, 3)
    kept = first.clone()
    worlds.step()
    assert torch.equal(first, worlds.readout.read(worlds.m, worlds.d))
    assert not torch.equal(first, kept)
    swapped = find_pads(model, names=pads.names[::-1])
    turned = paxisim.warp.WarpTactileReadout(model, swapped, 2, device="cpu")
    np.testing.assert_array_equal(turned.read(worlds.m, worlds.d).numpy(), worlds.read()[:, ::-1])
    # another number of worlds
    readout = paxisim.warp.WarpTactileReadout(model, pads, 3, device="cpu")
    with pytest.raises(InvalidValueError, match="made for 3 worlds, but the data has 2"):
        readout.read(worlds.m, worlds.d)
    for make in (paxisim.warp.WarpTactileReadout, paxisim.warp.put_worlds):
        with pytest.raises(InvalidValueError, match="at least one world"):
            make(model, pads, 0, device="cpu")


def test_without_contact_all_is_zero_and_a_world_that_is_reset_reads_on_when_it_steps_again():
    import mujoco_warp
    import warp

    scene = model, _, data = held()
    worlds = warped(scene)
    worlds.step()
    mujoco_warp.reset_data(worlds.m, worlds.d, warp.array([True, False], dtype=bool, device="cpu"))
    assert np.isfinite(worlds.read()).all()
    mujoco_warp.forward(worlds.m, worlds.d)
    assert worlds.read()[1].max() > 0.01
    data.qpos[model.joint("object").qposadr[0]] += 1.0
    mujoco.mj_forward(model, data)
    assert not warped(scene, flat=True).step().any()


def test_a_model_that_put_worlds_did_not_make_has_one_surface_and_gel_for_all():
    import mujoco_warp
    import warp

    model, pads, data = held(free=False)
    surface = bumps(1, pads)[0]
    with warp.ScopedDevice("cpu"):
        m = mujoco_warp.put_model(model)
        d = mujoco_warp.put_data(model, data, nworld=3, nconmax=200, njmax=600)
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_NATIVECCD)
    paxisim.warp.set_surface(m, d, model, pads, surface)
    paxisim.warp.apply_gel(m, model, pads, Gel())
    d.ctrl.fill_(4.0)
    readout = paxisim.warp.WarpTactileReadout(model, pads, 3, device="cpu")
    engine = Engine(model, pads, data, [surface] * 3, [4.0] * 3)
    for _ in range(12):
        mujoco_warp.step(m, d)
        reading, expected = readout.read(m, d).numpy(), engine.step()
    np.testing.assert_allclose(reading, expected, atol=1e-4)
