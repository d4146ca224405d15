"""Latency: exact delays at any rate, and jitter that never reorders frames; sample and hold: the last tick's force."""

import numpy as np
import pytest
from forces import both, respond, times, torch
from scipy import stats
from transform_examples import FRAME

from paxisim.augment import Chain, Latency, SampleAndHold


@both
@pytest.mark.parametrize("delay", [0.0, 0.013, 0.5, 1.0])
def test_a_ramp_is_delayed_exactly(kind, delay):
    time = times(kind, 10.0, 200)
    for capacity in (3, 4, 7, 16, 200):
        y = respond(Latency(delay, capacity=capacity), 2 * time, time)
        np.testing.assert_allclose(y, 2 * np.maximum(0, time - delay), atol=1e-11)


@both
def test_any_signal_is_moved_exactly_if_the_frames_suffice(kind):
    """A delay below zero reads ahead in a sequence, in torch as in numpy."""
    time, x = times(kind, 5.0, 200) + 0.01 * np.arange(200), np.random.default_rng(0).normal(size=200)
    for delay in (0.02, 0.13, -0.02, -0.13):
        expected = np.interp(time - delay, time, x)
        np.testing.assert_allclose(respond(Latency(delay), x, time), expected, atol=1e-11)
        if torch is not None:
            tensor = torch.as_tensor(np.tile(x.reshape(-1, 1, 1, 1, 1), (1, 1, 3, 1, 1)))
            y = Latency(torch.tensor(delay, dtype=torch.float64)).run(tensor, time)
            np.testing.assert_allclose(y[:, 0, 0, 0, 0], expected, atol=1e-11)
    ahead = Latency(-0.05)
    np.testing.assert_allclose(respond(Chain([Latency(0.05), ahead]), time, time)[20:-20], time[20:-20])
    (again,) = Chain.from_json(Chain([ahead]).to_json())
    np.testing.assert_array_equal(respond(again, x, time), respond(ahead, x, time))
    np.testing.assert_array_equal(respond(ahead, [3.0], [0.0]), [3.0])


@pytest.mark.parametrize("rate", [100, 1000])
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


def test_jitter_stays_within_its_bounds_is_not_biased_and_lets_no_frame_overtake_another():
    time = np.arange(4000) * 0.1
    late = (time - respond(Latency(0.25, 0.04, 3), time, time))[10:]
    assert 0.21 <= late.min() < 0.2105
    assert 0.2895 < late.max() <= 0.29
    assert stats.kstest(late, stats.uniform(0.21, 0.08).cdf).pvalue > 0.01
    assert abs(np.corrcoef(late[1:], late[:-1])[0, 1]) < 4 / np.sqrt(len(late))
    time = np.arange(2000) * 0.001
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
    assert np.all(np.diff(np.sort(y[5:], axis=1), axis=1) > 0), "those that share a seed"


# sample and hold


@both
@pytest.mark.parametrize(("rate", "phase"), [(7.3, 0.0), (7.3, 0.35), (0.4, 0.9), (300.0, 0.5), (91.0, 1.0)])
def test_what_is_held_is_the_force_at_the_last_tick(kind, rate, phase):
    time, x = times(kind, 10.0, 300), np.random.default_rng(0).normal(size=300)
    tick = (np.floor(time * rate - phase + 1e-9) + phase) / rate
    # a tick within the tolerance of a frame counts as being at that frame
    expected = np.interp(np.where(tick < 0, 0, tick), time, x)
    y = respond(SampleAndHold(rate, phase), x, time)
    near = np.abs((time * rate - phase) - np.round(time * rate - phase)) < 2e-4
    np.testing.assert_allclose(y[~near], expected[~near], atol=2e-3 * max(1, 300 / rate / 10))
    assert near.mean() < 0.05 or kind == "regular"


def test_a_device_slower_than_its_reader_repeats_frames_and_a_faster_one_is_less_than_a_period_late():
    time = np.arange(60) / 60
    y = respond(SampleAndHold(20.0, 1 / 3), np.arange(60.0), time)
    np.testing.assert_allclose(y, np.maximum(0, (np.arange(60) - 1) // 3 * 3 + 1), atol=1e-9)
    time = np.arange(2000) / 200
    y = respond(SampleAndHold(91.0), time, time)
    assert len(np.unique(y)) == pytest.approx(91 * 10, abs=1)
    assert set(np.diff(np.flatnonzero(np.diff(y, prepend=-1)))) == {2, 3}
    for rate in (91.0, 1234.5):
        late = time - respond(SampleAndHold(rate), time, time)
        assert np.all((late >= -1e-12) & (late < 1 / rate))


@pytest.mark.parametrize("step", ["numbers", "float32"])
def test_a_device_at_the_rate_of_the_frames_delays_none(step):
    """Rounding of dt, in either precision, does not make ticks slip."""
    for rate in (30.0, 91.0, 100.0):
        hold, dt = SampleAndHold(rate), 1 / rate if step == "numbers" else np.float32(1 / rate)
        x = np.zeros((1, 3, 1, 1), np.float32)
        state = hold.initial_state(x)
        for i in range(2000):
            y, state = hold.step(x + i % 7, state, dt if i else 0.0)
            assert abs(y[0, 0, 0, 0] - i % 7) < 1e-2


@pytest.mark.parametrize("delay", [0.0, 0.0031, 0.0117, 0.0233])
def test_a_recording_with_equal_times_is_delayed_at_once_as_frame_by_frame(delay):
    # a server delivers two frames at once, and the clock of a network is uneven
    steps = np.tile([0.01, 0.02, 0.0, 0.011, 0.009], 40)
    time, x = np.cumsum(steps), np.random.default_rng(3).normal(size=(200, *FRAME))
    late = Latency(delay, capacity=40)
    assert late.sweep(x, np.diff(time, prepend=time[0])) is not None
    state, frames = late.initial_state(x[0]), []
    for frame, dt in zip(x, [0.0, *np.diff(time)], strict=True):
        read, state = late.step(frame, state, dt)
        frames.append(read)
    np.testing.assert_allclose(late.run(x, time), frames, atol=1e-9)
