"""Channels that never change are left out if they are loaded beyond what rounding and dead bands suppress."""

from dataclasses import replace

import numpy as np
import pytest
from recorded import diagnosed, names, plain

from paxisim.diagnose.causes.channels import silent_channels
from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.explain.evidence import silent_in_words

CAUSES = ("axis_gain", "taxel_gain", "dead_taxels")


@pytest.fixture(scope="module")
def recording():
    """A recording on 4x3 pads that read the normal force 20% too high."""
    return plain(lambda force, time: force * np.reshape([1.0, 1.0, 1.2], (3, 1, 1)), seed=3)


def silent(recording, measured):
    return silent_channels(problem_of(replace(recording, measured=measured)))


def most_pressed(recording, axis=2, pad=0):
    size = np.abs(recording.simulated[:, pad, axis]).max(axis=0)
    return np.unravel_index(int(size.argmax()), size.shape)


def test_a_channel_that_is_stuck_alone_is_silent_and_no_gain_of_its_taxel(recording):
    assert not silent(recording, recording.measured).any()
    row, col = most_pressed(recording)
    measured = recording.measured.copy()
    for value in (0.7, 0.0):
        measured[:, 0, 2, row, col] = value
        found = silent(recording, measured)
        np.testing.assert_array_equal(np.argwhere(found), [[0, 2, row, col]])
    assert silent_in_words(found, ("left", "right"))[0].startswith(f"z of pad left ({row}, {col}) never changes")
    found = diagnosed(replace(recording, measured=measured), CAUSES)
    assert names(found) == ["axis_gain"]
    assert any(f"z of pad0 ({row}, {col}) never changes" in line for line in found.symptoms.warnings)


def test_small_forces_that_a_gate_holds_back_are_not_silent(recording):
    gated = np.where(np.abs(recording.measured) < 0.3, 0, np.round(recording.measured, 1))
    small = 0.3 / np.abs(recording.simulated[:, :, :2]).max()
    scaled = recording.simulated * np.reshape([small, small, 1], (3, 1, 1))
    gated[:, :, :2] = 0
    assert not silent(replace(recording, simulated=scaled), gated).any()


def test_an_axis_that_is_not_measured_is_silent_however_weak_it_is(recording):
    measured = recording.measured.copy()
    measured[:, 1, :2] = 0
    weak = recording.simulated * np.reshape([0.3, 0.3, 1], (3, 1, 1))
    found = silent(replace(recording, simulated=weak), measured)
    assert found[1, :2].all()
    assert found.sum() == found[1, :2].size
    assert silent_in_words(found, ("left", "right"))[0].startswith("x and y of pad right never change")


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_a_sensor_of_normal_force_only_is_diagnosed_by_it(recording, value):
    measured = recording.measured.copy()
    measured[:, :, :2] = value
    found = diagnosed(replace(recording, measured=measured), CAUSES)
    assert names(found) == ["axis_gain"]
    gains = {p.name: p.value for p in found.causes[0].parameters}
    assert gains["gain_x"].value == 1
    assert gains["gain_x"].low is None, "no interval is known for an unmeasured axis"
    assert gains["gain_z"].low is not None
    assert found.heldout.explained.value > 0.8
    assert any("x and y of pad0, x and y of pad1 never change" in line for line in found.symptoms.warnings)
    # NaN says that the sensor does not measure them; 0 may be a broken wire
    left = [item.what for item in found.symptoms.left_over]
    silent = "48 of 72 channels never change although the simulation does"
    assert (found.verdict, left) == (("explained", []) if np.isnan(value) else ("partly_explained", [silent]))
    assert found.streams.alive.sum() == found.streams.alive.size / 3
