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


def test_equal_streams_agree():
    found = compared(presses(), presses())
    assert not found.problems
    assert (found.peak_ratio, found.slope_ratio) == (1.0, 1.0)
    # half of a minimum-jerk rise is faster than about four fifths of its peak rate
    assert found.pads[0].measured_slope == pytest.approx(20 / 0.4 * 1.875, rel=0.25)


@pytest.mark.parametrize("noise", [0.02, 0.06])
def test_noise_on_long_holds_does_not_look_like_a_slow_rise(noise):
    found = compared(presses(noise=noise), presses())
    assert not found.problems
    assert found.slope_ratio == pytest.approx(1, abs=0.15)
    assert found.peak_ratio == pytest.approx(1, abs=0.08)


def test_a_gain_is_no_fault_of_the_replay_and_three_times_the_force_is():
    assert not compared(presses(0.7, noise=0.02), presses()).problems
    (said,) = compared(presses(), presses(3.0)).problems
    assert "the simulated peak is 3 times the measured one" in said


def test_contact_that_only_one_stream_has_is_said_with_its_times():
    nothing = np.zeros_like(presses())
    (said,) = compared(presses(), nothing).problems
    assert "20 N were measured (from 1." in said
    assert "nothing touches in the scene" in said
    (said,) = compared(nothing, presses()).problems
    assert "are simulated" in said
    assert compared(nothing, nothing).problems == ("there is no contact anywhere, neither measured nor simulated",)
    (said,) = compared(presses(begins=(1, 7)), presses(begins=(3.5,))).problems
    assert "too short" in said


def test_a_recording_without_both_streams_is_refused():
    recording = paxisim.Recording(TIME, presses().astype(np.float32), layout=LAYOUT)
    with pytest.raises(paxisim.InvalidValueError, match="the recording has no simulated stream"):
        paxisim.compare_streams(recording)
    both = replace(recording, simulated=recording.measured)
    assert "peak 1" in str(paxisim.compare_streams(both))
    unknown = paxisim.compare_streams(replace(both, simulated=np.full_like(recording.measured, np.nan)))
    assert np.isnan([unknown.pads[0].measured_peak, unknown.pads[0].simulated_peak]).all()
    assert "the streams are never known together" in str(unknown)
