"""The uneven surface of a unit: its size, its waves, and what it does to the forces and not to the readings."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import paxisim
from paxisim.cli.emulate import _as_unit
from paxisim.cli.scene_signal import SceneSignal
from paxisim.scene import ready

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))


def test_units_are_uneven_by_a_tenth_to_three_tenths_of_a_millimetre_in_waves_and_bumps():
    heights = np.array([paxisim.MagneticPad.unit(LAYOUT, seed).heights for seed in range(60)])
    np.testing.assert_allclose(heights.mean(axis=(1, 2)), 1e-3)
    ranges = np.ptp(heights, axis=(1, 2))
    assert 0.1e-3 - 1e-9 < ranges.min() < 0.13e-3
    assert 0.27e-3 < ranges.max() < 0.3e-3 + 1e-9
    apart = heights - 1e-3
    for axis in (1, 2):  # neighbours are alike, as on a moulded gel, and taxels far apart are not
        near, far = (np.take(apart, range(at, apart.shape[axis]), axis) for at in (1, 4))
        first, other = (np.take(apart, range(apart.shape[axis] - at), axis) for at in (1, 4))
        assert np.sum(near * first) > 0.6 * np.sum(first**2)
        assert np.sum(far * other) < 0.2 * np.sum(other**2)
    assert abs(np.corrcoef(apart[:-1].ravel(), apart[1:].ravel())[0, 1]) < 0.1, "units differ"


def test_the_design_scales_the_surface_and_nothing_else_and_is_flat_itself():
    rough = paxisim.MagneticPad.unit(LAYOUT, 3, paxisim.PadParameters(unevenness=0.4e-3))
    usual = paxisim.MagneticPad.unit(LAYOUT, 3)
    np.testing.assert_allclose(rough.heights - 1e-3, 2 * (usual.heights - 1e-3), atol=1e-12)
    force = np.random.default_rng(0).uniform(0, 0.3, (3, 6, 5))
    np.testing.assert_array_equal(rough.read(force), usual.read(force))
    assert np.all(paxisim.MagneticPad(LAYOUT).heights == 1e-3)
    sensor = paxisim.MagneticSensor(LAYOUT, unit=4)
    np.testing.assert_array_equal(sensor.heights(2)[1], sensor.pads(2)[1].heights)
    for unevenness in (-1e-6, 1e-3, float("nan")):
        with pytest.raises(paxisim.InvalidValueError, match="unevenness must be from 0"):
            paxisim.PadParameters(unevenness=unevenness)


def test_a_ball_presses_harder_where_the_surface_is_higher():
    heights = paxisim.MagneticPad.unit(LAYOUT, 7).heights
    forces = []
    for surface in (None, heights):
        model = mujoco.MjModel.from_xml_string(str(ready.indenter(LAYOUT, surface).mjcf))
        data = mujoco.MjData(model)
        readout = paxisim.TactileReadout(model, paxisim.find_pads(model))
        total = []
        for x, y in LAYOUT.positions[:, :2]:
            for _ in range(30):
                data.joint("x").qpos, data.joint("y").qpos, data.joint("depth").qpos = x, y, 5e-4
                data.qvel[:] = 0
                mujoco.mj_step(model, data)
            total.append(readout.read(data)[0, 2].sum())
        forces.append(total)
    harder = np.subtract(forces[1], forces[0])
    assert np.corrcoef(harder, heights.ravel())[0, 1] > 0.9


def test_an_emulated_scene_has_the_surface_of_its_unit(tmp_path):
    """The scene has the pooled pads of a board of 12x10 taxels."""
    profile = replace(paxisim.load_profile("gen2-box-120"), pool=(2, 2))
    scene, pooled = tmp_path / "scene.xml", profile.layout
    assert (pooled.rows, pooled.cols) == (6, 5)
    world = "<mujoco><worldbody><body name='b'/></worldbody></mujoco>"
    scene.write_text(paxisim.attach(world, paxisim.Pad(pooled), [paxisim.Mount("b")]).to_xml())
    signal = SceneSignal(scene, profile)
    size = signal._model.geom_size[signal._pads.geoms[0], 2]
    np.testing.assert_allclose(2 * size, 1e-3)
    _as_unit(signal, "unit:7", profile)
    fine = paxisim.reference_sensor("unit:7")(profile.wire_layout).heights(1)[0]
    coarse = fine.reshape(pooled.rows, 2, pooled.cols, 2).mean(axis=(1, 3))
    size = signal._model.geom_size[signal._pads.geoms[0], 2]
    np.testing.assert_allclose(2 * size, coarse.ravel(), atol=1e-9)
