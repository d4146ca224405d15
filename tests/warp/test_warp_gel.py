"""Gels of each world's own on MuJoCo Warp, and the error where set_const has undone one."""

import copy

import mujoco
import numpy as np
import pytest
from held import Warped, bumps, held, loads, needs_warp

from paxisim.errors import InvalidValueError, UnsupportedError
from paxisim.models.gel import Gel
from paxisim.models.pads import set_surface
from paxisim.models.readout import TactileReadout

pytestmark = needs_warp
GELS = (Gel(), Gel(modulus=60e3, relaxation=0.02), Gel(modulus=200e3, thickness=2e-3, friction=0.6))


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_each_world_has_its_gel(cone):
    import paxisim.warp

    model, pads, data = held(cone=cone)
    surface = bumps(1, pads)[0]  # a softer gel spreads the load further around a bump
    warped = Warped(model, pads, data, [surface] * 3, [5.0] * 3)
    paxisim.warp.apply_gel(warped.m, model, pads, GELS)
    worlds = []
    for gel in GELS:
        own, state = copy.copy(model), copy.copy(data)
        gel.apply(own, pads)
        set_surface(own, pads, surface)
        state.ctrl[0] = 5.0
        worlds.append((own, state, TactileReadout(own, pads)))
    for _ in range(50):
        reading = warped.step()
        for own, state, _ in worlds:
            mujoco.mj_step(own, state)
    expected = np.stack([readout.read(state) for _, state, readout in worlds])
    np.testing.assert_allclose(reading, expected, atol=1e-4)
    assert np.abs(expected[0] - expected[1]).max() > 0.01


def test_taxels_outrank_an_object_with_a_priority():
    import paxisim.warp

    model, pads, data = held()
    model.geom_priority[model.geom("object").id] = 3
    warped = Warped(model, pads, data, None, loads(2))
    paxisim.warp.apply_gel(warped.m, model, pads, Gel())
    assert set(warped.m.geom_priority.numpy()[pads.geoms].flat) == {4}


def test_a_mask_keeps_the_other_gels():
    import paxisim.warp

    model, pads, data = held()
    warped = Warped(model, pads, data, None, loads(3))
    before = warped.m.body_invweight0.numpy().copy()
    paxisim.warp.apply_gel(warped.m, model, pads, Gel(modulus=50e3), np.array([False, True, False]))
    after = warped.m.body_invweight0.numpy()
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
    np.testing.assert_allclose(after[1, pads.bodies, 0], 2 * before[1, pads.bodies, 0], rtol=1e-6)
    assert np.isfinite(warped.step()).all()


def test_a_gel_that_set_const_undoes_is_an_error():
    import mujoco_warp

    import paxisim.warp

    model, pads, data = held()
    warped = Warped(model, pads, data, bumps(2, pads), loads(2))
    good = warped.step()
    mujoco_warp.set_const(warped.m, warped.d)
    with pytest.raises(UnsupportedError, match=r"gel is undone in 2 of 2 worlds.*call paxisim.warp.apply_gel after it"):
        warped.step()
    with pytest.raises(UnsupportedError, match="gel is undone"):
        paxisim.warp.check_gel(warped.m)
    paxisim.warp.apply_gel(warped.m, model, pads, Gel())
    paxisim.warp.check_gel(warped.m)
    assert np.abs(warped.step() - good).max() < 1


def test_later_reads_are_nan_while_the_gel_is_undone():
    """Reads after the first do not wait for the device, so they cannot raise."""
    import mujoco_warp

    import paxisim.warp

    model, pads, data = held()
    warped = Warped(model, pads, data, bumps(2, pads), loads(2))
    for _ in range(12):
        assert np.isfinite(warped.step()).all()
    mujoco_warp.set_const(warped.m, warped.d)
    assert np.isnan(warped.read()).all()
    paxisim.warp.apply_gel(warped.m, model, pads, Gel())
    assert np.isfinite(warped.read()).all()


def test_a_file_without_a_gel_has_nothing_to_undo():
    import mujoco_warp

    import paxisim.warp

    model, pads, data = held(gel=False)
    warped = Warped(model, pads, data, None, loads(2))
    mujoco_warp.set_const(warped.m, warped.d)
    paxisim.warp.check_gel(warped.m)
    assert np.isfinite(warped.step()).all()


@pytest.mark.parametrize(
    ("gel", "says"),
    [(GELS[:2], "expected one gel or 3, one for each world, got 2"), (Gel(relaxation=1e-3), "at least 2 time steps")],
)
def test_what_does_not_fit_is_said(gel, says):
    import paxisim.warp

    model, pads, data = held()
    warped = Warped(model, pads, data, None, loads(3))
    with pytest.raises(InvalidValueError, match=says):
        paxisim.warp.apply_gel(warped.m, model, pads, gel)
