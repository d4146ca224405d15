"""Symptoms: an injected error is located correctly."""

import numpy as np
import pytest

from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.explain.symptoms import phases_of, symptoms
from paxisim.recording import Recording

RATE = 50.0


def presses(**wrong):
    """Return four episodes on two 3x3 pads: free, loading, holding, unloading, then sliding across."""
    time = np.arange(0, 8, 1 / RATE)
    force = np.interp(time, [0, 1, 2, 4, 5, 6, 6.5, 8], [0, 0, 4, 4, 0, 0, 3, 3])
    middle = np.interp(time, [0, 6.5, 8], [1, 1, 2.5])
    cols = np.arange(3)
    spread = np.exp(-((cols - middle[:, None]) ** 2))[:, None, None, None, :] * np.ones((1, 2, 3, 3, 1))
    share = spread / spread.sum(axis=-1, keepdims=True)
    one = force[:, None, None, None, None] * share * np.array([0.1, 0.1, 1.0])[:, None, None]
    simulated = np.concatenate([one] * 4)
    rng = np.random.default_rng(0)
    measured = simulated + 0.01 * rng.standard_normal(simulated.shape)
    for (pad, axis), amount in wrong.get("gain", {}).items():
        measured[:, pad, axis] *= 1 + amount
    episode = np.repeat(np.arange(4), len(time))
    at = np.concatenate([time + 20 * i for i in range(4)])
    opening = 0.02 + 0.01 * np.sin(at)
    measured += wrong.get("field", 0.0) * (opening - 0.02)[:, None, None, None, None]
    recording = Recording(at, measured, simulated, {"gripper_opening": opening}, episode)
    return problem_of(recording)


def test_phases_follow_the_motion():
    phase = phases_of(presses())[: int(8 * RATE), 0]
    at = {second: phase[int(second * RATE)] for second in (0.5, 1.5, 3.0, 4.5, 5.5, 7.2)}
    assert at == {0.5: "free", 1.5: "loading", 3.0: "holding", 4.5: "unloading", 5.5: "free", 7.2: "sliding"}


def test_the_error_is_on_the_pad_and_axis_it_was_put_on():
    given = presses(gain={(1, 2): 0.5})
    better = given.simulated.copy()
    better[:, 1, 2] *= 1.5
    found = symptoms(given, given.simulated, better, ("left", "right"))
    share = {place.where: (place.before, place.after) for place in (*found.pads, *found.axes)}
    assert share["right"][0] > 0.9 > 0.1 > share["left"][0]
    assert share["z"][0] > 0.9
    assert share["z"][1] < 0.1
    assert all(place.where.startswith("right") for place in found.taxels[:3])
    for places in (found.pads, found.axes, found.phases, found.frequencies):
        assert sum(place.before for place in places) == pytest.approx(1, abs=0.02)


def test_the_error_goes_with_its_covariate():
    given = presses(field=20.0)
    found = symptoms(given, given.simulated, given.simulated, ("left", "right"))
    share = {place.where: place.before for place in found.covariates}
    assert share["gripper_opening, at rest"] > 0.9
