"""Curves through frames: exact for cubics, and accurate for delays and filters as short as the frame interval."""

import numpy as np
import pytest

from paxisim import augment
from paxisim.diagnose.between import FINE_STEP, curve_through
from paxisim.diagnose.problem import Problem


def jittered(frames, interval, seed=3):
    """Return frame times about `interval` s apart, each off by up to a tenth of it."""
    rng = np.random.default_rng(seed)
    return interval * (np.arange(frames) + rng.uniform(-0.1, 0.1, frames))


@pytest.mark.parametrize("interval", [0.02, 0.033, 0.05])
def test_a_cubic_is_drawn_as_it_is_and_the_frames_are_kept(interval):
    time = jittered(40, interval)
    curve = curve_through(time)
    np.testing.assert_allclose(curve.time[curve.own], time, rtol=0, atol=1e-12)
    assert np.all(np.diff(curve.time) > 0)
    assert np.diff(curve.time).max() <= 1.51 * FINE_STEP

    def cubic(t):
        return np.stack([1 - t + 3 * t**2, t**3 - t], axis=1)

    drawn = np.einsum("mn,mnk->mk", curve.weights, cubic(time)[curve.nodes])
    np.testing.assert_allclose(drawn, cubic(curve.time), atol=1e-9)
    np.testing.assert_allclose(curve.weights.sum(axis=1), 1, atol=1e-12)


@pytest.mark.parametrize(
    "time",
    [
        0.01 * np.arange(50),
        0.5 * np.arange(50),
        np.array([0.0, 0.05, 0.05, 0.1, 0.15]),
        0.05 * np.arange(3),
        np.array([1.0]),
    ],
)
def test_nothing_is_put_between_frames_that_are_close_or_far_apart_or_few_or_out_of_order(time):
    curve = curve_through(time)
    np.testing.assert_array_equal(curve.time, time)
    np.testing.assert_array_equal(curve.nodes, np.arange(len(time))[:, None])
    np.testing.assert_array_equal(curve.weights, 1)


def test_nothing_is_put_into_a_pause():
    pause = np.concatenate([0.05 * np.arange(10), 30 + 0.05 * np.arange(10)])
    curve = curve_through(pause)
    assert not np.any((curve.time > 0.451) & (curve.time < 29.999))


@pytest.mark.parametrize(
    ("transform", "gain", "lag"),
    [
        (augment.Latency(0.025), 1.0, 0.025),
        (augment.Latency(0.012), 1.0, 0.012),
        (
            augment.LowPass(0.025),
            1 / np.hypot(1, 2 * np.pi * 2 * 0.025),
            np.arctan(2 * np.pi * 2 * 0.025) / (4 * np.pi),
        ),
        (augment.Chain([augment.LowPass(0.01), augment.Latency(0.02)]), 1 / np.hypot(1, 0.04 * np.pi), 0.0299),
    ],
)
def test_a_fast_motion_meets_short_delays_and_filters_as_it_did_in_truth(transform, gain, lag):
    time = jittered(200, 0.05)

    def swing(t):
        return np.sin(2 * np.pi * 2 * t)[:, None, None, None, None] * np.ones((1, 1, 3, 1, 1))

    x = swing(time)
    true = np.ones((1, 3, 1, 1), dtype=bool)
    problem = Problem(x, x, time, {}, (slice(0, 200),), np.full_like(x, 0.01), 1.0, true, 0.0, 0.01)
    expected = gain * swing(time - lag)
    settled = slice(20, -5)
    assert np.abs(problem.run(transform, x) - expected)[settled].max() < 0.015
    straight = transform.run(x, time, {})
    assert np.abs(straight - expected)[settled].max() > 0.03, "linear interpolation between frames should cut the peaks"
