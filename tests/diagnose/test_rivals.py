"""Rivals and faint causes: what a motion cannot separate, or only just shows, is said; what it separates is named."""

import numpy as np
import pytest
from recorded import diagnosed, motions_of, names, plain

from paxisim import augment

SLOW = {"family": "poor", "duration": 9.0}
"""One slow speed, one direction of shear."""
CREEP = augment.Creep((0.1, 0.1), (0.3, 5.0))


def rivals(found, name):
    return next(item.rivals for item in found.causes if item.name == name)


@pytest.mark.slow
def test_one_speed_does_not_tell_creep_from_hysteresis_and_several_do():
    recording = plain(CREEP.run, seed=7, **SLOW)
    found = diagnosed(recording, ("creep", "hysteresis"))
    (name,) = names(found)
    assert {name, *rivals(found, name)} == {"creep", "hysteresis"}
    assert found.verdict == "ambiguous"
    assert found.confidence[name] <= 0.5
    assert "triangles" in motions_of(found.advice)
    other = diagnosed(recording, ("creep", "axis_gain"))
    assert "hysteresis" not in {rival for item in other.causes for rival in item.rivals}, "it was not asked for"
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


@pytest.mark.parametrize(("amplitude", "faint"), [(0.018, True), (0.025, False)])
def test_a_faint_second_cause_is_not_passed_over(amplitude, faint):
    creep = augment.Creep((amplitude,), (1.0,))
    read = plain(lambda force, time: 1.2 * creep.run(force, time), seed=4, noise=0.05)
    found = diagnosed(read, ("axis_gain", "creep"))
    assert names(found) == (["axis_gain"] if faint else ["axis_gain", "creep"])
    assert any("creep" in item.what for item in found.symptoms.left_over) is faint
    assert any("creep" in line for line in found.advice) is faint
    assert found.verdict == ("partly_explained" if faint else "explained")
    assert ("creep is a near miss." in found.symptoms.reasons) is faint


def test_a_number_at_its_bound_leaves_half_of_the_confidence():
    creep = augment.Creep((2.5,), (1.0,))
    found = diagnosed(plain(creep.run, seed=3), ("creep",))
    assert names(found) == ["creep"]
    assert any("amplitude of creep is at its bound, 1.5:" in warning for warning in found.symptoms.warnings)
    assert "amplitude of creep is at its bound, 1.5." in found.symptoms.reasons
    assert found.confidence["creep"] <= 0.5
    assert found.verdict == "partly_explained"
