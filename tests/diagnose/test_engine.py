"""What the engine returns and refuses. Whether it names what was hidden: test_hidden_effects.py."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.practice.cases import make
from recorded import recording_of

from paxisim import augment
from paxisim.diagnose import cause as registry
from paxisim.diagnose.cause import Cause, Free, known_causes, register_cause
from paxisim.diagnose.engine import explain
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.recording import Recording

VOCABULARY = {
    "axis_gain", "taxel_gain", "offset", "drift", "stiffening", "poisson", "crosstalk", "axis_coupling", "rotation",
    "layout", "creep", "hysteresis", "low_pass", "latency", "saturation", "dead_band", "quantisation", "dead_taxels",
    "interference",
}  # fmt: skip


def hidden(*causes, seed, **options):
    """A small recording in which `causes` are hidden."""
    case = make(causes, seed=seed, **{"rows": 4, "cols": 3, "duration": 6.0, **options})
    print(f"make({causes}, seed={seed}, {options}): signal {case.signal:.3g}")
    return recording_of(case), case


def named(explanation):
    return {item.name for item in explanation.found}


def test_every_name_of_the_vocabulary_is_known():
    assert set(known_causes()) >= VOCABULARY


def test_without_a_cause_the_simulation_stays_as_it_is():
    recording, case = hidden(seed=201)
    explanation = explain(recording)
    assert explanation.found == ()
    np.testing.assert_array_equal(explanation.prediction, case.simulated.astype(float))


@pytest.mark.parametrize(("seed", "rounding"), [(3, True), (53, True), (3, False)])
def test_a_gain_that_coarse_counts_hide_at_rest_is_no_offset(seed, rounding):
    family = ("development", "final")[seed % 2]
    options = {"rate": 30, "coarse": rounding, "strength": 0.6, "family": family, "rho": 0.0}
    recording, _ = hidden("axis_gain", seed=seed, **options)
    assert named(explain(recording)) == {"axis_gain"}


def test_the_model_makes_the_prediction():
    recording, case = hidden("latency", seed=303, strength=0.8)
    explanation = explain(recording)
    problem = explanation.problem
    np.testing.assert_allclose(problem.run(explanation.model, problem.simulated), explanation.prediction, atol=1e-9)
    (found,) = explanation.found
    assert found.values["delay"] == pytest.approx(case.truth["latency"]["delay"], rel=0.1)
    assert found.energy_gain.sum() == pytest.approx((explanation.empty_energy - explanation.energy).sum(), rel=0.1)
    assert "low_pass" in found.rivals_energy
    assert min(found.rivals_energy.values()) > 0.95 * explanation.energy.sum()


def mixed(seed, matrix):
    """A recording whose measured axes are mixed."""
    recording, _ = hidden(seed=seed)
    change = np.einsum("ij,tpjrc->tpirc", matrix - np.eye(3), recording.simulated.astype(float))
    return replace(recording, measured=(recording.measured + np.round(change, 2)).astype(np.float32))


def test_a_turn_about_the_normal_is_told_from_a_coupling_of_shear_and_normal_force():
    coupling, turn = np.array([[1, 0, 0.15], [0, 1, 0.1], [-0.05, 0.06, 1]]), 0.1
    turned = np.array([[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    found = explain(mixed(304, turned @ coupling))
    assert named(found) == {"axis_coupling", "rotation"}
    values = {item.name: item.values for item in found.found}
    assert values["rotation"]["about_z"] == pytest.approx(turn, abs=0.01)
    got = [values["axis_coupling"][name] for name in ("z_to_x", "z_to_y", "x_to_z", "y_to_z", "x_and_y")]
    np.testing.assert_allclose(got, [0.15, 0.1, -0.05, 0.06, 0.0], atol=0.03)  # a tilt is nearly such a coupling


def test_what_may_be_a_tilt_or_a_coupling_is_a_coupling_with_the_tilt_as_its_rival():
    found = explain(mixed(306, np.array([[1, 0, 0.06], [0, 1, -0.05], [-0.06, 0.05, 1]])))
    (coupling,) = found.found
    assert coupling.name == "axis_coupling"
    assert coupling.rivals_energy["rotation"] < 0.01 * coupling.energy_gain.sum()


def test_a_stiffening_that_is_nearly_a_gain_is_one():
    recording, _ = hidden(seed=310)
    simulated = recording.simulated.astype(float)
    change = augment.Stiffening(0.94, 40.0).run(simulated, recording.time) - simulated
    found = explain(replace(recording, measured=(recording.measured + np.round(change, 2)).astype(np.float32)))
    (stiffening,) = found.found
    assert stiffening.name == "stiffening"
    assert 0.03 < stiffening.rivals_energy["axis_gain"] / stiffening.energy_gain.sum() < 0.08


def test_drift_and_offset_run_through_the_pauses_in_the_model():
    recording, case = hidden("drift", "offset", seed=305, strength=0.9)
    explanation = explain(recording)
    assert named(explanation) == {"drift", "offset"}
    whole = explanation.model.run(case.simulated.astype(float), recording.time)
    np.testing.assert_allclose(whole, explanation.prediction, atol=1e-6)


def test_a_drift_stays_beside_a_field_that_took_some_of_what_it_brings():
    recording, _ = hidden("drift", "interference", seed=403, strength=0.15)
    assert named(explain(recording)) == {"drift", "interference"}


def test_a_fit_on_some_episodes_is_close_on_the_others():
    recording, case = hidden("axis_gain", seed=307, strength=0.8)
    explanation = explain(recording)
    held = explanation.fit_on([explanation.problem.episodes[number] for number in (0, 2, 4, 6)])
    assert held.shape == case.measured.shape
    problem = explanation.problem
    span = problem.episodes[1]
    after = np.sum(((problem.measured - held)[span] / problem.sigma[span]) ** 2)
    assert after < 1.1 * explanation.energy[1]
    assert after < explanation.empty_energy[1]


def test_only_the_causes_asked_for_are_looked_for():
    recording, _ = hidden("latency", seed=303, strength=0.8)
    explanation = explain(recording, ["low_pass", "axis_gain"])
    assert named(explanation) <= {"low_pass", "axis_gain"}
    assert set(explanation.not_searched) == set(known_causes()) - {"low_pass", "axis_gain"}


def test_a_cause_without_its_covariate_is_left_out_and_listed():
    recording, _ = hidden("axis_gain", seed=307, strength=0.8)
    bare = Recording(recording.time, recording.measured, recording.simulated, {}, recording.episode)
    explanation = explain(bare)
    assert named(explanation) == {"axis_gain"}
    assert "gripper_opening" in explanation.not_searched["interference"]


def test_a_cause_of_ones_own_takes_part(monkeypatch):
    monkeypatch.setattr(registry, "_CAUSES", {**{name: registry.cause(name) for name in known_causes()}})
    register_cause(
        Cause(
            "pad_gain",
            62,
            lambda problem: tuple(Free(f"pad_{p}", "1", 1.0, 0.2, 5.0, 0.1, 0.03) for p in range(2)),
            lambda values, problem: augment.PadAxisGain([[v] * 3 for v in values]),
            lambda problem: [(1.1, 1.0), (1.0, 1.1)],
        )
    )
    recording, case = hidden(seed=401)
    measured = case.measured.copy()
    measured[:, 0] *= 1.3
    measured[:, 1] *= 0.8
    other = Recording(recording.time, measured, recording.simulated, recording.covariates, recording.episode)
    (found,) = explain(other).found
    assert found.name == "pad_gain"
    assert found.values["pad_0"] == pytest.approx(1.3, abs=0.03)
    assert found.values["pad_1"] == pytest.approx(0.8, abs=0.03)


def test_a_recording_that_cannot_be_compared_is_refused():
    recording, case = hidden(seed=401)
    with pytest.raises(InvalidValueError, match="no simulated tensor"):
        explain(Recording(recording.time, recording.measured))
    broken = case.measured.copy()
    broken[3] = np.nan
    with pytest.raises(InvalidValueError, match="measured must be finite"):
        explain(Recording(recording.time, broken, recording.simulated))
    with pytest.raises(InvalidValueError, match="0 throughout"):
        explain(Recording(recording.time, recording.measured, 0 * case.simulated))
    noise = 0.02 * np.random.default_rng(0).standard_normal(case.measured.shape)
    flat = np.broadcast_to(case.simulated.max(axis=(3, 4), keepdims=True), noise.shape)
    with pytest.raises(InvalidValueError, match="no taxel answers"):
        explain(Recording(recording.time, noise, flat, episode=recording.episode))
    with pytest.raises(UnknownNameError, match="gremlins"):
        explain(recording, ["gremlins"])


def test_a_field_of_a_sensor_that_was_zeroed_elsewhere_comes_with_its_constant():
    rng, frames, episodes = np.random.default_rng(5), 200, 8
    time = np.concatenate([5.0 * k + 0.02 * np.arange(frames) for k in range(episodes)])
    episode = np.repeat(np.arange(episodes), frames)
    press = np.clip(np.sin(np.linspace(0, 3 * np.pi, frames)), 0, None)
    shapes = rng.uniform(0, 1, (episodes, 1, 2, 3, 4, 3)) * np.reshape([0.3, 0.2, 2.0], (3, 1, 1))
    simulated = (press[:, None, None, None, None] * shapes).reshape(-1, 2, 3, 4, 3)
    opening = 0.04 + 0.03 * np.sin(2 * np.pi * np.tile(np.arange(frames) / frames, episodes) + episode)
    covariates = {"gripper_opening": opening}
    field = augment.Interference(linear=((4.0, 0.0, 2.0), (0.0, 3.0, 0.0)), zeroed_at=0.035)
    measured = field.run(simulated, time, covariates) + 0.02 * rng.standard_normal(simulated.shape)
    found = explain(Recording(time, measured, simulated, covariates, episode))
    assert named(found) == {"interference"}
    np.testing.assert_allclose(found.prediction, found.model.run(simulated, time, covariates), atol=1e-6)
    assert np.abs((measured - found.prediction).mean(axis=0)).max() < 0.005
