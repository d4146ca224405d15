"""Rivals: causes that a motion cannot separate are listed, causes that it separates are not."""

import numpy as np
import pytest
from recorded import diagnosed, names, plain

from paxisim import augment
from paxisim.diagnose.advice import motions_of

SLOW = {"family": "poor", "duration": 9.0}
"""One slow speed, one direction of shear."""
CREEP = augment.Creep((0.1, 0.1), (0.3, 5.0))


def rivals(found, name):
    return next(item.rivals for item in found.causes if item.name == name)


def test_one_speed_does_not_tell_creep_from_hysteresis():
    found = diagnosed(plain(CREEP.run, seed=7, **SLOW), ("creep", "hysteresis"))
    (name,) = names(found)
    assert {name, *rivals(found, name)} == {"creep", "hysteresis"}
    assert found.verdict == "ambiguous"
    assert found.confidence[name] <= 0.5
    assert "triangles" in motions_of(found.advice)


def test_several_speeds_and_holds_do():
    found = diagnosed(plain(CREEP.run, seed=7, duration=9.0), ("creep", "hysteresis"))
    assert names(found) == ["creep"]
    assert rivals(found, "creep") == ()
    assert found.verdict == "explained"


@pytest.mark.parametrize(("options", "told"), [(SLOW, False), ({}, True)])
def test_one_direction_of_shear_does_not_tell_a_rotation_from_a_coupling(options, told):
    turn = augment.Rotation(((0.0, 0.0, 0.1),))
    found = diagnosed(plain(lambda force, time: turn(force), seed=7, **options), ("rotation", "axis_coupling"))
    (name,) = names(found)
    if told:
        assert (name, rivals(found, name)) == ("rotation", ())
    else:
        assert {name, *rivals(found, name)} == {"rotation", "axis_coupling"}


def test_only_what_was_looked_for_is_a_rival():
    found = diagnosed(plain(CREEP.run, seed=7, **SLOW), ("creep", "axis_gain"))
    assert "hysteresis" not in {rival for item in found.causes for rival in item.rivals}


def test_what_is_read_off_the_data_has_no_rivals():
    recording = plain(seed=7, noise=0.1)
    recording.measured[:] = np.round(recording.measured * 2) / 2
    found = diagnosed(recording, ("quantisation", "dead_band"))
    assert rivals(found, "quantisation") == ()


@pytest.mark.parametrize(("where", "rival"), [("unpressed", ("dead_taxels",)), ("everywhere", ()), ("pressed", ())])
def test_an_offset_of_taxels_that_nothing_pressed_may_be_that_they_are_stuck(where, rival):
    recording = plain(seed=7)
    pressed = np.zeros((2, 1, 4, 3), dtype=bool)
    pressed[:, :, :2] = True
    on = {"unpressed": ~pressed, "everywhere": np.ones_like(pressed), "pressed": pressed}[where]
    recording.measured[:] += 0.3 * on - recording.simulated * ~pressed
    recording.simulated[:] *= pressed
    found = diagnosed(recording, ("offset", "dead_taxels"))
    assert names(found) == ["offset"]
    assert rivals(found, "offset") == rival
