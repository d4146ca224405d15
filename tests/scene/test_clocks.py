"""Clocks of robot and sensor: lags of contacts, whose they are, and streams moved to the sensor's clock."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scene.rigs import LAYOUT, press, recording, simulated_press, steps_of, with_servos

import paxisim
from paxisim import InvalidValueError, Recording
from paxisim.augment import Chain, Latency
from paxisim.cli import main
from paxisim.scene import ready
from paxisim.scene.clocks import align_clocks, find_lags

STEP = 1e-5  # m, of the encoders
INDENTER = ready.indenter(LAYOUT)


@pytest.fixture(scope="module")
def pressed():
    """What MuJoCo simulates with servos: times, forces and true positions."""
    time, streams = press(depth=1.2e-3)
    force, joints = simulated_press(with_servos(INDENTER), time, streams)
    return time, force, dict(zip(("x", "y", "depth"), joints.T, strict=True))


def logged(pressed, offsets, latency=0.0, gain=1.0):
    """Return an episode for each offset (s) by which the robot's clock is ahead; the sensor reads `gain`, late."""
    time, force, joints = pressed
    parts = []
    for number, offset in enumerate(offsets):
        noise = np.random.default_rng(number).normal(0, 0.01, force.shape)
        late = gain * Chain([Latency(latency)]).run(force, time) if latency else gain * force
        streams = {name: steps_of(np.interp(time - offset, time, values), STEP) for name, values in joints.items()}
        parts.append(recording(time, streams, measured=(late + noise).astype(np.float32)))
    return Recording.concatenate(parts)


def error(paired):
    """Return the error of the simulation as a fraction of the measured force, where it is known."""
    known = np.isfinite(paired.simulated).all(axis=(1, 2, 3, 4))
    difference, whole = (stream[known] for stream in (paired.simulated - paired.measured, paired.measured))
    return np.linalg.norm(difference) / np.linalg.norm(whole)


def test_a_latency_is_measured_and_may_be_one_of_the_clocks(pressed):
    paired = INDENTER.simulate(logged(pressed, [0, 0, 0], latency=0.06, gain=0.7))
    lags = find_lags(paired)
    assert [abs(lag.seconds - 0.06) < 3 * lag.error < 0.05 for lag in lags.lags] == [True] * 3
    assert not lags.of_clocks
    agreement = paxisim.compare_streams(paired)
    assert agreement.lags == lags
    assert not agreement.problems
    assert "in all episodes alike: latency of the sensor or an offset between its clock and" in str(agreement)


@pytest.mark.parametrize(
    ("offsets", "words"),
    [
        ([0.2, 0.2, 0.2], "no sensor measures a contact before it happens"),
        ([0.0, 0.1, -1.5], r"\d+ ms early in episode 1 and 15\d\d ms late in episode 2, but a sensor's latency does"),
    ],
)
def test_clocks_that_differ_are_a_problem_until_the_streams_are_aligned(
    pressed, offsets, words, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    logged(pressed, offsets, latency=0.02).save("press.mcap")
    INDENTER.save("press.toml")
    replay = ["replay", "press.mcap", "--scene", "press.toml", "-o"]
    assert main([*replay, "apart.mcap"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "The clocks of robot and sensor differ" in out
    assert re.search(words, out)
    assert error(Recording.load("apart.mcap")) > 0.3

    assert main([*replay, "aligned.mcap", "--align-clocks"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "The replay met what was measured" in out
    paired = Recording.load("aligned.mcap")
    expected = {str(number): 0.02 - offset for number, offset in enumerate(offsets)}
    assert paired.metadata["clock_offsets"] == pytest.approx(expected, abs=0.012)
    assert error(paired) < 0.15


def test_clocks_cannot_be_aligned_without_a_contact_in_both_streams_or_without_forces(pressed):
    apart = logged(pressed, [0.0])
    without = replace(apart, measured=np.zeros_like(apart.measured))
    with pytest.raises(InvalidValueError, match="no episode has a grasp that is both measured and simulated"):
        align_clocks(INDENTER, without)
    with pytest.raises(InvalidValueError, match="needs measured forces in newtons"):
        align_clocks(INDENTER, replace(apart, metadata={"unit": "counts"}))
