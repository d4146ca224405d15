"""Interference is found from recorded covariates of any name and number, channel by channel."""

from dataclasses import replace

import numpy as np
from recorded import diagnosed, names, plain

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


def test_joints_that_no_field_follows_give_no_cause_and_a_load_is_not_told_from_the_force():
    recording, _, _ = moving()
    found = diagnosed(recording, NEAR)
    assert names(found) == []
    assert "interference" not in found.not_testable
    load = recording.simulated[:, :, 2].sum(axis=(1, 2, 3)).astype(float)
    found = diagnosed(replace(recording, covariates={"motor_current": load}), NEAR)
    assert "varies without contact" in found.not_testable["interference"]
