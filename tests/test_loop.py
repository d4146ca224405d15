"""The core of the loop: replay a recording, name the hidden causes of its sensor, and use the model."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("serial")
pytest.importorskip("termios")  # for the example's emulator

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import loop as benchmark

import paxisim
from paxisim.augment import AxisGain, Creep

HIDDEN = paxisim.Chain([Creep((0.15,), (1.0,)), AxisGain((0.7, 0.7, 0.7))])


@pytest.fixture(scope="module")
def loop():
    """The motion of the arm with its sensor's readings in counts of 0.1 N, and the replay."""
    return benchmark.paired(HIDDEN)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_gain_and_creep_are_named_and_their_model_predicts_another_motion(loop, monkeypatch):
    for name in ("sklearn", "sklearn.ensemble"):  # skip the black-box model: it is slow and names no causes
        monkeypatch.setitem(sys.modules, name, None)
    found = paxisim.diagnose(loop[loop.time < benchmark.DIAGNOSED])
    named = {cause.name: {p.name: p.value.value for p in cause.parameters} for cause in found.causes}
    assert set(named) == {"axis_gain", "creep"}
    assert named["creep"]["amplitude"] == pytest.approx(0.15, abs=0.04)

    later = loop[loop.time >= benchmark.DIAGNOSED]
    before, after = (
        np.sqrt(np.mean((later.measured - prediction) ** 2))
        for prediction in (later.simulated, found.model.run(later.simulated.astype(float), later.time))
    )
    assert after < 0.5 * before
