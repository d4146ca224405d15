"""LinearCalibration of sensors whose channels are not in newtons."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent / "diagnose"))

from field_sensor import press

import paxisim
from paxisim.diagnose.prepare import prepare
from paxisim.diagnose.problem import problem_of
from paxisim.errors import InvalidValueError, UnknownNameError


def test_a_straight_sensor_is_read_as_the_load():
    recording = press(bend=0.0, noise=0.5)
    readout = paxisim.calibrate_readout(recording, "load")
    ready = readout.apply(recording)
    assert readout.used.all()
    assert np.abs(ready.measured - ready.simulated).max() < 0.5
    np.testing.assert_array_equal(np.ptp(ready.simulated, axis=(1, 2, 3, 4)), 0)
    np.testing.assert_allclose(ready.simulated[:, 0, 0, 0, 0], recording.covariates["load"], rtol=1e-6)
    back = readout.to_channels(readout.to_force(recording.measured))
    np.testing.assert_allclose(back, recording.measured, atol=1e-2)
    assert "load" not in ready.covariates
    assert ready.metadata["unit"] == "N"


def test_the_line_is_that_of_least_squares_and_serves_for_another_recording():
    recording, other = press(), press(seed=1, cycles=3)
    readout = paxisim.calibrate_readout(recording, "load")
    for channel in ((0, 0, 0, 0), (0, 2, 0, 3)):
        line = np.polyfit(recording.covariates["load"], recording.measured[(slice(None), *channel)], 1)
        gain, offset = readout.gain[(0, *channel)], readout.offset[channel]
        np.testing.assert_allclose(gain, line[0], rtol=5e-3)
        np.testing.assert_allclose(offset, line[1], atol=5e-3 * abs(line[0]) * 30)
        assert abs(gain - line[0]) < readout.gain_error[(0, *channel)]
    assert len(readout.apply(other)) == len(other)


def test_samples_without_a_load_are_left_out():
    recording = press()
    load = recording.covariates["load"].copy()
    load[:7] = np.nan
    holed = dataclasses.replace(recording, covariates={"load": load})
    readout = paxisim.calibrate_readout(holed, "load")
    assert np.isfinite(readout.gain).all()
    assert len(readout.apply(holed)) == len(recording) - 7


def test_a_channel_that_does_not_answer_is_not_used():
    recording = press()
    recording.measured[:, 0, 1, 0, 2] = np.random.default_rng(0).normal(size=len(recording))
    readout = paxisim.calibrate_readout(recording, "load")
    assert not readout.used[0, 1, 0, 2]
    assert readout.used.sum() == 14
    ready = readout.apply(recording)
    assert not ready.measured[:, 0, 1, 0, 2].any()
    assert not ready.simulated[:, 0, 1, 0, 2].any()


def test_bad_input():
    recording = press()
    with pytest.raises(UnknownNameError, match="did you mean 'load'"):
        paxisim.calibrate_readout(recording, "loads")
    constant = dataclasses.replace(recording, covariates={"load": np.ones(len(recording))})
    with pytest.raises(InvalidValueError, match="needs a varying load"):
        paxisim.calibrate_readout(constant, "load")
    unknown = dataclasses.replace(recording, covariates={"load": np.full(len(recording), np.nan)})
    with pytest.raises(InvalidValueError, match="is known at 0 samples"):
        paxisim.calibrate_readout(unknown, "load")
    several = dataclasses.replace(recording, covariates={"load": np.ones((len(recording), 4))})
    with pytest.raises(InvalidValueError, match=r"a single value per sample, or 3 or 6 .* has shape \(1230, 4\)"):
        paxisim.calibrate_readout(several, "load")
    noise = dataclasses.replace(recording, covariates={"load": np.random.default_rng(0).normal(size=len(recording))})
    with pytest.raises(InvalidValueError, match="no channel correlates with 'load'"):
        paxisim.calibrate_readout(noise, "load")
    simulated = dataclasses.replace(recording, measured=None, simulated=recording.measured)
    with pytest.raises(InvalidValueError, match="measured tensor, but the recording has none"):
        paxisim.calibrate_readout(simulated, "load")
    readout = paxisim.calibrate_readout(recording, "load")
    wider = dataclasses.replace(recording, measured=np.zeros((len(recording), 1, 3, 1, 6)), layout=None)
    with pytest.raises(InvalidValueError, match="the recording has"):
        readout.apply(wider)


def test_a_channel_that_is_not_used_takes_no_part_in_a_diagnosis():
    recording = press()
    recording.measured[:, 0, 1, 0, 2] = np.random.default_rng(0).normal(size=len(recording))
    ready = paxisim.calibrate_readout(recording, "load").apply(recording)
    problem = problem_of(prepare(ready)[0])
    assert problem.alive.sum() == 14
    assert problem.one_load  # the channels are not forces, so causes that mix them are not considered
