"""Motions without contact reveal only the readings without force."""

import numpy as np
import pytest
from recorded import diagnosed, names, small


def without_contact(*causes, seed=1):
    """Return the episodes in which the gripper opens and closes without touching anything."""
    recording = small(*causes, seed=seed, strength=0.8, more=("gripper",) * 5)
    free = [n for n in np.unique(recording.episode) if not recording.simulated[recording.episode == n].any()]
    assert len(free) >= 5
    return recording[np.isin(recording.episode, free)]


@pytest.mark.parametrize("cause", ["interference", "offset", "drift"])
def test_what_a_sensor_reads_without_force_is_named(cause):
    found = diagnosed(without_contact(cause))
    assert names(found) == [cause]
    assert found.verdict == "explained"
    assert not found.symptoms.left_over
    assert "no contact" in found.symptoms.warnings[-1]
    # a line and a notebook show it
    assert repr(found).startswith(f"<Diagnosis: explained; causes: {cause}; held-out error ")
    assert "\n" not in repr(found)
    page = found._repr_html_()
    assert f"Explained by {cause} (" in page
    assert f"<td>{cause}</td>" in page


@pytest.mark.parametrize("hidden", [(), pytest.param(("axis_gain",), marks=pytest.mark.slow)])
def test_nothing_else_is_named_and_it_is_said_what_cannot_be_tested(hidden):
    found = diagnosed(without_contact(*hidden))
    assert not found.causes
    assert found.verdict == "no_discrepancy"
    assert {"creep", "axis_gain", "taxel_gain", "gel_operator"} <= found.not_testable.keys()
