"""Curves through frames: exact for cubics, and accurate for delays and filters as short as the frame interval."""

import numpy as np
import pytest

from paxisim import augment
from paxisim.diagnose.data.noise import Noise
from paxisim.diagnose.data.pieces import FINE_STEP, curve_through
from paxisim.diagnose.data.problem import Problem

PAUSE = np.concatenate([0.05 * np.arange(10), 30 + 0.05 * np.arange(10)])


def jittered(frames, interval, seed=3):
    """Return frame times about `interval` s apart, each off by up to a tenth of it."""
    rng = np.random.default_rng(seed)
    return interval * (np.arange(frames) + rng.uniform(-0.1, 0.1, frames))


def test_a_cubic_is_drawn_as_it_is_and_the_frames_are_kept():
    for interval in (0.02, 0.05):
        time = jittered(40, interval)
        curve = curve_through(time)
        np.testing.assert_allclose(curve.time[curve.own], time, rtol=0, atol=1e-12)
        assert 0 < np.diff(curve.time).min() <= np.diff(curve.time).max() <= 1.51 * FINE_STEP
        drawn = np.einsum("mn,mn->m", curve.weights, (1 - time + 3 * time**2 + time**3)[curve.nodes])
        np.testing.assert_allclose(drawn, 1 - curve.time + 3 * curve.time**2 + curve.time**3, atol=1e-9)


def test_nothing_is_put_between_frames_that_are_close_or_far_apart_or_few_or_out_of_order():
    twice = np.array([0.0, 0.05, 0.05, 0.1, 0.15])
    for time in (0.01 * np.arange(50), 0.5 * np.arange(50), twice, 0.05 * np.arange(3), np.array([1.0])):
        curve = curve_through(time)
        np.testing.assert_array_equal(curve.time, time)
        np.testing.assert_array_equal(curve.nodes, np.arange(len(time))[:, None])
        np.testing.assert_array_equal(curve.weights, 1)
    inside = curve_through(PAUSE).time
    assert not np.any((inside > 0.451) & (inside < 29.999)), "nor into a pause"


@pytest.mark.parametrize(
    ("transform", "gain", "lag"),
    [
        (augment.Latency(0.025), 1.0, 0.025),
        (augment.LowPass(0.025), 1 / np.hypot(1, 0.1 * np.pi), np.arctan(0.1 * np.pi) / (4 * np.pi)),
        (augment.Chain([augment.LowPass(0.01), augment.Latency(0.02)]), 1 / np.hypot(1, 0.04 * np.pi), 0.0299),
    ],
)
def test_a_fast_motion_meets_short_delays_and_filters_as_it_did_in_truth(transform, gain, lag):
    time = jittered(200, 0.05)

    def swing(t):
        return np.sin(2 * np.pi * 2 * t)[:, None, None, None, None] * np.ones((1, 1, 3, 1, 1))

    x = swing(time)
    alive = np.ones((1, 3, 1, 1), dtype=bool)
    problem = Problem(x, x, time, {}, (slice(0, 200),), Noise(np.full_like(x, 0.01), 0.0, 0.01), alive, 1.0)
    expected = gain * swing(time - lag)
    settled = slice(20, -5)
    assert np.abs(problem.run(transform, x) - expected)[settled].max() < 0.015
    straight = transform.run(x, time, {})
    assert np.abs(straight - expected)[settled].max() > 0.03, "linear interpolation between frames should cut the peaks"
