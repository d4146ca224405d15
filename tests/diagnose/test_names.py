"""Named causes and their values in recordings that reveal them; test_hidden.py measures how often."""

from dataclasses import replace

import numpy as np
import pytest
from recorded import diagnosed, make, names, plain, recording_of, small

from paxisim import augment
from paxisim.diagnose import known_causes
from paxisim.recording import Recording

GEOMETRY = ("rotation", "axis_coupling", "axis_gain")
ZERO = ("offset", "drift", "axis_gain", "interference")


def values(found, name):
    return {p.name: p.value.value for item in found.causes if item.name == name for p in item.parameters}


@pytest.mark.parametrize("delay", [0.06, -0.06])
def test_either_stream_may_be_late(delay):
    def late(force, time):
        flat = force.reshape(len(force), -1).T
        return np.stack([np.interp(time - delay, time, channel) for channel in flat], axis=1).reshape(force.shape)

    found = diagnosed(plain(late, seed=3), ("latency", "low_pass", "creep", "axis_gain"))
    assert names(found) == ["latency"]
    assert values(found, "latency")["delay"] == pytest.approx(delay, rel=0.1)


def test_a_turn_about_the_normal_is_told_from_a_coupling_of_shear_and_normal_force():
    coupling, turn = np.array([[1, 0, 0.15], [0, 1, 0.1], [-0.05, 0.06, 1]]), 0.1
    turned = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    mixed = plain(lambda force, time: np.einsum("ij,tpjrc->tpirc", turned @ coupling, force), seed=3)
    found = diagnosed(mixed, GEOMETRY)
    assert set(names(found)) == {"axis_coupling", "rotation"}
    for pad in (0, 1):
        assert values(found, "rotation")[f"about_z_{pad}"] == pytest.approx(turn, abs=0.01)
    got = [values(found, "axis_coupling")[name] for name in ("z_to_x", "z_to_y", "x_to_z", "y_to_z", "x_and_y")]
    np.testing.assert_allclose(got, [0.15, 0.1, -0.05, 0.06, 0.0], atol=0.03)  # a tilt resembles such a coupling


def test_the_pad_that_is_turned_is_told_from_the_one_that_is_not():
    turn = augment.Rotation(((0.0, 0.0, 0.08), (0.0, 0.0, 0.0)))
    found = diagnosed(plain(lambda force, time: turn(force), seed=7), GEOMETRY)
    assert names(found) == ["rotation"]
    angles = {p.name: p.value for p in found.causes[0].parameters}
    for pad, true in enumerate((0.08, 0.0)):
        own = angles[f"about_z_{pad}"]
        assert own.low <= true <= own.high
        assert own.high - own.low < 0.02


def test_gains_of_taxels_and_of_axes_are_told_apart():
    own = np.random.default_rng(3).normal(1.0, 0.1, (2, 1, 4, 3))
    axes = np.array([1.2, 0.9, 1.1]).reshape(3, 1, 1)
    found = diagnosed(plain(lambda force, time: axes * own / own.mean() * force, seed=3), ("axis_gain", "taxel_gain"))
    assert set(names(found)) == {"axis_gain", "taxel_gain"}
    gains = values(found, "axis_gain")
    ratio = np.array([gains[f"gain_{axis}"] for axis in "xyz"]) / axes.ravel()
    assert np.ptp(ratio) < 0.03


def test_a_saturation_that_one_press_alone_reaches_is_named():
    recording = plain(seed=4)
    limit = np.sort([recording.simulated[recording.episode == n].max() for n in range(8)])[-2]
    recording.measured[:] = np.minimum(recording.measured, limit)
    found = diagnosed(recording, ("saturation", "stiffening", "axis_gain", "creep"))
    assert names(found) == ["saturation"]
    assert values(found, "saturation")["limit"] == pytest.approx(limit, rel=0.15)


@pytest.mark.slow
def test_what_may_explain_nothing_is_not_named():
    found = diagnosed(small("drift", seed=9_100_006, strength=0.74, family="final"))
    assert names(found) == ["drift"]
    assert any(line.startswith("offset was fitted but not named") for line in found.symptoms.warnings)


@pytest.mark.slow
def test_an_offset_that_may_explain_nothing_takes_no_other_cause_with_it():
    found = diagnosed(recording_of(make(("axis_gain", "interference"), seed=9_000_020_034, family="final")))
    (line,) = (line for line in found.symptoms.warnings if line.startswith("offset was fitted but not named"))
    assert line.endswith("there is no need to act")
    assert set(names(found)) == {"axis_gain", "interference"}


def test_a_press_beside_its_place_is_no_cause():
    recording = plain(seed=4)
    hardest = int(recording.episode[recording.simulated.max(axis=(1, 2, 3, 4)).argmax()])
    own = recording.episode == hardest
    moved = 0.9 * recording.simulated[own] + 0.1 * np.roll(recording.simulated[own], 1, axis=4)
    recording.measured[own] += moved - recording.simulated[own]
    assert names(diagnosed(recording, ("taxel_gain", "gel_operator", "creep", "axis_gain", "hysteresis"))) == []


@pytest.mark.parametrize("name", ["offset", "drift"])
def test_a_zero_that_coarse_counts_hide_at_rest_is_told_under_load(name):
    """The noise is too small to reach the next count."""
    rng = np.random.default_rng(1)
    recording = plain(seed=6, noise=0.01)
    own = rng.choice([-1.0, 1.0], recording.measured.shape[1:]) * rng.uniform(0.5, 1.0, recording.measured.shape[1:])
    course = {"offset": 0.06, "drift": -0.4 * np.expm1(-recording.time / 150)[:, None, None, None, None]}[name]
    recording.measured[:] = np.round((recording.measured + course * own) / 0.1) * 0.1
    assert names(diagnosed(recording, ZERO)) == [name]


@pytest.mark.parametrize("factor", [1.0, 0.9])
def test_what_coarse_counts_make_of_a_gain_is_no_offset(factor):
    recording = plain(lambda force, time: factor * force, seed=6, noise=0.01)
    recording.measured[:] = np.round(recording.measured / 0.1) * 0.1
    assert names(diagnosed(recording, ZERO)) == ([] if factor == 1 else ["axis_gain"])


def test_slow_noise_behind_steps_is_no_zero():
    assert names(diagnosed(small(seed=18, coarse=True, rho=0.95), ZERO)) == []


def test_drift_and_offset_run_through_the_pauses_in_the_model():
    recording = plain(seed=8)
    rng = np.random.default_rng(2)
    for course in (np.ones(len(recording.time)), -3 * np.expm1(-(recording.time - recording.time[0]) / 300)):
        size = rng.uniform(0.1, 0.2, recording.measured.shape[1:])
        own = size * rng.choice([-1.0, 1.0], size.shape)
        recording.measured[:] += course[:, None, None, None, None] * own
    found = diagnosed(recording, ZERO)
    assert set(names(found)) == {"drift", "offset"}
    extended = found.model.run(recording.simulated.astype(float), recording.time)
    assert np.std(recording.measured - extended) < 1.1 * 0.02


def test_only_what_can_be_tested_and_is_asked_for_is_looked_for():
    given = plain(lambda force, time: 1.2 * force, seed=3)
    found = diagnosed(given, ["low_pass", "creep"])
    assert set(names(found)) <= {"low_pass", "creep"}
    assert set(found.not_testable) >= set(known_causes()) - {"low_pass", "creep"}
    bare = Recording(given.time, given.measured, given.simulated, {}, given.episode)
    found = diagnosed(bare, ("axis_gain", "interference"))
    assert names(found) == ["axis_gain"]
    assert "gripper_opening" in found.not_testable["interference"]
    replay = {"mode": "fitted", "not_testable": {"axis_gain": "the closing was fitted to the measured total force"}}
    found = diagnosed(replace(given, metadata={**given.metadata, "replay": replay}), ("axis_gain", "latency"))
    assert names(found) == []
    assert found.not_testable["axis_gain"] == "the closing was fitted to the measured total force"


def test_what_a_motion_does_not_excite_cannot_be_tested():
    given = plain(seed=3)
    still = Recording(
        given.time, given.measured, given.simulated, {"gripper_opening": 0.02 + 0 * given.time}, given.episode
    )
    assert "interference" in diagnosed(still, ("interference", "axis_gain")).not_testable
    shear = np.array([0.0, 0.0, 1.0]).reshape(3, 1, 1)
    press = Recording(given.time, given.measured, given.simulated * shear, {}, given.episode)
    press.measured[:] += press.simulated - given.simulated
    assert "axis_gain" not in diagnosed(press, ("rotation", "axis_gain")).not_testable
