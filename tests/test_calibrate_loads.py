"""LinearCalibration of a sensor under several loads, with a delay between the streams."""

import dataclasses
import json
import warnings

import numpy as np
import pytest
from load_rig import NAMES, motion, rig

import paxisim
from paxisim.errors import InvalidValueError, UnknownNameError


def with_loads(recording, **loads):
    return dataclasses.replace(recording, covariates={**recording.covariates, **loads})


def test_gains_and_delay_are_recovered_within_their_intervals():
    delays, gains = [], []
    for seed in range(10):
        recording, true = rig(seed, delay=0.03)
        readout = paxisim.calibrate_readout(recording, NAMES)
        low, high = readout.delay_interval
        delays.append(low <= 0.03 <= high)
        gains.append(np.abs(readout.gain - true) <= readout.gain_error)
        assert readout.delay == pytest.approx(0.03, abs=0.001)  # 2.4 samples
        np.testing.assert_allclose(readout.gain, true, atol=0.01 * np.abs(true).max())
    assert sum(delays) >= 9
    assert np.mean(gains) >= 0.9  # nominally 0.95
    assert np.median(readout.gain_error) < 0.01 * np.abs(true).max()


@pytest.mark.parametrize("delay", [-0.04, 0.0, 1.5 / 80, 0.11])
def test_any_delay_is_found_to_a_fraction_of_a_sample(delay):
    readout = paxisim.calibrate_readout(rig(1, delay=delay)[0], NAMES)
    assert readout.delay == pytest.approx(delay, abs=5e-4)
    assert np.diff(readout.delay_interval) < 2e-3


def test_noise_of_the_load_cell_does_not_draw_the_delay_between_samples():
    errors = [paxisim.calibrate_readout(rig(s, load_noise=0.3)[0], NAMES).delay - 0.03 for s in range(4)]
    assert np.abs(errors).max() < 0.004


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


def test_one_speed_cannot_tell_a_delay_from_a_rotation_and_the_intervals_say_so():
    def circle(seed, time):
        angle = 2 * np.pi * time
        return np.stack([2 * np.cos(angle), 2 * np.sin(angle), 0 * time], axis=1)

    recording, _ = rig(move=circle, delay=0.03)
    readout = paxisim.calibrate_readout(recording, ("Fx", "Fy"))
    assert np.diff(readout.delay_interval) > 0.02
    assert np.diff(paxisim.calibrate_readout(rig()[0], NAMES).delay_interval) < 0.001


def test_the_calibrated_recording_is_aligned_and_in_newtons():
    recording, _ = rig(delay=0.1)
    readout = paxisim.calibrate_readout(recording, NAMES)
    ready = readout.apply(recording)
    away = ready.measured - ready.simulated
    assert away.std() < 0.03 * ready.simulated.std()
    later = rig(delay=0.1, seconds=90)[0]  # the same sensor, with the other half of the motion
    other = readout.apply(later[np.arange(len(later)) > 4800])
    assert (other.measured - other.simulated).std() < 0.03 * other.simulated.std()
    assert len(ready) == len(recording)
    assert not set(NAMES) & set(ready.covariates)
    assert ready.metadata["unit"] == "N"
    assert len(np.unique(ready.episode)) > 10
    np.testing.assert_allclose(readout.to_channels(readout.to_force(recording.measured)), recording.measured, atol=1e-3)


def test_channels_of_one_load_read_that_load():
    recording, true = rig(delay=0.0)
    only = dataclasses.replace(
        recording, measured=(motion(0, recording.time)[:, 2].reshape(-1, 1, 1, 1, 1) * true[2]).astype(np.float32)
    )
    ready = paxisim.calibrate_readout(only, {"Fz": "Fz"}).apply(only)
    np.testing.assert_allclose(ready.measured[:, 0, 0, 0, 0], recording.covariates["Fz"], atol=0.1)
    np.testing.assert_array_equal(np.ptp(ready.simulated, axis=(1, 2, 3, 4)), 0)


def test_channels_unrelated_to_any_load_are_marked():
    recording, _ = rig()
    recording.measured[:, 0, 1, 0, 2] = np.random.default_rng(0).normal(size=len(recording))
    recording.measured[:, 0, 2, 0, 4] = 7.0
    readout = paxisim.calibrate_readout(recording, NAMES)
    assert np.argwhere(~readout.used).tolist() == [[0, 1, 0, 2], [0, 2, 0, 4]]
    ready = readout.apply(recording)
    assert ready.metadata["readout"]["unused"] == [["pad0", "y", 0, 2], ["pad0", "z", 0, 4]]
    assert not ready.measured[:, 0, 1, 0, 2].any()
    assert not ready.simulated[:, 0, 1, 0, 2].any()
    assert "not related to any load, set to zero: 2 of 15 channels" in str(readout)


def test_a_channel_that_is_never_known_is_unused_and_samples_without_all_others_are_left_out():
    recording, true = rig()
    recording.measured[:, 0, 0, 0, 1] = np.nan
    recording.measured[100:200, 0, 2, 0, 2] = np.nan
    readout = paxisim.calibrate_readout(recording, NAMES)
    assert np.argwhere(~readout.used).tolist() == [[0, 0, 0, 1]]
    np.testing.assert_allclose(readout.gain, true * readout.used, atol=0.01 * np.abs(true).max())
    recording.measured[5:, 0, 2, 0, 2] = np.nan
    with pytest.raises(InvalidValueError, match="known together at 5 samples"):
        paxisim.calibrate_readout(recording, NAMES)


def test_the_held_out_error_is_that_of_another_recording():
    recording, true = rig(noise=0.1)
    readout = paxisim.calibrate_readout(recording, NAMES)
    clean = np.tensordot(motion(0, recording.time - 0.03), true, 1)
    np.testing.assert_allclose(readout.error, 0.1 * clean.std(axis=0), rtol=0.1)
    np.testing.assert_allclose(readout.explained, 1 / 1.01, atol=0.002)


def test_a_load_that_does_not_change_is_named_and_left_out():
    recording, true = rig()
    steady = with_loads(recording, Tz=np.random.default_rng(0).normal(0.1, 0.001, len(recording)))
    with pytest.warns(UserWarning, match=r"does not excite Tz: it varies by 0\.001 N m only"):
        readout = paxisim.calibrate_readout(steady, (*NAMES, "Tz"))
    assert readout.excitation.excited.tolist() == [True, True, True, False]
    assert not readout.gain[3].any()
    assert np.isinf(readout.gain_error[3]).all()
    np.testing.assert_allclose(readout.gain[:3], true, atol=0.01 * np.abs(true).max())
    assert "not excited" in str(readout)


def test_a_load_that_changes_only_with_others_is_named():
    recording, _ = rig()
    tied = with_loads(recording, Tx=-0.02 * recording.covariates["Fy"])
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        readout = paxisim.calibrate_readout(tied, (*NAMES, "Tx"))
    words = [str(warning.message) for warning in said]
    assert any("does not excite Tx apart from the other loads: they explain 100.0% of its variance" in w for w in words)
    assert not any("does not excite Fz" in w for w in words)
    assert readout.excitation.excited.all()
    assert not readout.excitation.separable[3]
    ready = readout.apply(tied)
    assert (ready.measured - ready.simulated).std() < 0.03 * ready.simulated.std()


def test_regularisation_is_used_where_it_helps_on_held_out_data():
    assert paxisim.calibrate_readout(rig()[0], NAMES).ridge == 0
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


def test_a_wrench_of_six_values_is_a_covariate_like_any_other():
    recording, true = rig()
    forces = np.stack([recording.covariates[name] for name in NAMES], axis=1)
    torques = 0.01 * np.stack([np.sin(t * recording.time) for t in (1.1, 1.7, 2.3)], axis=1)
    wrench = dataclasses.replace(recording, covariates={"ft": np.concatenate([forces, torques], axis=1)})
    readout = paxisim.calibrate_readout(wrench, "ft")
    assert [load.name for load in readout.loads] == ["Fx", "Fy", "Fz", "Tx", "Ty", "Tz"]
    np.testing.assert_allclose(readout.gain[:3], true, atol=0.01 * np.abs(true).max())
    assert "ft" not in readout.apply(wrench).covariates
    assert max(map(len, str(readout).splitlines())) <= 100
    json.dumps(dict(readout.apply(wrench).metadata))


def test_bad_loads():
    recording, _ = rig(seconds=10)
    with pytest.raises(UnknownNameError, match="unknown load component 'fz'; did you mean 'Fz'"):
        paxisim.calibrate_readout(recording, {"fz": "Fz"})
    with pytest.raises(InvalidValueError, match="one to 6 different loads, got \\['Fx', 'Fx'\\]"):
        paxisim.calibrate_readout(recording, ("Fx", "Fx"))
    with pytest.raises(InvalidValueError, match="one to 6 different loads, got \\[\\]"):
        paxisim.calibrate_readout(recording, ())
    with pytest.raises(InvalidValueError, match="degree must be 1, 2 or 3, got 4"):
        paxisim.calibrate_readout(recording, "Fz", degree=4)
    with pytest.raises(InvalidValueError, match="max_delay must be a time"):
        paxisim.calibrate_readout(recording, "Fz", max_delay=-1)
    with pytest.raises(InvalidValueError, match="time"):  # all samples at one time
        dataclasses.replace(recording, time=np.zeros(len(recording)))
    readout = paxisim.calibrate_readout(recording, NAMES)
    other = dataclasses.replace(recording, covariates={"Fx": recording.covariates["Fx"]})
    with pytest.raises(UnknownNameError, match="unknown covariate 'Fy'"):
        readout.apply(other)


def test_clocks_far_apart_are_told():
    recording, _ = rig(delay=0.9)
    with pytest.warns(UserWarning, match=r"end of the search, \+0\.5 s: it may be larger"):
        paxisim.calibrate_readout(recording, NAMES)
    assert paxisim.calibrate_readout(recording, NAMES, max_delay=2).delay == pytest.approx(0.9, abs=1e-3)
