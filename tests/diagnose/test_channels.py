"""Sensors whose channels are not in newtons are diagnosed, and effects that one load cannot separate are reported."""

from dataclasses import replace

import numpy as np
import pytest
from field_sensor import press
from recorded import diagnosed

import paxisim
from paxisim.diagnose.data.prepare import prepare
from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.data.repeats import one_speed, settling
from paxisim.diagnose.report.effect import effects
from paxisim.diagnose.report.page import evidence
from paxisim.diagnose.report.style import drawing
from paxisim.diagnose.report.text import black_box_in_words
from paxisim.diagnose.result import HeldOut, Interval

CAUSES = ("channel_curve", "latency", "hysteresis", "rotation", "stiffening", "offset")
ALL = np.ones(1, dtype=bool)  # channels


@pytest.fixture(scope="module")
def found():
    """Return the diagnosis of a sensor whose load cell is late."""
    return diagnosed(ready(press(lead=0.2)), CAUSES)


def ready(recording):
    return prepare(paxisim.calibrate_readout(recording, "load").apply(recording))[0]


def test_curves_of_the_channels_are_named_and_a_late_load_cell_is_aligned_first(found):
    readout = paxisim.calibrate_readout(press(lead=0.2), "load")
    assert readout.delay == pytest.approx(-0.2, abs=0.01)
    assert {item.name for item in found.causes} == {"channel_curve"}
    for name in ("rotation", "stiffening", "offset"):
        assert name in found.not_testable
    other = press(seed=1, lead=0.2)
    held = readout.apply(other)
    error = readout.to_channels(found.model.run(held.simulated.astype(float), held.time)) - other.measured
    assert np.sqrt(np.mean(error**2)) < 1.5 * 1.5  # 1.5 times the noise


def test_the_report_takes_no_channel_for_a_force_on_the_pad(found):
    assert found.streams.calibrated
    phases = {place.where: place.before for place in found.symptoms.phases}
    assert phases["sliding"] == 0
    assert min(phases["loading"], phases["unloading"]) > 0.1
    (effect,) = effects(found.causes[:1], found.model, found.streams)
    mean = effect.sums(0, 2)[1]
    assert mean.max() == pytest.approx(30, rel=0.1)  # N: the load, independent of the number of channels
    with drawing():
        _, curves = evidence(effect)
    assert "6 most affected channels" in curves.title


def test_a_black_box_that_explains_more_is_commented_on():
    figures = HeldOut(0.2, 0.1, 0.02, "repeated motions", Interval(0.75, 0.7, 0.8), (0.7, 0.8), 0.05, 0.95)
    assert "another 20% of the explainable error" in black_box_in_words(figures)
    assert black_box_in_words(replace(figures, ceiling_explained=0.79)) == ""
    alone = replace(figures, explained=Interval(0.75))
    assert black_box_in_words(replace(alone, ceiling_explained=0.754)) == "", "another 0% is nothing"
    assert "another 1%" in black_box_in_words(replace(alone, ceiling_explained=0.76))


def test_straight_sensors_and_force_sensors_have_no_curve():
    assert diagnosed(ready(press(bend=0.0)), CAUSES).causes == ()
    force = np.zeros((200, 1, 3, 2, 2))
    force[:, 0, 2] = 1 + np.sin(np.arange(200) / 9)[:, None, None]
    force[:, 0, 2, 1, 1] *= 2
    noise = np.random.default_rng(0).normal(size=force.shape) * 0.05
    recording = paxisim.Recording(np.arange(200) / 20, force + noise, force)
    assert "newtons" in diagnosed(recording, ("channel_curve",)).not_testable["channel_curve"]


def test_one_speed_cannot_tell_creep_from_hysteresis():
    assert one_speed(problem_of(ready(press())))
    assert not one_speed(problem_of(ready(press(periods=(6.0, 20.0)))))


def test_a_sensor_that_settles_is_told_and_its_first_presses_left_out():
    assert settling(ready(press()), ALL)[0] == 0
    fresh, off = settling(ready(press(fresh=0.1)), ALL)
    assert 1 <= fresh <= 4
    assert off > 4
    found = diagnosed(paxisim.calibrate_readout(press(fresh=0.1), "load").apply(press(fresh=0.1)), CAUSES)
    assert any("had not settled" in warning for warning in found.symptoms.warnings)
    assert any("read differently from the later ones" in item.what for item in found.symptoms.left_over)
    assert found.verdict == "partly_explained"


def test_different_motions_say_nothing_of_settling():
    assert settling(ready(press(fresh=0.1, periods=(6.0, 20.0, 11.0))), ALL)[0] >= 1  # the same motion by phase
    uneven = press(fresh=0.1)
    half = np.arange(len(uneven)) > len(uneven) // 2
    uneven.measured[half] *= 0.5
    uneven.covariates["load"][half] *= 0.5
    assert settling(ready(uneven), ALL) == (0, 0.0)
