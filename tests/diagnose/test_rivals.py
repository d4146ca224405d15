"""Rivals: what a motion cannot tell apart is said, what it can is not."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from paxisim.augment import Offset
from paxisim.diagnose.cause import cause, known_causes
from paxisim.diagnose.engine import Explanation, Named, Tolerance
from paxisim.diagnose.fitting import in_order
from paxisim.diagnose.problem import problem_of
from paxisim.diagnose.rivals import rivals_of

sys.path.insert(0, str(Path(__file__).parents[1]))
from hidden.practice.cases import make
from recorded import recording_of


def problem(family):
    case = make((), seed=7, family=family, rows=4, cols=3, duration=9.0)
    return problem_of(recording_of(case), Tolerance())


@pytest.fixture(scope="module")
def poor():
    return problem("poor")


@pytest.fixture(scope="module")
def rich():
    return problem("development")


def rivals(given, name, values, gain=1e6, remains=1e9, **left):
    """The rivals of a cause beside which so much remains, had `left` more been left with others in its place."""
    transform = cause(name).make(values, given)
    prediction = given.run(transform, given.simulated)
    given = replace(given, measured=prediction, step=0.0, clips=False)
    named = Named(name, transform, {}, np.array([gain]), left)
    model = in_order([(name, transform)])
    barred = {other: why for other in known_causes() if (why := cause(other).barred(given))}
    found = Explanation(given, (named,), model, prediction, np.zeros(1), np.array([remains]), barred)
    return rivals_of(found, least=100.0)[name]


CREEP = (0.1, 0.3, 0.1, 5.0)


def test_one_speed_does_not_tell_creep_from_hysteresis(poor):
    assert "hysteresis" in rivals(poor, "creep", CREEP)
    assert "creep" in rivals(poor, "hysteresis", (0.05, 0.05, 0.05, 0.0))


def test_several_speeds_and_holds_do(rich):
    assert rivals(rich, "creep", CREEP) == ()
    assert rivals(rich, "hysteresis", (0.05, 0.1, 0.05, 0.0)) == ()


@pytest.mark.parametrize(
    ("name", "values"), [("crosstalk", (0.03, 0.5, 0.5)), ("poisson", (0.1, 0.1)), ("dead_band", (0.15, 0.0, 0.2))]
)
def test_what_has_a_shape_of_its_own_has_no_rivals_on_any_motion(poor, rich, name, values):
    assert rivals(poor, name, values) == ()
    assert rivals(rich, name, values) == ()


def test_one_direction_of_shear_does_not_tell_rotation_from_coupling(poor, rich):
    assert "axis_coupling" in rivals(poor, "rotation", (0.03, 0.0, 0.1))
    assert rivals(rich, "rotation", (0.03, 0.0, 0.1)) == ()


def test_a_rotation_whose_tilt_of_shear_into_normal_force_hardly_shows_may_be_a_coupling(rich):
    assert rivals(rich, "rotation", (0.004, 0.0, 0.0)) == ("axis_coupling",)


def test_a_rival_that_was_fitted_is_one_if_it_leaves_hardly_more(rich):
    assert rivals(rich, "latency", (0.03,), low_pass=2e4) == ("low_pass",)
    assert rivals(rich, "latency", (0.03,), low_pass=2e5) == ()
    assert rivals(rich, "latency", (0.03,), gain=1e3, low_pass=90.0) == ("low_pass",)


def test_what_leaves_twice_as_much_is_no_rival_however_little_that_is_of_the_gain(poor, rich):
    assert rivals(rich, "latency", (0.03,), remains=3e4, low_pass=2e4) == ("low_pass",)
    assert rivals(rich, "latency", (0.03,), remains=1e4, low_pass=2e4) == ()
    assert rivals(poor, "hysteresis", (0.05, 0.05, 0.05, 0.0), remains=1.0) == ()  # nor one that was not fitted


def test_a_more_general_cause_must_do_better_than_the_one_that_it_imitates(rich):
    gains = (1.1, 0.9, 1.1)
    assert rivals(rich, "axis_gain", gains, taxel_gain=1e3) == ()
    assert rivals(rich, "axis_gain", gains, taxel_gain=-1e5) == ()
    assert rivals(rich, "axis_gain", gains, taxel_gain=-2e5) == ("taxel_gain",)


def test_what_is_read_off_the_data_has_no_rivals(rich):
    named = Named("quantisation", in_order([]), {}, np.ones(1), {})
    nothing = Explanation(rich, (named,), in_order([]), rich.simulated, np.zeros(1), np.zeros(1))
    assert rivals_of(nothing, least=100.0) == {"quantisation": ()}


@pytest.mark.parametrize(("where", "rival"), [("unpressed", ("dead_taxels",)), ("everywhere", ()), ("pressed", ())])
def test_an_offset_of_taxels_that_nothing_pressed_may_be_that_they_are_stuck(poor, where, rival):
    pressed = np.zeros((2, 4, 3), dtype=bool)
    pressed[:, :2] = True
    simulated = poor.simulated * pressed[:, None]
    on = {"unpressed": ~pressed, "everywhere": np.ones_like(pressed), "pressed": pressed}[where]
    offset = 0.3 * np.broadcast_to(on[:, None], poor.alive.shape)
    given = replace(poor, simulated=simulated, measured=simulated + offset)
    named = Named("offset", Offset(offset), {"value": offset}, np.array([1e6]), {})
    model = in_order([("offset", named.transform)])
    found = Explanation(given, (named,), model, simulated + offset, np.zeros(1), np.zeros(1))
    assert rivals_of(found, least=100.0)["offset"] == rival
