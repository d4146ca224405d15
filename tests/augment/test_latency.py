"""Latency: exact positive and negative delays at any rate, and jitter that never reorders frames."""

import numpy as np
import pytest
from optional import needs_torch, torch
from responses import both, respond, times
from scipy import stats
from transform_examples import FRAME

from paxisim.augment.chain import Chain
from paxisim.augment.latency import Latency
from paxisim.augment.low_pass import LowPass
from paxisim.errors import InvalidValueError


@both
@pytest.mark.parametrize("delay", [0.0, 0.013, 0.5, 1.0])
def test_a_ramp_is_delayed_exactly(kind, delay):
    time = times(kind, 10.0, 200)
    for capacity in (3, 4, 7, 16, 200):
        y = respond(Latency(delay, capacity=capacity), 2 * time, time)
        np.testing.assert_allclose(y, 2 * np.maximum(0, time - delay), atol=1e-11)


@both
@pytest.mark.parametrize("delay", [0.02, 0.05, 0.13])
def test_any_signal_is_delayed_exactly_if_the_frames_suffice(kind, delay):
    rng = np.random.default_rng(0)
    time, x = times(kind, 5.0, 200) + 0.01 * np.arange(200), rng.normal(size=200)
    y = respond(Latency(delay, capacity=16), x, time)
    np.testing.assert_allclose(y, np.interp(time - delay, time, x), atol=1e-11)


@both
@pytest.mark.parametrize("delay", [-0.02, -0.13])
def test_a_delay_below_zero_reads_ahead_in_a_sequence(kind, delay):
    rng = np.random.default_rng(0)
    time, x = times(kind, 5.0, 200), rng.normal(size=200)
    y = respond(Latency(delay), x, time)
    np.testing.assert_allclose(y, np.interp(time - delay, time, x), atol=1e-11)
    (again,) = Chain.from_json(Chain([Latency(delay)]).to_json())
    np.testing.assert_array_equal(respond(again, x, time), y)
    np.testing.assert_allclose(respond(Chain([Latency(-delay), Latency(delay)]), time, time)[20:-20], time[20:-20])
    np.testing.assert_array_equal(respond(Latency(delay), [3.0], [0.0]), [3.0])


def test_no_stream_reads_ahead():
    frame = np.zeros(FRAME)
    with pytest.raises(InvalidValueError, match=r"Latency: with a delay of -0\.04 s .* delay the simulated stream"):
        Latency(-0.04).initial_state(frame)
    with pytest.raises(InvalidValueError, match="the simulated stream"):
        Chain([LowPass(0.1), Latency(np.array(-0.04))]).initial_state(frame)


@pytest.mark.parametrize("wrong", [{"delay": np.array([-0.01, 0.02])}, {"delay": -0.02, "jitter": 0.01}])
def test_a_delay_below_zero_is_one_number_without_jitter(wrong):
    with pytest.raises(InvalidValueError, match="Latency: a delay below 0 must be one number, without jitter"):
        Latency(**wrong)


@needs_torch
def test_torch_reads_ahead_as_numpy_does():
    time, x = times("irregular", 5.0, 50), np.random.default_rng(0).normal(size=(50, *FRAME))
    ours = Latency(torch.tensor(-0.1, dtype=torch.float64)).run(torch.as_tensor(x), time)
    np.testing.assert_allclose(ours.numpy(), Latency(-0.1).run(x, time), atol=1e-12)


@pytest.mark.parametrize("frames", [1, 2, 5, 14])
def test_a_delay_of_whole_frames_is_a_shift(frames):
    x = np.random.default_rng(0).normal(size=100)
    time = np.arange(100) * 0.02
    for dtype in (np.float64, np.float32):
        y = respond(Latency(frames * 0.02, capacity=16), x, time, dtype)
        np.testing.assert_allclose(y[frames:], x[:-frames], atol=1e-12 if dtype is np.float64 else 5e-5)


@pytest.mark.parametrize("rate", [100, 200, 1000, 3000])
def test_frames_too_fast_for_the_buffer_are_thinned_but_the_delay_is_right(rate):
    time = np.arange(int(2 * rate)) / rate
    x, delay, capacity = np.sin(2 * np.pi * time), 0.1, 16
    y = respond(Latency(delay, capacity=capacity), x, time)
    expected = np.interp(time - delay, time, x)
    spacing = max(1 / rate, 2 * delay / (capacity - 2))
    assert np.abs(y - expected).max() <= (2 * np.pi * spacing) ** 2 / 8 * 1.01
    # the delay itself is unbiased: there is no first-order error
    assert abs(np.mean((y - expected)[rate // 2 :] * np.cos(2 * np.pi * (time - delay))[rate // 2 :])) < 1e-4


def test_frames_at_one_time_are_a_jump():
    y = respond(Latency(0.5, capacity=8), [0, 0, 1, 1, 1, 1], [0, 1, 1, 1.4, 1.6, 3])
    np.testing.assert_allclose(y, [0, 0, 0, 0, 1, 1], atol=1e-12)


def test_jitter_stays_within_its_bounds_and_is_not_biased():
    time = np.arange(4000) * 0.1
    late = time - respond(Latency(0.25, 0.04, 3), time, time)
    late = late[10:]
    assert 0.21 <= late.min() < 0.2105
    assert 0.2895 < late.max() <= 0.29
    assert stats.kstest(late, stats.uniform(0.21, 0.08).cdf).pvalue > 0.01
    assert abs(np.corrcoef(late[1:], late[:-1])[0, 1]) < 4 / np.sqrt(len(late))


def test_frames_do_not_overtake_one_another():
    time = np.arange(3000) * 0.001
    arrived = respond(Latency(0.02, 0.02, 3, capacity=100), time, time)
    assert np.all(np.diff(arrived) >= -1e-12)
    assert np.all(arrived <= time + 1e-12)
    assert np.all(arrived[50:] >= time[50:] - 0.04 - 1e-12)


def test_all_taxels_are_late_together_and_environments_each_by_itself():
    time = np.arange(50) * 0.1
    x = np.broadcast_to(time.reshape(-1, 1, 1, 1, 1, 1), (50, 4, *FRAME))
    y = Latency(0.3, 0.05, np.array([1, 2, 1, 3])).run(x, time)
    assert np.all(y == y[..., :1, :1, :1, :1])
    y = y[:, :, 0, 0, 0, 0]
    np.testing.assert_array_equal(y[:, 0], y[:, 2])
    assert np.all(y[5:, 0] != y[5:, 1])
    y = Latency(0.3, 0.05, 1).run(x, time)[:, :, 0, 0, 0, 0]
    assert np.all(np.diff(np.sort(y[5:], axis=1), axis=1) > 0)


@pytest.mark.parametrize("capacity", [2, 0, -1, 3.5, "16"])
def test_a_capacity_that_cannot_be_is_refused(capacity):
    with pytest.raises(InvalidValueError, match="Latency: capacity must be a whole number of at least 3, got"):
        Latency(capacity=capacity)
