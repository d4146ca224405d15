"""A real sensor: eFlesh presses, if the data is available; benchmarks/eflesh.py produces the full figures."""

import os
from pathlib import Path

import numpy as np
import pytest

import paxisim
from paxisim.diagnose.pipeline import diagnose

FOLDER = Path(os.environ.get("PAXISIM_EFLESH") or Path(paxisim.__file__).parents[2] / "shared" / "data" / "eflesh")
CAUSES = ("channel_curve", "latency", "creep", "hysteresis")
THIN = 4

pytestmark = pytest.mark.skipif(not (FOLDER / "press_1.sensor.csv").exists(), reason="needs the eFlesh recordings")


@pytest.fixture(scope="module")
def presses():
    return [paxisim.Recording.load(FOLDER / f"press_{number}.sensor.csv", missing="drop") for number in (1, 2)]


@pytest.fixture(scope="module")
def readout(presses):
    return paxisim.calibrate_readout(presses[0], "load")


@pytest.fixture(scope="module")
def found(presses, readout):
    return diagnose(readout.apply(presses[0])[::THIN], CAUSES)


def nrmse(measured, predicted):
    return np.sqrt(np.sum((measured - predicted) ** 2) / np.sum(np.square(measured, dtype=float)))


def test_the_extended_model_is_right_of_a_recording_that_took_no_part(presses, readout, found):
    for press in presses:
        assert press.measured.shape[1:] == (1, 3, 1, 5)
        assert 30 < press.covariates["load"].max() < 35
        assert press.duration > 370
    held = readout.apply(presses[1])
    linear = nrmse(presses[1].measured, readout.to_channels(held.simulated))
    assert linear == pytest.approx(0.0717, abs=0.0005)
    extended = readout.to_channels(found.model.run(held.simulated.astype(float), held.time))
    assert nrmse(presses[1].measured, extended) < 0.68 * linear


def test_a_non_linearity_and_a_memory_are_named_and_what_the_recording_cannot_tell_is_admitted(found):
    names = {cause.name for cause in found.causes}
    assert "channel_curve" in names
    assert names & {"latency", "creep", "hysteresis"}
    assert found.verdict in ("partly_explained", "ambiguous")
    for cause in found.causes:
        if cause.name in ("creep", "hysteresis"):
            assert {"creep", "hysteresis"} - {cause.name} <= set(cause.rivals)
            assert any("three speeds" in line for line in found.advice)
    assert any("the sensor had not settled" in warning for warning in found.symptoms.warnings)
    assert any("first" in item.what for item in found.symptoms.left_over)
    assert "rotation" in found.not_testable


def test_training_is_randomised_around_the_model(found):
    chain = paxisim.GCS.around(found.model, found.intervals).sample(np.random.default_rng(0), (4,))
    assert np.asarray(chain["channel_curve"]["channel_curve"].error).shape == (4, 9, 1, 3, 1, 5)
    frame = np.ones((4, 1, 3, 1, 5))
    assert np.isfinite(chain.step(frame, chain.initial_state(frame), 0.0)[0]).all()
