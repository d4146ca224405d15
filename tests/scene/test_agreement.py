"""Agreement of a replay with the measurement, reported before anything is concluded about the sensor."""

from dataclasses import replace

import numpy as np
import pytest
from scene.rigs import LAYOUT, path

import paxisim

TIME = np.arange(0, 12, 0.01)


def presses(scale=1.0, noise=0.0, begins=(1, 7), seed=0):
    """Return presses of 20 N with a rise of 0.4 s and a hold of 3 s, ``(T, 1, 3, rows, cols)``."""
    total = sum(20 * path(TIME, [0, b, b + 0.4, b + 3.4, b + 3.8, 12], [0, 0, 1, 1, 0, 0]) for b in begins)
    shape = (len(TIME), 1, *LAYOUT.shape)
    force = np.zeros(shape)
    force[:, 0, 2] = scale * total[:, None, None] / LAYOUT.taxels
    return force + noise * np.random.default_rng(seed).normal(size=shape)


def compared(measured, simulated):
    return paxisim.compare_streams(
        paxisim.Recording(TIME, measured.astype(np.float32), simulated.astype(np.float32), layout=LAYOUT)
    )


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.06])
def test_equal_streams_agree_and_an_overshoot_changes_the_peak_alone(noise):
    found = compared(presses(noise=noise), presses())
    assert not found.problems
    assert found.force_ratio == pytest.approx(1, abs=0.01 if noise else 0)
    assert found.peak_ratio == pytest.approx(1, abs=0.08 if noise else 0)
    over = presses(0.8)
    over[140:145] *= 1.5
    found = compared(presses(noise=noise), over)
    assert found.force_ratio == pytest.approx(0.8, abs=0.01)
    assert found.peak_ratio == pytest.approx(1.2, abs=0.08)


def test_a_gain_is_no_fault_of_the_replay_but_three_times_the_force_and_contact_of_one_alone_are():
    assert not compared(presses(0.7, noise=0.02), presses()).problems
    nothing = np.zeros_like(presses())
    for measured, simulated, words in (
        (presses(), presses(3.0), ("the simulated force is typically 3 times the measured one",)),
        (presses(), nothing, ("20 N were measured (from 1.", "nothing touches in the scene")),
        (nothing, presses(), ("are simulated",)),
        (nothing, nothing, ("there is no contact anywhere, neither measured nor simulated",)),
        (presses(), presses(begins=(3.5,)), ("too short",)),
    ):
        (said,) = compared(measured, simulated).problems
        assert all(word in said for word in words), said


def test_a_recording_without_both_streams_is_refused():
    recording = paxisim.Recording(TIME, presses().astype(np.float32), layout=LAYOUT)
    with pytest.raises(paxisim.InvalidValueError, match="the recording has no simulated stream"):
        paxisim.compare_streams(recording)
    both = replace(recording, simulated=recording.measured)
    assert "force 1.000, peak 1.000" in str(paxisim.compare_streams(both))
    unknown = paxisim.compare_streams(replace(both, simulated=np.full_like(recording.measured, np.nan)))
    assert np.isnan([unknown.pads[0].measured_peak, unknown.pads[0].simulated_peak]).all()
    assert "the streams are never known together" in str(unknown)
