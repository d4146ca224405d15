"""From nothing to a cause that is named there is a size at which it may be at work, and is told as that."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
from hidden.practice.cases import make
from recorded import recording_of

from paxisim.augment.creep import Creep
from paxisim.diagnose.run import diagnose

CAUSES = ("axis_gain", "creep")


@pytest.mark.parametrize(
    ("amplitude", "named", "faint"),
    [(0.0, {"axis_gain"}, False), (0.011, {"axis_gain"}, True), (0.02, set(CAUSES), False)],
)
def test_a_faint_second_cause_is_not_passed_over(amplitude, named, faint):
    recording = recording_of(make(("axis_gain",), seed=401, rows=4, cols=3, duration=6.0, strength=0.7))
    force, creep = recording.simulated.astype(float), Creep((amplitude,), (1.0,))
    crept = [creep.run(force[own], recording.time[own]) for own in _episodes(recording.episode)]
    measured = recording.measured + (np.concatenate(crept) - force).astype(np.float32)
    diagnosis = diagnose(replace(recording, measured=measured), CAUSES)
    assert {item.name for item in diagnosis.causes} == named
    assert any(item.what.startswith("creep may be at work too") for item in diagnosis.symptoms.left_over) is faint
    assert any(line.startswith("to show creep") for line in diagnosis.advice) is faint
    assert (diagnosis.verdict == "partly_explained") is faint


def _episodes(numbers):
    return [numbers == number for number in np.unique(numbers)]
