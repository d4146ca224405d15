"""LinearCalibration of a sensor under one or several loads, with a delay between the streams."""

import dataclasses
import json
import os
import warnings
from pathlib import Path

import numpy as np
import pytest
from load_rig import NAMES, motion, rig

import paxisim
from paxisim.diagnose.data.prepare import prepare
from paxisim.diagnose.data.problem import problem_of
from paxisim.errors import InvalidValueError, UnknownNameError

EFLESH = Path(os.environ.get("PAXISIM_EFLESH") or Path(paxisim.__file__).parents[2] / "shared" / "data" / "eflesh")


def with_loads(recording, **loads):
    return dataclasses.replace(recording, covariates={**recording.covariates, **loads})


def under_one_load(**changes):
    """Return a recording of channels that follow Fz alone, the covariate `load`."""
    recording, _ = rig(move=lambda seed, time: motion(seed, time) * [0, 0, 1], **changes)
    return dataclasses.replace(recording, covariates={"load": recording.covariates["Fz"]})


@pytest.fixture(scope="module")
def fitted():
    """A recording under three loads that its channels follow by 30 ms, its readout and the true gains."""
    recording, true = rig()
    return recording, paxisim.calibrate_readout(recording, NAMES), true


# gains and delay


@pytest.mark.parametrize("seeds", [5, pytest.param(20, marks=pytest.mark.slow)])
def test_gains_and_any_delay_are_recovered_within_their_intervals(seeds):
    delays, gains = [], []
    for seed in range(seeds):
        delay = (-0.04, 0.0, 1.5 / 80, 0.03, 0.11)[seed % 5]
        recording, true = rig(seed, delay=delay)
        readout = paxisim.calibrate_readout(recording, NAMES)
        low, high = readout.delay_interval
        delays.append(low <= delay <= high)
        gains.append(np.abs(readout.gain - true) <= readout.gain_error)
        assert readout.delay == pytest.approx(delay, abs=5e-4)  # a fraction of a sample of 12.5 ms
        assert high - low < 2e-3
        np.testing.assert_allclose(readout.gain, true, atol=0.01 * np.abs(true).max())
        assert np.median(readout.gain_error) < 0.01 * np.abs(true).max()
    assert sum(delays) >= 0.9 * seeds
    assert np.mean(gains) >= 0.9  # nominally 0.95


def test_noise_of_the_load_cell_does_not_draw_the_delay_between_samples():
    errors = [paxisim.calibrate_readout(rig(seed, load_noise=0.3)[0], NAMES).delay - 0.03 for seed in range(4)]
    assert np.abs(errors).max() < 0.004


def test_clocks_far_apart_are_told():
    recording, _ = rig(delay=0.9, seconds=30)
    with pytest.warns(UserWarning, match=r"end of the search, \+0\.5 s: it may be larger"):
        readout = paxisim.calibrate_readout(recording, NAMES)
    assert readout.delay_interval[1] == np.inf
    assert "follow the loads by 500.0 ms or more, the end of the search" in str(readout)
    assert paxisim.calibrate_readout(recording, NAMES, max_delay=2).delay == pytest.approx(0.9, abs=1e-3)


def turning(seed, time):
    """Shear that rotates to the left at a varying speed, under a slowly varying press."""
    angle = 2 * np.pi * (0.8 * time + 0.5 * np.sin(0.9 * time + seed))
    size = 2 + np.sin(0.4 * time)
    return np.stack([size * np.cos(angle), size * np.sin(angle), 5 + np.sin(0.5 * time)], axis=1)


def rotation_of(readout, true):
    """Angle (rad) by which the fitted gains are rotated in the plane of the shear."""
    fitted, true = (values[:2].reshape(2, -1) for values in (readout.gain, true))
    mixing = fitted @ np.linalg.pinv(true)
    return np.arctan2(mixing[0, 1] - mixing[1, 0], mixing[0, 0] + mixing[1, 1])


def test_a_filter_between_the_streams_is_no_rotation():
    recording, true = rig(delay=0.0, move=turning)
    filtered = paxisim.augment.LowPass(0.06).run(recording.measured, recording.time)
    recording = dataclasses.replace(recording, measured=filtered)
    without = paxisim.calibrate_readout(recording, NAMES, max_delay=0)
    readout = paxisim.calibrate_readout(recording, NAMES)
    assert without.delay == 0
    assert abs(rotation_of(without, true)) > 0.25
    assert abs(rotation_of(readout, true)) < 0.03
    assert readout.delay == pytest.approx(0.06, abs=0.02)
    assert readout.error.mean() < 0.6 * without.error.mean()


def test_one_speed_cannot_tell_a_delay_from_a_rotation_and_the_interval_says_so(fitted):
    def circle(seed, time):
        angle = 2 * np.pi * time
        return np.stack([2 * np.cos(angle), 2 * np.sin(angle), 0 * time], axis=1)

    readout = paxisim.calibrate_readout(rig(move=circle)[0], ("Fx", "Fy"))
    assert np.diff(readout.delay_interval) > 0.02
    assert np.diff(fitted[1].delay_interval) < 0.001


def test_the_held_out_error_is_that_of_another_recording():
    recording, true = rig(noise=0.1)
    readout = paxisim.calibrate_readout(recording, NAMES)
    clean = np.tensordot(motion(0, recording.time - 0.03), true, 1)
    np.testing.assert_allclose(readout.error, 0.1 * clean.std(axis=0), rtol=0.1)
    np.testing.assert_allclose(readout.explained, 1 / 1.01, atol=0.002)


def test_regularisation_is_used_where_it_helps_on_held_out_data(fitted):
    assert fitted[1].ridge == 0
    rng = np.random.default_rng(3)

    def nearly_collinear(seed, time):
        base = motion(seed, time)[:, 2]
        return np.stack([base, base + 0.02 * np.sin(9 * time), 0.5 * base + 0.02 * np.cos(11 * time)], axis=1)

    recording, _ = rig(move=nearly_collinear, seconds=20, load_noise=0.0, noise=0.0)
    shared = recording.covariates["Fx"].reshape(-1, 1, 1, 1, 1) * np.ones((1, 1, 3, 1, 5))
    noisy = dataclasses.replace(recording, measured=shared + 3 * rng.normal(size=shared.shape))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        readout = paxisim.calibrate_readout(noisy, NAMES, max_delay=0)
    assert readout.ridge > 0
    assert np.abs(readout.gain.sum(axis=0) - 1).max() < 1  # without regularisation it reaches tens


# the calibrated recording


def test_the_calibrated_recording_is_aligned_and_in_newtons(fitted):
    recording, readout, _ = fitted
    ready = readout.apply(recording)
    assert len(ready) == len(recording)
    assert (ready.measured - ready.simulated).std() < 0.03 * ready.simulated.std()
    assert not set(NAMES) & set(ready.covariates)
    assert ready.metadata["unit"] == "N"
    assert len(np.unique(ready.episode)) > 10
    np.testing.assert_allclose(readout.to_channels(readout.to_force(recording.measured)), recording.measured, atol=1e-3)
    later = rig(seconds=90)[0]  # the same sensor, with the other half of the motion
    other = readout.apply(later[np.arange(len(later)) > 4800])
    assert (other.measured - other.simulated).std() < 0.03 * other.simulated.std()


def test_channels_of_one_load_read_that_load():
    recording = under_one_load(delay=0.0)
    readout = paxisim.calibrate_readout(recording, "load")
    ready = readout.apply(recording)
    np.testing.assert_array_equal(np.ptp(ready.simulated, axis=(1, 2, 3, 4)), 0)
    np.testing.assert_allclose(ready.simulated[:, 0, 0, 0, 0], recording.covariates["load"], rtol=1e-6)
    assert np.abs(ready.measured - ready.simulated).max() < 0.5
    for channel in ((0, 0, 0, 0), (0, 2, 0, 3)):
        line = np.polyfit(recording.covariates["load"], recording.measured[(slice(None), *channel)], 1)
        np.testing.assert_allclose(readout.gain[(0, *channel)], line[0], rtol=5e-3)
        np.testing.assert_allclose(readout.offset[channel], line[1], atol=0.03 * abs(line[0]))
        assert abs(readout.gain[(0, *channel)] - line[0]) < readout.gain_error[(0, *channel)]


def test_channels_that_follow_no_load_are_set_to_zero():
    recording, true = rig()
    recording.measured[:, 0, 1, 0, 2] = np.random.default_rng(0).normal(size=len(recording))
    recording.measured[:, 0, 2, 0, 4] = 7.0
    recording.measured[:, 0, 0, 0, 1] = np.nan
    recording.measured[100:200, 0, 2, 0, 2] = np.nan
    readout = paxisim.calibrate_readout(recording, NAMES)
    unused = [[0, 0, 0, 1], [0, 1, 0, 2], [0, 2, 0, 4]]
    assert np.argwhere(~readout.used).tolist() == unused
    np.testing.assert_allclose(readout.gain, true * readout.used, atol=0.01 * np.abs(true).max())
    assert "not related to any load, set to zero: 3 of 15 channels" in str(readout)
    ready = readout.apply(recording)
    assert ready.metadata["readout"]["unused"] == [["pad0", "x", 0, 1], ["pad0", "y", 0, 2], ["pad0", "z", 0, 4]]
    for channel in unused:
        for tensor in (ready.measured, ready.simulated):
            assert not np.nan_to_num(tensor[(slice(None), *channel)]).any()


def test_a_channel_that_is_not_used_takes_no_part_in_a_diagnosis():
    recording = under_one_load()
    recording.measured[:, 0, 1, 0, 2] = np.random.default_rng(0).normal(size=len(recording))
    ready = paxisim.calibrate_readout(recording, "load").apply(recording)
    problem = problem_of(prepare(ready)[0])
    assert problem.alive.sum() == 14
    assert problem.one_load  # the channels are not forces, so causes that mix them are not considered


def test_samples_without_a_load_are_left_out():
    recording = under_one_load()
    load = recording.covariates["load"].copy()
    load[:7] = np.nan
    holed = with_loads(recording, load=load)
    readout = paxisim.calibrate_readout(holed, "load")
    assert np.isfinite(readout.gain).all()
    assert len(readout.apply(holed)) == len(recording) - 7


# loads


def test_a_load_that_does_not_change_is_named_and_left_out(fitted):
    recording, _, true = fitted
    steady = with_loads(recording, Tz=np.random.default_rng(0).normal(0.1, 0.001, len(recording)))
    with pytest.warns(UserWarning, match=r"does not excite Tz: it varies by 0\.001 N m only"):
        readout = paxisim.calibrate_readout(steady, (*NAMES, "Tz"))
    assert readout.excitation.excited.tolist() == [True, True, True, False]
    assert not readout.gain[3].any()
    assert np.isinf(readout.gain_error[3]).all()
    np.testing.assert_allclose(readout.gain[:3], true, atol=0.01 * np.abs(true).max())
    assert "not excited" in str(readout)


def test_a_load_that_changes_only_with_others_is_named(fitted):
    recording, _, _ = fitted
    tied = with_loads(recording, Tx=-0.02 * recording.covariates["Fy"])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        readout = paxisim.calibrate_readout(tied, (*NAMES, "Tx"))
    words = [str(one.message) for one in said]
    assert any("does not excite Tx apart from the other loads: they explain 100.0% of its variance" in w for w in words)
    assert not any("does not excite Fz" in w for w in words)
    assert readout.excitation.excited.all()
    assert not readout.excitation.separable[3]
    ready = readout.apply(tied)
    assert (ready.measured - ready.simulated).std() < 0.03 * ready.simulated.std()


def test_a_wrench_of_six_values_is_a_covariate_like_any_other(fitted):
    recording, _, true = fitted
    forces = np.stack([recording.covariates[name] for name in NAMES], axis=1)
    torques = 0.01 * np.stack([np.sin(t * recording.time) for t in (1.1, 1.7, 2.3)], axis=1)
    wrench = dataclasses.replace(recording, covariates={"ft": np.concatenate([forces, torques], axis=1)})
    readout = paxisim.calibrate_readout(wrench, "ft")
    assert [load.name for load in readout.loads] == ["Fx", "Fy", "Fz", "Tx", "Ty", "Tz"]
    np.testing.assert_allclose(readout.gain[:3], true, atol=0.01 * np.abs(true).max())
    assert "ft" not in readout.apply(wrench).covariates
    assert max(map(len, str(readout).splitlines())) <= 100
    json.dumps(dict(readout.apply(wrench).metadata))


def test_what_cannot_be_calibrated_is_named(fitted):
    recording, _ = rig(seconds=10)
    count = len(recording)
    loads = {
        "one": np.ones(count),
        "unknown": np.full(count, np.nan),
        "four": np.ones((count, 4)),
        "noise": np.random.default_rng(0).normal(size=count),
    }
    recording = with_loads(recording, **loads)
    for asked, options, words in [
        ("loads", {}, "unknown covariate 'loads'"),
        ({"fz": "Fz"}, {}, "unknown load component 'fz'; did you mean 'Fz'"),
        ("one", {}, f"needs a varying load: 'one' is known at {count} samples and constant"),
        ("unknown", {}, "needs a varying load: 'unknown' is known at 0 samples"),
        ("four", {}, rf"a single value per sample, or 3 or 6 .* has shape \({count}, 4\)"),
        ("noise", {}, "no channel correlates with 'noise'"),
        (("Fx", "Fx"), {}, r"one to 6 different loads, got \['Fx', 'Fx'\]"),
        ((), {}, r"one to 6 different loads, got \[\]"),
        ("Fz", {"degree": 4}, "degree must be 1, 2 or 3, got 4"),
        ("Fz", {"max_delay": -1}, "max_delay must be a time"),
    ]:
        with pytest.raises((InvalidValueError, UnknownNameError), match=words):
            paxisim.calibrate_readout(recording, asked, **options)
    simulated = dataclasses.replace(recording, measured=None, simulated=recording.measured)
    with pytest.raises(InvalidValueError, match="measured tensor, but the recording has none"):
        paxisim.calibrate_readout(simulated, "Fz")
    measured = recording.measured.copy()
    measured[5:, 0, 2, 0, 2] = np.nan
    with pytest.raises(InvalidValueError, match="known together at 5 samples"):
        paxisim.calibrate_readout(dataclasses.replace(recording, measured=measured), NAMES)
    with pytest.raises(UnknownNameError, match="unknown covariate 'Fy'"):
        fitted[1].apply(dataclasses.replace(recording, covariates={"Fx": recording.covariates["Fx"]}))
    with pytest.raises(InvalidValueError, match="the recording has"):
        fitted[1].apply(dataclasses.replace(recording, measured=np.zeros((count, 1, 3, 1, 6)), layout=None))


# a real sensor, if the data is available


def error_of(measured, predicted):
    """Root-mean-square error, relative to the size of the signal."""
    return np.sqrt(np.sum((measured - predicted) ** 2) / np.sum(np.square(measured, dtype=float)))


@pytest.mark.skipif(not (EFLESH / "press_1.sensor.csv").exists(), reason="needs the eFlesh recordings")
def test_a_readout_of_one_eflesh_recording_predicts_the_other():
    presses = [paxisim.Recording.load(EFLESH / f"press_{number}.sensor.csv", missing="drop") for number in (1, 2)]
    readouts = [paxisim.calibrate_readout(press, "load", degree=3) for press in presses]
    for readout, press, judged in zip(readouts, presses, reversed(presses), strict=True):
        error = error_of(judged.measured, readout.to_channels(readout.apply(judged).simulated))
        channels = press.measured.reshape(len(press), -1).astype(float)
        curves = [np.polyfit(press.covariates["load"], channel, 3) for channel in channels.T]
        cubic = np.stack([np.polyval(c, judged.covariates["load"]) for c in curves], axis=1)
        assert error <= error_of(judged.measured, cubic.reshape(judged.measured.shape))
        straight = paxisim.calibrate_readout(press, "load")
        assert error < 0.85 * error_of(judged.measured, straight.to_channels(straight.apply(judged).simulated))
    intervals = [readout.delay_interval for readout in readouts]
    assert all(low < high < 0 for low, high in intervals), "the load comes later than the channels"
    assert max(low for low, _ in intervals) < min(high for _, high in intervals), "the two recordings agree"
    assert len(np.unique(readouts[0].apply(presses[0]).episode)) == 10, "it is cut into its presses"
