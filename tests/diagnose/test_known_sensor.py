"""A sensor model known beforehand: the simulation is seen through it, and the report says so."""

import dataclasses

import numpy as np
import pytest
from recorded import diagnosed, names
from test_gel_cause import grid, pressed

import paxisim
from paxisim import augment
from paxisim.diagnose import Diagnosis

CAUSES = ("gel_operator", "axis_gain", "rotation", "offset")
OPERATOR = augment.GelOperator(poisson=(0.3, 0.1), along=(0.6, 0.5))
GAIN = augment.AxisGain((1.0, 1.0, 1.1))


@pytest.fixture(scope="module")
def recording():
    """Return presses read through a gel and a gain of z."""
    return pressed(grid(), lambda force: GAIN(OPERATOR(force)), seed=2)


def test_causes_are_searched_in_what_it_does_not_explain(recording, tmp_path):
    sensor = paxisim.Chain([OPERATOR, augment.Offset(0.5)], ["gel_operator", "offset"])
    found = diagnosed(recording, CAUSES, sensor=sensor)
    assert (found.verdict, names(found)) == ("explained", ["axis_gain"])
    assert found.known.startswith("Taken as known: gel_operator; offset of the same model may change")
    assert found.known[:40] in str(found)
    assert found.model.names == ("known_sensor", "axis_gain")
    reading = found.model.run(recording.simulated, recording.time)
    assert np.std(recording.measured - reading) < 0.025
    found.save(tmp_path / "out")
    assert found.known in (tmp_path / "out" / "report.html").read_text()
    loaded = Diagnosis.load(tmp_path / "out")
    assert loaded.known == found.known
    paxisim.GCS.around(loaded.model, loaded.intervals).sample(np.random.default_rng(0))


@pytest.mark.slow
def test_what_is_known_is_not_searched_again(recording):
    other = dataclasses.replace(OPERATOR, poisson=(0.25, 0.08))
    found = diagnosed(recording, sensor=other)
    assert found.not_testable["gel_operator"] == "it is taken as known"
    assert "gel_operator" not in names(found)


def test_a_unit_that_differs_from_it_is_named(recording):
    other = dataclasses.replace(OPERATOR, poisson=(0.15, 0.05))
    found = diagnosed(recording, CAUSES, sensor=other)
    assert names(found) == ["poisson"]  # which owns the gain, as if it were the sensor's calibration
    assert any("axis_gain may act beside it" in warning for warning in found.symptoms.warnings)
    (poisson,) = (p for p in found.causes[0].parameters if p.name == "poisson_next")
    assert poisson.value.value == pytest.approx(0.15, abs=0.05)


@pytest.mark.parametrize(
    ("sensor", "word"),
    [
        ("model.json", "Chain.load"),
        (paxisim.Chain([augment.Offset(0.5)], ["offset"]), "belongs to the unit itself.*got offset"),
        (augment.Offset(0.5), "belongs to the unit itself.*got offset"),
        (paxisim.Chain([]), "an empty chain"),
        (augment.AxisGain(np.ones((2, 3))), "not a batch"),
    ],
)
def test_what_cannot_be_known_is_refused(recording, sensor, word):
    with pytest.raises(paxisim.InvalidValueError, match=word):
        diagnosed(recording, CAUSES, sensor=sensor)
