"""The terms of the reward, for states computed by hand."""

import numpy as np
import pytest
from paxisim_insertion import TASKS, Parameters
from paxisim_insertion.reward import WEIGHTS, insertion, reward_terms, weighted

PARAMETERS = Parameters(peg_size=20e-3, peg_length=35e-3, hole_depth=20e-3, epsilon=0.1, success_depth=5e-3)
UPRIGHT = np.eye(3)
STILL = np.zeros(3)


def state(name, x, y, z, rotation=UPRIGHT):
    return insertion(TASKS[name], PARAMETERS, np.array([x, y, z]), rotation)


def test_the_weights_are_the_papers():
    assert WEIGHTS == {"reach": 1.0, "engage": 50.0, "success": 200.0, "action": 0.1}


def test_above_the_hole():
    above = state("SQ-2mm", 3e-3, 4e-3, 32e-3)
    # all keypoints are offset by the same vector (3, 4, 32) mm
    assert above.distance == pytest.approx(np.sqrt(9 + 16 + 1024) * 1e-3)
    assert (above.engaged, above.success) == (False, False)
    terms = reward_terms(above, STILL, 0.1)
    assert terms == {"reach": pytest.approx(1 / (10 * above.distance + 0.1)), "engage": 0, "success": 0, "action": 0}


def test_engaged_and_then_inserted():
    engaged = state("SQ-2mm", 0, 0, 15e-3)
    assert (engaged.engaged, engaged.success) == (True, False)
    # d = h = 15 mm: 1 / 0.25 = 4 for both
    assert weighted(reward_terms(engaged, STILL, 0.1)) == pytest.approx(4 + 50 * 4)
    inserted = state("SQ-2mm", 0, 0, 4e-3)
    assert (inserted.engaged, inserted.success) == (True, True)
    assert weighted(reward_terms(inserted, STILL, 0.1)) == pytest.approx(51 / 0.14 + 200)
    bottom = weighted(reward_terms(state("SQ-2mm", 0, 0, -2e-5), STILL, 0.1))
    assert bottom == pytest.approx(51 / 0.1 + 200, rel=2e-3)


def test_the_action_costs_a_tenth_of_its_square():
    here = state("SQ-2mm", 0, 0, 40e-3)
    costs = weighted(reward_terms(here, STILL, 0.1)) - weighted(reward_terms(here, np.array([1.0, -0.5, 0.5]), 0.1))
    assert costs == pytest.approx(0.1 * 1.5)


@pytest.mark.parametrize(
    ("name", "x", "y", "engaged"),
    [
        ("SQ-2mm", 0, 0, True),
        ("SQ-2mm", 5e-3, 0, False),  # beside the hole and below its edge: off the base
        ("SQ-2mm", 0, -5e-3, False),
        ("SX-2mm", 30e-3, 0, True),  # anywhere along the groove
        ("SX-2mm", 0, 5e-3, False),
        ("SY-2mm", 0, 30e-3, True),
        ("SY-2mm", 5e-3, 0, False),
    ],
)
def test_where_a_peg_counts_as_engaged(name, x, y, engaged):
    assert state(name, x, y, 15e-3).engaged == engaged
    assert not state(name, x, y, 19.5e-3).engaged, "resting on the rim"
    assert not state(name, x, y, 25e-3).engaged


@pytest.mark.parametrize(("angle", "engaged"), [(0.16, True), (-0.16, True), (0.18, False), (-0.3, False)])
def test_a_peg_that_leans_too_far_is_not_engaged(angle, engaged):
    lean = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    for rotation in (lean, lean[np.ix_([1, 0, 2], [1, 0, 2])]):
        assert state("SQ-2mm", 0, 0, 15e-3, rotation).engaged == engaged
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert state("SQ-2mm", 0, 0, 15e-3, turned).engaged, "a rotation about its own axis is not a lean"


def test_distance_along_a_groove_does_not_count():
    assert state("SX-2mm", 12e-3, 0, 0).distance == 0
    assert state("SY-2mm", 0, 12e-3, 0).distance == 0
    assert state("SX-2mm", 12e-3, 5e-3, 0).distance == pytest.approx(5e-3)


def test_a_leaning_peg():
    angle = 0.1
    lean = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    # a keypoint at r in the plane of the lean moves by 2 r sin(angle / 2); four at 10 mm, four at sqrt(100 + 35^2) mm
    chord = 2 * np.sin(angle / 2)
    expected = chord * (10e-3 + np.hypot(10e-3, 35e-3)) / 2
    assert state("SQ-2mm", 0, 0, 0, lean).distance == pytest.approx(expected)
