"""What one episode alone shows is a cause only if a press beside its place would not look so."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.practice.cases import make
from recorded import recording_of

from paxisim.diagnose.cause import cause
from paxisim.diagnose.displaced import beyond_tolerated
from paxisim.diagnose.engine import explain
from paxisim.diagnose.fits import Fits
from paxisim.diagnose.noise import Tolerance, differences
from paxisim.diagnose.problem import problem_of
from paxisim.diagnose.worth import Thresholds, Worth


@pytest.fixture(scope="module")
def problem():
    return problem_of(recording_of(make((), seed=14, rows=4, cols=3, duration=4.0)), Tolerance())


def hardest(problem):
    return max(problem.episodes, key=lambda span: problem.simulated[span].max())


@pytest.mark.parametrize("shape", ["place", "gain", "time"])
def test_what_is_tolerated_of_an_episode_brings_nothing(problem, shape):
    span, force = hardest(problem), problem.simulated
    time = np.gradient(force[span], problem.time[span], axis=0)
    change = {"place": 0.2 * differences(force[span])[1], "gain": -0.1 * force[span], "time": -0.03 * time}[shape]
    more = force.copy()
    more[span] += change
    measured = problem.measured.copy()
    measured[span] += change
    moved = replace(problem, measured=measured)
    gain = np.sum(moved.residual(force)[span] ** 2) - np.sum(moved.residual(more)[span] ** 2)
    assert beyond_tolerated(moved, force, more, span) < 0.01 * gain


def test_what_saturates_in_an_episode_is_left(problem):
    span, force = hardest(problem), problem.simulated
    most = 0.8 * force[span].max()
    measured = np.minimum(problem.measured, most)
    more = np.minimum(force, most)
    saturated = replace(problem, measured=measured)
    gain = np.sum(saturated.residual(force)[span] ** 2) - np.sum(saturated.residual(more)[span] ** 2)
    assert 0.5 * gain < beyond_tolerated(saturated, force, more, span) <= 1.01 * gain


@pytest.mark.parametrize("shape", ["gains", "places"])
def test_gains_of_taxels_are_kept_only_if_contacts_beside_their_places_would_not_look_so(problem, shape):
    rng = np.random.default_rng(3)
    noise = problem.measured - problem.simulated
    press = problem.simulated[hardest(problem)]
    force = np.concatenate([np.resize(press, noise[span].shape) for span in problem.episodes])  # one press, repeated
    if shape == "gains":
        moved = force * (1 + 0.1 * rng.standard_normal(problem.alive.shape[2:]))
    else:
        moved = force + 0.3 * differences(force)[1]
    apart = replace(problem, simulated=force, measured=moved + noise)
    fits = Fits(apart, [cause("taxel_gain")])
    nothing = fits.of([])
    gained = fits.of(["taxel_gain"], nothing)
    worth = Worth(fits, Thresholds())
    assert nothing.energy.sum() - gained.energy.sum() > 0.02 * apart.samples  # much more than is asked for
    assert worth.keeps(gained, nothing, "taxel_gain") is (shape == "gains")


@pytest.mark.parametrize("seed", [1, 4])
def test_a_saturation_that_one_press_alone_reaches_is_named(seed):
    case = make((), seed=seed, rows=4, cols=3, duration=6.0)
    limit = np.sort([case.simulated[case.episode == n].max() for n in np.unique(case.episode)])[-2]
    saturated = replace(case, measured=np.minimum(case.measured, limit))
    found = explain(recording_of(saturated)).found
    assert [item.name for item in found] == ["saturation"]
    assert found[0].values["limit"] == pytest.approx(limit, rel=0.1)


@pytest.mark.parametrize("seed", [2045060018, 2045060037])
def test_taxels_without_an_answer_that_one_press_reaches_are_neither_gains_nor_a_drift(seed):
    """It reaches them too lightly to tell that they are dead."""
    found = explain(recording_of(make(("dead_taxels",), seed=seed, family="poor", rate=20))).found
    assert [item.name for item in found] == ["dead_taxels"]
