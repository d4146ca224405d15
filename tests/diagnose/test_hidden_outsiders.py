"""Effects outside the vocabulary: the diagnosis reports a residual that no cause explains."""

import pytest
from hidden_suite import FOREIGN, LEARNT, SINCE_LEARNT, assert_right

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]

POOR = 0.6
FLAGGED = ("partly_explained", "unexplained")


def test_most_effects_outside_the_vocabulary_are_flagged():
    assert_right(FOREIGN, lambda case: case.diagnosis().verdict in FLAGGED, POOR)


def test_those_that_the_vocabulary_has_learnt_are_named():
    assert SINCE_LEARNT
    assert [case.named for case in SINCE_LEARNT] == [(LEARNT[case.names[0]],) for case in SINCE_LEARNT]
