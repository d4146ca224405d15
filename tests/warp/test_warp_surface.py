"""Surfaces of each world's own on MuJoCo Warp: they equal those of MuJoCo's own engine, and a mask keeps the others."""

import numpy as np
import pytest
from held import Engine, Warped, bumps, held, loads, needs_warp, warped

from paxisim.errors import InvalidValueError

pytestmark = needs_warp
FIELDS = ("geom_pos", "geom_size", "geom_aabb", "geom_rbound")


@pytest.mark.parametrize("taxels", ["boxes", "spheres"])
def test_the_fields_are_those_of_the_other_engine(taxels):
    model, pads, data = held(taxels=taxels)
    worlds, engine = (kind(model, pads, data, bumps(3, pads), loads(3)) for kind in (Warped, Engine))
    for name in FIELDS:
        found = getattr(worlds.m, name).numpy().reshape(3, -1)
        expected = np.stack([getattr(own, name).reshape(-1) for own, _, _ in engine.worlds])
        np.testing.assert_allclose(found, expected, atol=1e-8, err_msg=name)


@pytest.mark.parametrize("fixed", [True, False], ids=["fixed", "moving"])
def test_a_raised_taxel_of_a_pad_fixed_to_the_world_is_felt(fixed):
    """MuJoCo Warp computes the poses of geoms that are fixed to the world only once."""
    model, pads, data = held(fixed=fixed)
    heights = np.full((2, 2, 4, 3), pads.thickness[0])
    heights[1, 0, 2, 1] += 0.3e-3
    worlds, engine = (kind(model, pads, data, heights, [3.0, 3.0]) for kind in (Warped, Engine))
    for _ in range(3):
        reading, expected = worlds.step(), engine.step()
    np.testing.assert_allclose(reading, expected, atol=1e-4)
    assert reading[1, 0, 2, 2, 1] > 1.5 * reading[0, 0, 2, 2, 1]


def test_a_mask_changes_only_its_worlds():
    import torch

    model, pads, data = held()
    before, after = bumps(4, pads), bumps(4, pads, seed=5)
    mask = np.array([False, True, False, True])
    worlds = Warped(model, pads, data, before, loads(4))
    worlds.surface(torch.tensor(after), torch.tensor(mask))
    expected = Warped(model, pads, data, np.where(mask[:, None, None, None], after, before), loads(4))
    for name in FIELDS:
        values = (getattr(each.m, name).numpy() for each in (worlds, expected))
        np.testing.assert_allclose(*values, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(worlds.step(), expected.step(), atol=1e-4)


def test_many_changes_do_not_add_up_and_one_surface_does_for_all():
    scene = held()
    pads, worlds = scene[1], warped(scene)
    first = worlds.m.geom_pos.numpy().copy()
    for seed in range(20):
        worlds.surface(bumps(2, pads, seed=seed))
    worlds.surface(bumps(2, pads))
    np.testing.assert_array_equal(worlds.m.geom_pos.numpy(), first)
    worlds.surface(np.full((4, 3), 1.2e-3))
    np.testing.assert_allclose(worlds.m.geom_size.numpy()[:, pads.geoms, 2], 0.6e-3, rtol=1e-6)


def test_what_does_not_fit_is_said():
    worlds = warped(held(), flat=True)
    flat = np.full((4, 3), 1e-3)
    for heights, mask, says in (
        (flat.T, None, r"heights must have shape \(\.\.\., 4, 3\), got \(3, 4\)"),
        (np.full((5, 2, 4, 3), 1e-3), None, r"heights must have shape \(2, 2, 4, 3\)"),
        (0 * flat, None, "positive and finite"),
        (flat, np.ones(3, bool), r"mask must be boolean of shape \(2,\)"),
        (flat, np.ones(2), "mask must be boolean"),
    ):
        with pytest.raises(InvalidValueError, match=says):
            worlds.surface(heights, mask)
