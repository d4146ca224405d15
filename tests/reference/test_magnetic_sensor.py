"""A manufactured sensor as a member of a chain."""

import numpy as np
import pytest

import paxisim
from paxisim.cli import main
from paxisim.reference.pad import MagneticPad
from paxisim.reference.sensor import MagneticSensor

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))


def test_each_pad_of_a_sensor_differs_and_streams_are_as_frames():
    sensor = MagneticSensor(LAYOUT, unit=7)
    force = np.random.default_rng(0).uniform(0, 0.2, (4, 2, 3, 6, 5))
    read = sensor(force)
    np.testing.assert_allclose(read[:, 1], MagneticPad.unit(LAYOUT, 7001).read(force[:, 1]))
    same = np.repeat(force[:, :1], 2, axis=1)
    assert np.abs(sensor(same)[:, 0] - sensor(same)[:, 1]).max() > 0.01
    np.testing.assert_allclose(sensor.run(force, np.arange(4) / 50), read)
    assert sensor(force[:0]).shape == (0, 2, 3, 6, 5)


def test_a_long_batch_is_read_as_its_frames_and_single_precision_does():
    """Long numpy batches are computed in blocks."""
    sensor = MagneticSensor(LAYOUT, unit=7)
    force = np.random.default_rng(3).uniform(0, 0.5, (70, 2, 3, 6, 5))
    read = sensor(force)
    for index in (0, 30, 69):
        np.testing.assert_allclose(read[index], sensor(force[index]), atol=1e-12)
    single = sensor(force.astype(np.float32))
    assert single.dtype == np.float32
    assert np.abs(single - read).max() < 1e-4 * np.abs(read).max()


def test_it_stands_in_a_chain_with_the_firmware_behind_it_and_is_not_saved(tmp_path):
    chain = paxisim.Chain([MagneticSensor(LAYOUT, unit=3), paxisim.augment.Firmware()])
    force = np.random.default_rng(1).uniform(0, 0.2, (2, 3, 6, 5)).astype(np.float32)
    out, _ = chain.step(force, chain.initial_state(force), 0.02)
    assert out.dtype == np.float32
    assert np.all(np.abs(out / 0.1 - np.round(out / 0.1)) < 1e-4)
    with pytest.raises(paxisim.InvalidValueError, match="cannot be saved"):
        chain.save(tmp_path / "real.json")
    assert not list(tmp_path.iterdir())


def test_a_name_makes_the_sensor():
    sensor = paxisim.reference_sensor("unit:7")(LAYOUT)
    assert (sensor.unit, sensor.memory, sensor.covariate) == (7, None, "")
    whole = paxisim.reference_sensor("unit:12+neighbour+memory")(LAYOUT, zeroed_at=0.08)
    assert (whole.unit, whole.memory, whole.covariate) == (12, paxisim.GelMemory(), "gripper_opening")
    assert whole.zeroed_at == 0.08
    with pytest.raises(paxisim.InvalidValueError, match="unit must be"):
        MagneticSensor(LAYOUT, unit=-1)
    for wrong in ("7", "unit:", "unit:-1", "unit:7+", "unit:7+ears", "unit:²", "unit:7,memory"):
        with pytest.raises(paxisim.InvalidValueError, match="is named unit:N"):
            paxisim.reference_sensor(wrong)


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_the_emulator_is_a_unit(tmp_path, capsys):
    pytest.importorskip("serial")
    layout = paxisim.load_profile("gen2-box-120").wire_layout
    force = np.random.default_rng(2).uniform(0, 0.1, (1, *layout.shape))
    paxisim.Recording([0.0, 1.0], np.repeat(force[None], 2, axis=0), layout=layout).save(tmp_path / "press.npz")
    command = ["emulate", "--profile", "gen2-box-120", "--signal", str(tmp_path / "press.npz"), "--seconds", "0"]
    assert main([*command, "--reference", "unit:3"]) == 0
    assert main([*command, "--reference", "unit:3+memory"]) == 0
    assert main([*command, "--reference", "3"]) == 2
    assert "is named unit:N" in capsys.readouterr().err
    assert main([*command, "--reference", "unit:3+neighbour"]) == 2
    assert "leave out +neighbour" in capsys.readouterr().err
    assert main(["emulate", "--profile", "anyskin", "--seconds", "0", "--reference", "unit:3"]) == 2
    assert "a reference unit reads newtons" in capsys.readouterr().err
