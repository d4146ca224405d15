"""What a sensor's steps hide while nothing is pressed is told under load: offsets, and drifts as such."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.cases import make
from recorded import recording_of

from paxisim.diagnose.cause import MANY
from paxisim.diagnose.engine import Thresholds, explain
from paxisim.diagnose.noise import Tolerance
from paxisim.diagnose.problem import problem_of
from paxisim.diagnose.under_load import tells_under_load, under_load
from paxisim.diagnose.zero import zero_of

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
