"""Signals: the forces on the emulated pads, from samples or synthetic."""

import numpy as np
import pytest
from emulated import profile

from paxisim.errors import InvalidValueError
from paxisim.hw.emulation.emulator import Emulator
from paxisim.hw.emulation.signals import from_arrays, from_recording, press, spread
from paxisim.recording import Recording


def test_played_samples_are_held_or_joined_and_begin_anew():
    chosen = profile()
    force = np.zeros((3, 1, 3, 3, 3), dtype=np.float32)
    force[:] = np.arange(3)[:, None, None, None, None]
    time_of = [5.0, 6.0, 7.0]
    held, joined = (from_arrays(time_of, force, chosen, interpolate=way) for way in (False, True))
    moments = [0.0, 0.5, 1.0, 2.9, 3.0, 4.25]
    assert [held(now).flat[0] for now in moments] == [0, 0, 1, 2, 0, 1]
    assert [joined(now).flat[0] for now in moments] == [0, 0.5, 1, 2, 0, 1.25]
    once = from_arrays(time_of, force, chosen, loop=False)
    assert once(99.0).flat[0] == 2
    # time may restart at the end of an episode
    episodes = from_arrays([5.0, 5.1, 0.0], force, chosen)
    assert [episodes(now).flat[0] for now in (0.05, 0.15, 0.25, 0.35)] == [0, 1, 2, 0]
    alone = from_arrays([5.0], force[:1] + 1, chosen)
    assert alone(17.0).flat[0] == 1


def test_pooled_forces_are_spread_evenly():
    chosen = profile("gen1-pap-l4629", pool=(2, 2))
    pooled = np.random.default_rng(0).random((5, 1, 3, 6, 5))
    wide = spread(pooled, chosen)
    assert wide.shape == (5, 1, 3, 12, 10)
    assert chosen.wire_layout.pool_force(wide, 2, 2) == pytest.approx(pooled)
    assert spread(wide, chosen) is wide
    with pytest.raises(InvalidValueError, match=r"\(1, 3, 12, 10\) or \(1, 3, 6, 5\).*\(2, 3, 6, 5\)"):
        spread(np.zeros((2, 3, 6, 5)), chosen)
    with pytest.raises(InvalidValueError, match="at least 1"):
        from_arrays([], np.zeros((0, 1, 3, 12, 10)), chosen)


@pytest.mark.parametrize("name", ["gen3-highspeed-mc-m2020", "gen1-pap-l4629", "gen1-stream"])
def test_the_demonstration_presses_and_drags(name):
    chosen = profile(name)
    signal = press(chosen, force=10.0, period=4.0)
    force = np.stack([signal(now) for now in np.linspace(0, 8, 81)])
    total = force.sum(axis=(-2, -1))
    assert force.shape[1:] == (len(chosen.slots), *chosen.wire_layout.shape)
    assert total[:, :, 2].max(axis=0) == pytest.approx(10.0, rel=0.02)
    assert (total[:, :, :2] >= 0).all()
    assert (total[:, :, :2].max(axis=0) > 1).all()
    assert total[0, 0] == pytest.approx(0)


def test_a_recording_plays_what_was_measured_unless_told_otherwise():
    chosen = profile()
    ones = np.ones((1, 1, 3, 3, 3), dtype=np.float32)
    both = Recording(time=[0.0], measured=ones, simulated=2 * ones, layout=chosen.layout)
    assert from_recording(both, chosen)(0.0).flat[0] == 1
    assert from_recording(both, chosen, which="simulated")(0.0).flat[0] == 2
    alone = Recording(time=[0.0], simulated=2 * ones, layout=chosen.layout)
    assert from_recording(alone, chosen.name)(0.0).flat[0] == 2
    with pytest.raises(InvalidValueError, match="no measured tensor"):
        from_recording(alone, chosen, which="measured")


def test_a_profile_file_is_a_path_or_text(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('like = "gen3-highspeed-mc-m2020"\n')
    for name in (path, str(path)):
        emulator = Emulator(name, press(name))
        force = np.zeros((1, 1, 3, 3, 3))
        assert emulator.profile.name == "mine"
        assert from_arrays([0.0], force, name)(0.0).shape == force.shape[1:]
