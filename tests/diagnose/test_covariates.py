"""Interference is found from recorded covariates of any name and number, channel by channel."""

from dataclasses import replace

import numpy as np
import pytest
from recorded import diagnosed, names, plain

from paxisim.diagnose.data.prepare import prepare

NEAR = ("axis_gain", "creep", "offset", "drift", "interference")
SEED = 7


def moving(name="joints", count=16, seed=SEED):
    """Return a recording with a hand's joint angles (rad), which follow a few common motions regardless of contact."""
    recording = plain(seed=seed, more=("gripper",) * 2)
    rng = np.random.default_rng(seed)
    time = recording.time[:, None]
    ways = np.sin(2 * np.pi * rng.uniform(0.05, 0.3, 3) * time + rng.uniform(0, 6, 3))
    joints = ways @ rng.normal(0, 0.4, (3, count)) + rng.normal(0, 0.002, (len(time), count))
    return replace(recording, covariates={**recording.covariates, name: joints}), ways, rng


def read_field(recording, ways, rng, size):
    """Return the recording with linear and quadratic terms of `ways` added, with random amounts per channel."""
    terms = np.concatenate([ways, 0.3 * ways**2], axis=1)
    amounts = size * rng.normal(size=(terms.shape[1], *recording.simulated.shape[1:]))
    measured = recording.measured + np.tensordot(terms, amounts, 1)
    return replace(recording, measured=measured.astype(np.float32))


def test_a_field_follows_sixteen_joints():
    name = "finger/pose"
    recording = read_field(*moving(name), 0.1)
    found = diagnosed(recording, NEAR)
    assert names(found) == ["interference"]
    assert found.heldout.explained.value > 0.9
    assert f"A linear function of {name}[" in found.causes[0].evidence
    # the model takes the covariates as recorded
    given = (recording.simulated, recording.time, recording.covariates)
    left = recording.measured - found.model.run(*given)
    assert np.mean(left**2) < 0.2 * np.mean((recording.measured - recording.simulated) ** 2)


@pytest.mark.parametrize("form", ["one pad", "pads", "split"])
def test_the_total_that_the_sensor_reports_is_no_covariate(form):
    recording, _, _ = moving()
    total = recording.measured.sum(axis=(3, 4)).astype(float)  # (T, pads, 3), as a board of PaXini sends it
    total += 0.1 * np.sin(recording.time)[:, None, None]  # it varies without contact
    covariates = {
        "one pad": {"resultant": total[:, 0]},
        "pads": {"resultant": total},
        "split": {f"resultant[{number}]": column for number, column in enumerate(total.reshape(len(total), -1).T)},
    }[form]
    kept, warnings = prepare(replace(recording, covariates=covariates))
    assert kept.covariates == {}
    assert not any("resultant" in warning for warning in warnings)
    kept, _ = prepare(
        replace(recording, covariates=covariates | {"temperature": recording.time, "current": total[:, 0]})
    )
    assert list(kept.covariates) == ["temperature", "current[0]", "current[1]", "current[2]"]


def test_a_total_that_varies_without_contact_makes_no_interference_testable():
    recording, ways, rng = moving()
    recording = read_field(recording, ways, rng, 0.1)
    total = recording.measured.sum(axis=(3, 4)).astype(float)
    found = diagnosed(replace(recording, covariates={"resultant": total}), NEAR)
    assert "interference" in found.not_testable
    assert not any("resultant" in item.what for item in found.symptoms.left_over)
    assert list(found.streams.covariates) == []


def test_joints_that_no_field_follows_give_no_cause_and_a_load_is_not_told_from_the_force():
    recording, _, _ = moving()
    found = diagnosed(recording, NEAR)
    assert names(found) == []
    assert "interference" not in found.not_testable
    load = recording.simulated[:, :, 2].sum(axis=(1, 2, 3)).astype(float)
    found = diagnosed(replace(recording, covariates={"motor_current": load}), NEAR)
    assert "varies without contact" in found.not_testable["interference"]
