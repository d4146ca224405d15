"""Sample and hold: the output is the force at the device's last tick."""

import numpy as np
import pytest
from responses import both, respond, times

from paxisim.augment.sample_and_hold import SampleAndHold


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


def test_a_slow_device_repeats_its_frames():
    time = np.arange(60) / 60
    y = respond(SampleAndHold(20.0), np.arange(60.0), time)
    np.testing.assert_allclose(y, np.arange(60) // 3 * 3, atol=1e-9)
    y = respond(SampleAndHold(20.0, 1 / 3), np.arange(60.0), time)
    np.testing.assert_allclose(y, np.maximum(0, (np.arange(60) - 1) // 3 * 3 + 1), atol=1e-9)


def test_a_device_at_an_odd_rate_gives_as_many_frames_as_it_should():
    time = np.arange(2000) / 200
    y = respond(SampleAndHold(91.0), time, time)
    assert len(np.unique(y)) == pytest.approx(91 * 10, abs=1)
    runs = np.diff(np.flatnonzero(np.concatenate([[True], np.diff(y) != 0])))
    assert set(runs) == {2, 3}
    assert np.all((time - y >= -1e-12) & (time - y < 1 / 91))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("rate", [100.0, 30.0, 91.0, 176.0])
def test_a_device_at_the_rate_of_the_frames_delays_none(dtype, rate):
    x = np.random.default_rng(0).normal(size=5000)
    y = respond(SampleAndHold(rate), x, np.arange(5000) / rate, dtype)
    np.testing.assert_allclose(y, x, atol=2e-3)


@pytest.mark.parametrize("step", [0.01, np.float32(0.01)])
def test_rounding_in_dt_does_not_make_ticks_slip(step):
    hold = SampleAndHold(100.0)
    x = np.zeros((1, 3, 1, 1), np.float32)
    state = hold.initial_state(x)
    for i in range(5000):
        y, state = hold.step(x + i % 7, state, step if i else 0.0)
        assert abs(y[0, 0, 0, 0] - i % 7) < 1e-2


def test_a_fast_device_is_less_than_a_period_late():
    time = times("regular", 5.0, 300)
    y = respond(SampleAndHold(1234.5), time, time)
    assert np.all((time - y > -1e-12) & (time - y < 1 / 1234.5))
