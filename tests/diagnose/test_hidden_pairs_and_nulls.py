"""Two hidden effects are both named, and nothing is named where nothing is hidden."""

import pytest
from hidden_suite import NULLS, PAIRS, assert_right

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]

POOR = 0.4
FALSE = 1  # at most this many named causes in ten recordings


def test_most_pairs_are_named():
    assert_right(PAIRS, lambda case: case.exact, POOR)


def test_hardly_anything_is_named_where_nothing_is_hidden():
    assert sum(len(case.named) for case in NULLS) <= FALSE, "\n".join(map(str, NULLS))
