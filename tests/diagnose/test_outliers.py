"""The second look, in which samples that a model misses by far count little."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.practice.cases import make
from recorded import recording_of

from paxisim.diagnose.cause import cause
from paxisim.diagnose.engine import explain
from paxisim.diagnose.fitting import fit
from paxisim.diagnose.noise import Tolerance
from paxisim.diagnose.outliers import FAR, without_outliers
from paxisim.diagnose.problem import problem_of


def recorded(*causes, **options):
    case = make(causes, **options)
    print(f"make({causes}, {options}): signal {case.signal:.3g}")
    return recording_of(case)


def test_what_is_far_off_counts_less_the_farther_and_nothing_else_changes():
    problem = problem_of(recorded(seed=11, rows=4, cols=3, duration=4.0), Tolerance())
    far = problem.measured.copy()
    where = (100, 0, 2, 1, 1)
    energy = []
    for off in (0.0, 2.0, 5.0, 20.0, 80.0):
        far[where] = problem.simulated[where] + off * problem.sigma[where]
        given = replace(problem, measured=far)
        left = without_outliers(given, problem.simulated)
        near = np.abs(given.residual(problem.simulated)) <= FAR
        assert near.mean() > 0.95
        np.testing.assert_array_equal(left.sigma[near], given.sigma[near])
        assert (left.sigma >= given.sigma).all()
        energy.append(left.residual(problem.simulated)[where] ** 2)
    assert max(energy) <= 1.01 * FAR**2
    assert energy[3] > energy[4]


@pytest.mark.parametrize(
    ("seed", "hides", "options"),
    [
        (2034010058, {"stiffening"}, {"family": "final"}),
        (71030031, set(), {"family": "development", "rho": 0.95}),
    ],
)
def test_a_small_effect_shows_where_contacts_that_are_off_their_place_do_not(seed, hides, options):
    """Taxels at a contact's edge are misread by up to ten times their noise, at a tenth of a millimetre."""
    found = explain(recorded(*hides, seed=seed, **options))
    assert {item.name for item in found.found} == hides


def test_a_field_that_the_steps_hide_is_fitted():
    """Noise hardly reaches the next count, so that a field does not show at all where the fit begins."""
    problem = problem_of(recorded("interference", seed=2034010065), Tolerance())
    assert problem.dither < 0.25 * problem.step
    nothing, found = fit(problem, []), fit(problem, [cause("interference")])
    assert found.energy.sum() < nothing.energy.sum() - 0.01 * problem.samples
