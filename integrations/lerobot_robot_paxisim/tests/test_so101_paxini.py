"""Another project's plugin, lerobot_robot_so101_paxini, records an emulated PaXini board as it would a real one."""

import numpy as np
import pytest

from paxisim import Emulator, Recording, load_profile, open_sensor


def test_it_records_what_paxisim_records(tmp_path, record, arms):
    theirs = pytest.importorskip("lerobot_robot_so101_paxini")
    path = tmp_path / "tips.toml"
    path.write_text('like = "gen3-highspeed"\nslots = [{ name = "a", index = 10 }, { name = "b", index = 18 }]\n')
    profile = load_profile(path)
    counts = np.random.default_rng(0).integers(3, 100, (2, *profile.wire_layout.shape))
    with Emulator(profile, lambda now: counts * profile.resolution) as board:
        with open_sensor(board.port, profile) as sensor:
            force = sensor.read().force
        tips = theirs.PaxiniSensorConfig(port=board.port, module_indices=[10, 18], auto_calibrate=False)
        robot = theirs.SO101PaxiniConfig(port=arms[0], id="tests", sensors={"tips": tips})
        found = Recording.load(record(robot), layout=profile.layout)
    assert found.pads == ("tips.f0", "tips.f1")
    # until its stream has started, it records zeros
    started = found.measured.any(axis=(1, 2, 3, 4))
    assert np.count_nonzero(started) >= 10
    np.testing.assert_array_equal(found.measured[started], np.broadcast_to(force, (started.sum(), *force.shape)))
