"""What a sensor's steps hide while nothing is pressed is told under load: offsets, and drifts as such."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.practice.cases import make
from recorded import recording_of

from paxisim.augment import DeadBand
from paxisim.diagnose.cause import MANY
from paxisim.diagnose.engine import Thresholds, explain
from paxisim.diagnose.find_zero import zero_of
from paxisim.diagnose.noise import Tolerance
from paxisim.diagnose.problem import problem_of
from paxisim.diagnose.under_load import goes_with_load, tells_under_load, under_load

MATERIAL = MANY * Thresholds().material
QUIET = {"rows": 4, "cols": 3, "coarse": True, "duration": 6.0}


def quiet_case(*causes, **options):
    """A recording in steps of 0.1 N whose noise does not reach the next count, and its problem."""
    for seed in range(300, 400):
        case = make(causes, seed=seed, **QUIET, **options)
        problem = problem_of(recording_of(case), Tolerance())
        if tells_under_load(problem):
            print(f"make({causes}, seed={seed}, {QUIET}, {options}): signal {case.signal:.3g}")
            return case, problem
    raise AssertionError("no such recording")


def loaded(problem):
    """``(pads, 3, rows, cols)`` channels that are pressed enough to tell."""
    return np.quantile(np.abs(problem.simulated), 0.95, axis=0) > 3 * problem.step


@pytest.mark.parametrize("size", [0.02, 0.04, 0.3])
def test_an_offset_that_rests_within_a_count_is_read_where_taxels_are_pressed(size):
    case, problem = quiet_case()
    rng = np.random.default_rng(1)
    offset = size * rng.choice([-1.0, 1.0], problem.alive.shape)
    offset[:, 2] = np.abs(offset[:, 2])
    noise = problem.dither * rng.standard_normal(problem.simulated.shape)
    measured = np.round((problem.simulated + offset + noise) / problem.step) * problem.step
    measured[:, :, 2] = np.maximum(measured[:, :, 2], 0)
    case.measured = measured.astype(np.float32)
    problem = problem_of(recording_of(case), Tolerance())
    found = under_load(problem, problem.simulated, [np.ones(len(problem.time))])
    own = found.values.reshape(offset.shape)
    told = loaded(problem)
    assert told.sum() > 5
    np.testing.assert_allclose(own[told], offset[told], atol=0.4 * size + 0.1 * problem.step)
    assert found.gain.sum() > 0


@pytest.mark.parametrize(("factor", "offset", "named"), [(1.0, 0.03, True), (1.05, 0.0, False), (0.95, 0.0, False)])
def test_what_grows_with_the_load_is_no_offset(factor, offset, named):
    case, problem = quiet_case()
    sides = np.random.default_rng(1).choice([-1.0, 1.0], problem.alive.shape)
    measured = np.round((factor * problem.simulated + offset * sides) / problem.step) * problem.step
    measured[:, :, 2] = np.maximum(measured[:, :, 2], 0)
    case.measured = measured.astype(np.float32)
    problem = problem_of(recording_of(case), Tolerance())
    constant = under_load(problem, problem.simulated, [np.ones(len(problem.time))])
    assert constant.gain.sum() > MATERIAL * problem.samples
    assert goes_with_load(problem, problem.simulated, constant) is not named
    assert ("offset" in zero_of(problem, problem.simulated, MATERIAL, 0.7, names=("offset",)).gain) is named


def test_a_drift_behind_steps_is_no_offset():
    case, problem = quiet_case("drift", strength=0.4)
    zero = zero_of(problem, problem.simulated, MATERIAL, 0.7)
    assert list(zero.gain) == ["drift"]
    assert [item.name for item in explain(recording_of(case)).found] == ["drift"]


def test_an_offset_behind_steps_is_no_drift():
    case, problem = quiet_case("offset", strength=0.9)
    assert np.abs(case.truth["offset"]["offset"]).max() > problem.step
    zero = zero_of(problem, problem.simulated, MATERIAL, 0.7)
    assert list(zero.gain) == ["offset"]
    np.testing.assert_allclose(
        zero.offset.reshape(*zero.offset.shape[:2], -1), case.truth["offset"]["offset"], atol=0.6 * problem.step
    )


def test_nothing_behind_steps_is_nothing():
    _, problem = quiet_case()
    assert not zero_of(problem, problem.simulated, MATERIAL, 0.7).gain


@pytest.mark.parametrize("seed", [18, 86])
def test_slow_noise_behind_steps_is_no_drift(seed):
    problem = problem_of(recording_of(make((), seed=seed, rho=0.95, **QUIET)), Tolerance())
    assert tells_under_load(problem)
    assert not zero_of(problem, problem.simulated, MATERIAL, 0.7).gain


@pytest.mark.parametrize("added", ["offset", "drift"])
def test_a_zero_that_a_dead_band_holds_back_is_told_under_load(added):
    case = make((), seed=11, rows=4, cols=3, duration=6.0, rho=0.0, ideal=True)
    problem = problem_of(recording_of(case), Tolerance())
    rng = np.random.default_rng(2)
    size = 0.12 * rng.choice([-1.0, 1.0], problem.alive.shape) * rng.uniform(0.5, 1.0, problem.alive.shape)
    size[:, 2] = np.abs(size[:, 2])
    course = 1.0 if added == "offset" else -2 * np.expm1(-(case.time - case.time[0]) / 200)[:, None, None, None, None]
    gate = DeadBand(0.25, edge=0.1)
    read = gate(problem.simulated + size * course) + 0.02 * rng.standard_normal(problem.simulated.shape)
    read[:, :, 2] = np.maximum(read[:, :, 2], 0)
    case.measured = read.astype(np.float32)
    problem = problem_of(recording_of(case), Tolerance())
    assert not zero_of(problem, gate(problem.simulated), MATERIAL, 0.7, resting=True).gain  # nothing shows at rest
    zero = zero_of(replace(problem, gate=gate), problem.simulated, MATERIAL, 0.7)
    assert list(zero.gain) == [added]
    told = loaded(problem)
    true = (size * course * np.ones((len(case.time), 1, 1, 1, 1)))[:, told]
    wrong = zero.at(case.time - case.time[0])[:, told] - true
    assert np.sqrt(np.mean(wrong**2)) < 0.3 * np.sqrt(np.mean(true**2))


def test_an_offset_that_reads_otherwise_at_a_dead_bands_edge_is_one():
    found = explain(recording_of(make(("dead_band", "offset"), seed=2046020001, family="final"))).found
    assert {item.name for item in found} == {"dead_band", "offset"}
