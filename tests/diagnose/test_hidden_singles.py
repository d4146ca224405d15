"""Single hidden effects are named with the right size and gain: fixed cases, with counts that a poor build misses."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.compare import compare, headroom_share
from hidden.effects import EFFECTS
from hidden_suite import CHANCE, SINGLES, assert_right, bound

POOR = 0.6
ERROR = 0.15  # median, relative to the size of the effect
GAIN = 0.9  # median, fraction of the held-out headroom


@pytest.mark.parametrize(("count", "rate"), [(19, 0.6), (18, 0.6), (12, 0.4)])
def test_a_bound_is_the_least_count_that_a_poor_build_hardly_reaches(count, rate):
    least = bound(count, rate)
    assert binom.sf(least - 1, count, rate) < CHANCE <= binom.sf(least - 2, count, rate)


def test_each_effect_is_hidden_once():
    assert [case.names for case in SINGLES] == [(name,) for name in sorted(EFFECTS)]


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_most_effects_are_named():
    assert_right(SINGLES, lambda case: case.exact, POOR)


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_what_is_named_rightly_has_its_size():
    errors = {}
    for case in SINGLES:
        if case.exact:
            model = case.diagnosis().model[case.names[0]]
            errors[str(case)] = compare(case.names[0], case.recorded(), model.run)
    assert np.median(list(errors.values())) < ERROR, errors


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_what_is_named_rightly_has_its_gain():
    shares = {}
    for case in SINGLES:
        if case.exact:
            heldout = case.diagnosis().heldout
            share = headroom_share(case.recorded(), heldout.nrmse_before, heldout.nrmse_after)
            if share is not None:
                shares[str(case)] = share
    assert np.median(list(shares.values())) > GAIN, shares
