"""Gels of each world's own on MuJoCo Warp, and the error where set_const has undone one."""

import copy

import mujoco
import numpy as np
import pytest
from held import Warped, bumps, held, needs_warp, warped

import paxisim
from paxisim.errors import InvalidValueError, UnsupportedError
from paxisim.models.gel import Gel
from paxisim.models.pads import set_surface
from paxisim.models.readout import TactileReadout

pytestmark = needs_warp
GELS = (Gel(), Gel(modulus=60e3, relaxation=0.02), Gel(modulus=200e3, thickness=2e-3, friction=0.6))


def set_const(worlds):
    import mujoco_warp

    mujoco_warp.set_const(worlds.m, worlds.d)


@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
def test_each_world_has_its_gel(cone):
    model, pads, data = held(cone=cone)
    surface = bumps(1, pads)[0]  # a softer gel spreads the load further around a bump
    worlds = Warped(model, pads, data, [surface] * 3, [5.0] * 3)
    worlds.apply(GELS)
    expected = []
    for gel in GELS:
        own, state = copy.copy(model), copy.copy(data)
        gel.apply(own, pads)
        set_surface(own, pads, surface)
        state.ctrl[0] = 5.0
        mujoco.mj_step(own, state, 50)
        expected.append(TactileReadout(own, pads).read(state))
    for _ in range(50):
        reading = worlds.step()
    np.testing.assert_allclose(reading, expected, atol=1e-4)
    assert np.abs(expected[0] - expected[1]).max() > 0.01


def test_taxels_outrank_an_object_with_a_priority():
    scene = model, pads, _ = held()
    model.geom_priority[model.geom("object").id] = 3
    worlds = warped(scene, flat=True)
    worlds.apply(Gel())
    assert set(worlds.m.geom_priority.numpy()[pads.geoms].flat) == {4}


def test_a_mask_keeps_the_other_gels_and_what_does_not_fit_is_said():
    scene = held()
    worlds = warped(scene, 3, flat=True)
    before = worlds.m.body_invweight0.numpy().copy()
    worlds.apply(Gel(modulus=50e3), np.array([False, True, False]))
    after = worlds.m.body_invweight0.numpy()
    np.testing.assert_array_equal(after[[0, 2]], before[[0, 2]])
    bodies = scene[1].bodies
    np.testing.assert_allclose(after[1, bodies, 0], 2 * before[1, bodies, 0], rtol=1e-6)
    assert np.isfinite(worlds.step()).all()
    with pytest.raises(InvalidValueError, match="expected one gel or 3, one for each world, got 2"):
        worlds.apply(GELS[:2])
    with pytest.raises(InvalidValueError, match="at least 2 time steps"):
        worlds.apply(Gel(relaxation=1e-3))


def test_a_gel_that_set_const_undoes_is_an_error():
    worlds = warped(held())
    good = worlds.step()
    set_const(worlds)
    with pytest.raises(UnsupportedError, match=r"gel is undone in 2 of 2 worlds.*call paxisim.warp.apply_gel after it"):
        worlds.step()
    with pytest.raises(UnsupportedError, match="gel is undone"):
        paxisim.warp.check_gel(worlds.m)
    worlds.apply(Gel())
    paxisim.warp.check_gel(worlds.m)
    assert np.abs(worlds.step() - good).max() < 1


def test_later_reads_are_nan_while_the_gel_is_undone():
    """Reads after the first do not wait for the device, so they cannot raise."""
    worlds = warped(held())
    for _ in range(12):
        assert np.isfinite(worlds.step()).all()
    set_const(worlds)
    assert np.isnan(worlds.read()).all()
    worlds.apply(Gel())
    assert np.isfinite(worlds.read()).all()


def test_a_file_without_a_gel_has_nothing_to_undo():
    worlds = warped(held(gel=False), flat=True)
    set_const(worlds)
    paxisim.warp.check_gel(worlds.m)
    assert np.isfinite(worlds.step()).all()
