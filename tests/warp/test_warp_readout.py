"""WarpTactileReadout against TactileReadout on MuJoCo's own engine, with bumps and loads of each world's own."""

import mujoco
import numpy as np
import pytest
from held import Engine, Warped, bumps, differences, held, loads, needs_warp

from paxisim.errors import InvalidValueError

pytestmark = needs_warp
CONES = ["elliptic", "pyramidal"]


@pytest.mark.parametrize("cone", CONES)
def test_64_worlds_read_what_mujoco_reads(cone):
    warped, _ = differences(held("box", cone=cone, free=False), 64, 200)
    assert warped.max() < 1e-4


@pytest.mark.parametrize("cone", CONES)
def test_a_box_that_turns_differs_in_single_steps_only(cone):
    """Its contacts jump where two separating axes are equally deep: the last digit decides which of them counts."""
    warped, _ = differences(held("box", cone=cone), 16, 100)
    assert np.quantile(warped, 0.999) < 1e-4
    assert warped.max() < 1e-2


@pytest.mark.parametrize("cone", CONES)
@pytest.mark.parametrize("peg", ["mesh", "sphere", "cylinder"])
def test_other_pegs_differ_no_more_than_mujoco_does_from_itself(peg, cone):
    """Round objects have contacts that a tenth of a micrometre moves from taxel to taxel."""
    warped, moved = differences(held(peg, cone=cone), 24, 120)
    for share in (0.5, 0.99):
        assert np.quantile(warped, share) < 1e-4 + 3 * np.quantile(moved, share)


def test_sphere_taxels_read_the_same():
    warped, _ = differences(held("box", taxels="spheres"), 8, 60)
    assert np.quantile(warped, 0.999) < 1e-4


@pytest.mark.parametrize("cone", CONES)
def test_the_taxels_sum_to_the_load_and_the_weight(cone):
    model, pads, data = held("box", cone=cone)
    forces = loads(4)
    warped = Warped(model, pads, data, bumps(4, pads), forces)
    for _ in range(300):
        reading = warped.step()
    total = reading.sum(axis=(-2, -1))
    np.testing.assert_allclose(total[:, :, 2], np.stack([forces, forces], axis=1), rtol=2e-3)
    # gravity is along y of both pads, up to the sign
    np.testing.assert_allclose(np.abs(total[:, :, 1]).sum(axis=1), 0.03 * 9.81, rtol=0.05)


def test_a_read_is_a_tensor_that_the_next_one_overwrites():
    import torch

    model, pads, data = held()
    warped = Warped(model, pads, data, bumps(2, pads), loads(2))
    warped.step()
    first = warped.readout.read(warped.m, warped.d)
    assert isinstance(first, torch.Tensor)
    assert first.dtype == torch.float32
    assert first.shape == (2, 2, 3, 4, 3)
    kept = first.clone()
    warped.step()
    assert torch.equal(first, warped.readout.read(warped.m, warped.d))
    assert not torch.equal(first, kept)


def test_without_contact_all_is_zero():
    model, pads, data = held()
    start = model.joint("object").qposadr[0]
    data.qpos[start] += 1.0
    mujoco.mj_forward(model, data)
    warped = Warped(model, pads, data, None, loads(2))
    assert not warped.step().any()


def test_a_world_that_is_reset_reads_zero_until_it_steps_again():
    import mujoco_warp
    import warp

    model, pads, data = held()
    warped = Warped(model, pads, data, bumps(2, pads), loads(2))
    warped.step()
    mujoco_warp.reset_data(warped.m, warped.d, warp.array([True, False], dtype=bool, device="cpu"))
    assert np.isfinite(warped.read()).all()
    mujoco_warp.forward(warped.m, warped.d)
    assert warped.read()[1].max() > 0.01


def test_a_subset_of_the_pads_is_read_in_its_order():
    import paxisim.warp
    from paxisim.models.pads import find_pads

    model, pads, data = held()
    warped = Warped(model, pads, data, bumps(2, pads), loads(2))
    both = warped.step()
    other = find_pads(model, names=pads.names[::-1])
    turned = paxisim.warp.WarpTactileReadout(model, other, 2, device="cpu")
    np.testing.assert_array_equal(turned.read(warped.m, warped.d).numpy(), both[:, ::-1])


def test_another_number_of_worlds_is_an_error():
    import paxisim.warp

    model, pads, data = held()
    warped = Warped(model, pads, data, None, loads(2))
    readout = paxisim.warp.WarpTactileReadout(model, pads, 3, device="cpu")
    with pytest.raises(InvalidValueError, match="made for 3 worlds, but the data has 2"):
        readout.read(warped.m, warped.d)
    with pytest.raises(InvalidValueError, match="at least one world"):
        paxisim.warp.WarpTactileReadout(model, pads, 0, device="cpu")
    with pytest.raises(InvalidValueError, match="at least one world"):
        paxisim.warp.put_worlds(model, pads, 0, device="cpu")


def test_pads_on_a_moving_hand_read_the_same():
    model, pads, data = held(fixed=False)
    heights, forces = bumps(4, pads), loads(4)
    warped, engine = (kind(model, pads, data, heights, forces) for kind in (Warped, Engine))
    for _ in range(30):
        reading, expected = warped.step(), engine.step()
    np.testing.assert_allclose(reading, expected, atol=1e-4)


def test_a_model_that_put_worlds_did_not_make_has_one_surface_and_gel_for_all():
    import mujoco_warp
    import warp

    import paxisim.warp
    from paxisim.models.gel import Gel

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
