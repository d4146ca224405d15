"""The physics of the transforms with memory, against analytic responses; `test_contract.py` holds what all must do."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from paxisim.augment.chain import Chain
from paxisim.augment.creep import Creep
from paxisim.augment.drift import Drift
from paxisim.augment.hysteresis import Hysteresis
from paxisim.augment.latency import Latency
from paxisim.augment.low_pass import LowPass
from paxisim.augment.noise import RandomWalk, WhiteNoise
from paxisim.augment.parameter import parameters
from paxisim.augment.sample_and_hold import SampleAndHold
from paxisim.augment.temperature import TemperatureDrift
from paxisim.errors import InvalidValueError

try:
    import torch
except ImportError:
    torch = None

needs_torch = pytest.mark.skipif(torch is None, reason="needs torch")

FRAME = (2, 3, 6, 5)


def everywhere(value):
    """A parameter with one value for each element."""
    return np.full((1, 1, 1, 1), value)


DETERMINISTIC = [
    LowPass(0.05),
    Creep((0.1, -0.05, 0.2), (0.02, 0.3, 5.0)),
    Hysteresis((0.2, 0.1, 0.3), (0.1, 0.5, 1.0)),
    Latency(0.037, capacity=12),
    SampleAndHold(33.0, 0.4),
    Drift(everywhere(0.3), everywhere(0.5), 0.4, 0.1),
]
ALL = [*DETERMINISTIC, Latency(0.02, 0.004, 5), WhiteNoise(everywhere(0.2), 5), RandomWalk(everywhere(0.5), 5)]
NAMES = [transform.name for transform in DETERMINISTIC]

deterministic = pytest.mark.parametrize("transform", DETERMINISTIC, ids=NAMES)
every = pytest.mark.parametrize("transform", ALL, ids=[*NAMES, "JitteryLatency", "WhiteNoise", "RandomWalk"])


def respond(transform, values, time, dtype=np.float64):
    """The readings of one element that is given `values`."""
    x = np.broadcast_to(np.reshape(values, (-1, 1, 1, 1, 1)), (len(time), 1, 3, 1, 1)).astype(dtype)
    return transform.run(x, time)[:, 0, 0, 0, 0]


def times(kind, end, count=400, seed=0):
    """From 0 to `end`, regular or not."""
    if kind == "regular":
        return np.linspace(0, end, count)
    gaps = np.random.default_rng(seed).exponential(size=count - 1) ** 2
    return np.concatenate([[0], np.cumsum(gaps) / gaps.sum() * end])


both = pytest.mark.parametrize("kind", ["regular", "irregular"])


def with_jump(time):
    """A step from 0 to 1 at time 0: two frames at once."""
    return np.concatenate([[0], np.ones(len(time))]), np.concatenate([[0], time])


# the tables in the docstrings


@pytest.mark.parametrize(
    ("transform", "x", "y"),
    [
        (Creep((0.2,), (1.0,)), [0, 1, 1, 1], [0, 1.074, 1.153, 1.183]),
        (Hysteresis((0.5,), (0.2,)), [0, 1, 0.8, 0], [0, 0.9, 0.8, 0.1]),
        (Latency(1.5), [0, 1, 4, 9], [0, 0, 0.5, 2.5]),
        (SampleAndHold(0.4), [0, 1, 4, 9], [0, 0, 0, 6.5]),
        (Drift(everywhere(0.01), everywhere(0.1), 1.0), [0, 0, 0, 0], [0, 0.0732, 0.1065, 0.1250]),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_worked_example(transform, x, y):
    decimals = 4 if transform.name == "Drift" else 3
    np.testing.assert_allclose(respond(transform, x, np.arange(4.0)), y, rtol=0, atol=0.51 * 10.0**-decimals)


# low-pass and creep


@both
def test_step_response(kind):
    time = times(kind, 10.0)
    x, t = with_jump(time)
    np.testing.assert_allclose(respond(LowPass(0.7), x, t)[1:], 1 - np.exp(-time / 0.7), atol=1e-12)
    amplitude, tau = np.array([0.1, 0.2, -0.05]), np.array([0.05, 1.5, 40.0])
    expected = 1 + (amplitude * -np.expm1(-time[:, None] / tau)).sum(1)
    np.testing.assert_allclose(respond(Creep(amplitude, tau), x, t)[1:], expected, atol=1e-12)


@both
def test_ramp_response(kind):
    time = times(kind, 10.0)
    amplitude, tau = np.array([0.1, 0.2, -0.05]), np.array([0.05, 1.5, 40.0])
    modes = time[:, None] + tau * np.expm1(-time[:, None] / tau)
    np.testing.assert_allclose(respond(LowPass(1.5), time, time), modes[:, 1], atol=1e-12)
    np.testing.assert_allclose(respond(Creep(amplitude, tau), time, time), time + modes @ amplitude, atol=1e-11)


def test_sine_response():
    """What is left after the start is the transfer function's; straight lines cut a sine by (w dt)^2 / 12."""
    time, omega = np.linspace(0, 40, 8001), 3.0
    phasor = np.exp(1j * omega * time)
    tau, amplitude = np.array([0.1, 0.5]), np.array([0.3, 0.1])
    for transform, gain in (
        (LowPass(0.5), 1 / (1 + 0.5j * omega)),
        (Creep(amplitude, tau), 1 + (amplitude / (1 + 1j * omega * tau)).sum()),
    ):
        y = respond(transform, np.sin(omega * time), time)
        np.testing.assert_allclose(y[2000:], (gain * phasor).imag[2000:], atol=1e-4)


def test_creep_that_is_over_and_gains():
    creep = Creep((0.1, 0.2), (0.5, 5.0))
    x = np.random.default_rng(0).normal(size=FRAME)
    y, state = creep.step(x, creep.initial_state(x), 0.0)
    np.testing.assert_allclose(y, 1.3 * x, rtol=1e-12)
    y, _ = creep.step(x, state, 1e3)
    np.testing.assert_allclose(y, 1.3 * x, rtol=1e-12)
    y, _ = creep.step(x + 1, state, 0.0)
    np.testing.assert_allclose(y, 1.3 * x + 1, rtol=1e-12)


def test_creep_without_time_constant_is_a_gain():
    x = np.random.default_rng(0).normal(size=(20, *FRAME))
    y = Creep((0.2,), (0.0,)).run(x, np.arange(20) * 0.1)
    np.testing.assert_allclose(y, 1.2 * x, rtol=1e-12)


def test_creep_is_a_sum_of_low_passes():
    x, time = np.random.default_rng(0).normal(size=(50, *FRAME)), times("irregular", 5.0, 50)
    y = Creep((0.1, 0.3), (0.2, 1.0)).run(x, time)
    np.testing.assert_allclose(y, x + 0.1 * LowPass(0.2).run(x, time) + 0.3 * LowPass(1.0).run(x, time), atol=1e-12)


def test_slow_creep_does_not_stall_in_float32():
    """A minute's creep at 100 Hz: an increment is far below the last digit of the state."""
    time = np.arange(12_000) * 0.01
    x, t = with_jump(time)
    y = respond(Creep((0.25,), (60.0,)), 20 * x, t, np.float32)[1:]
    np.testing.assert_allclose(y, 20 * (1 + 0.25 * -np.expm1(-time / 60)), rtol=1e-4)


def test_one_of_the_parameters_may_serve_all_modes():
    x, time = np.random.default_rng(0).normal(size=(9, *FRAME)), times("irregular", 1.0, 9)
    for short, long in (
        (Creep((0.1,), (0.1, 0.2)), Creep((0.1, 0.1), (0.1, 0.2))),
        (Creep((0.1, 0.2), (0.1,)), Creep((0.1, 0.2), (0.1, 0.1))),
        (Hysteresis((0.1,), (0.1, 0.2)), Hysteresis((0.1, 0.1), (0.1, 0.2))),
        (Hysteresis((0.1, 0.2), (0.1,)), Hysteresis((0.1, 0.2), (0.1, 0.1))),
    ):
        np.testing.assert_array_equal(short.run(x, time), long.run(x, time))


@pytest.mark.parametrize(("kind", "names"), [(Creep, ("amplitude", "tau")), (Hysteresis, ("weight", "radius"))])
def test_modes_that_do_not_agree_are_refused(kind, names):
    with pytest.raises(InvalidValueError, match=rf"^{kind.__name__}: .* got 2 in {names[0]}, 3 in {names[1]}"):
        kind((0.1, 0.1), (0.1, 0.2, 0.3))
    with pytest.raises(InvalidValueError, match=f"^{kind.__name__}: .* 0 in {names[0]}"):
        kind((), (0.1,))
    with pytest.raises(InvalidValueError, match=rf"^{kind.__name__}: {names[0]} must have shape \(..., modes\)"):
        kind(0.1, (0.1,))


# hysteresis


def cycle(low, high, points=50):
    up = np.linspace(low, high, points)
    return np.concatenate([up, up[::-1][1:]])


def test_virgin_curve():
    x = np.linspace(0, 3, 50)
    plays = np.maximum(0, x[:, None] - [0.5, 1.0])
    expected = x + (plays - x[:, None]) @ [0.2, 0.3]
    hysteresis = Hysteresis((0.2, 0.3), (0.5, 1.0))
    np.testing.assert_allclose(respond(hysteresis, x, x), expected, atol=1e-14)
    np.testing.assert_allclose(respond(hysteresis, -x, x), -expected, atol=1e-14)
    # a stream that begins under load has come there the same way
    for load, reading in zip(x, expected, strict=True):
        np.testing.assert_allclose(respond(hysteresis, [load], [0.0]), reading, atol=1e-14)


def test_the_loop_closes_and_has_the_area_it_should():
    weight, radius, swing = np.array([0.1, 0.2, 0.15]), np.array([0.3, 0.8, 3.0]), 2.0
    x = np.concatenate([cycle(0, swing), cycle(-swing, swing), cycle(-swing, swing)])
    y = respond(Hysteresis(weight, radius), x, np.arange(len(x)))
    first, second = slice(99, 198), slice(198, 297)
    np.testing.assert_allclose(y[second], y[first], atol=1e-14)
    assert y[297 - 1] == pytest.approx(y[198])
    x, y = x[second], y[second]
    area = np.sum((y[1:] + y[:-1]) / 2 * np.diff(x))
    # points at 50 places cut the corners of the loop a little
    assert -area == pytest.approx((weight * 4 * radius * np.maximum(0, swing - radius)).sum(), rel=5e-3)
    width = y[49:][::-1] - y[:50]
    assert np.all(width > -1e-12)
    assert width.max() == pytest.approx(2 * (0.1 * 0.3 + 0.2 * 0.8))


def test_an_inner_loop_is_wiped_out():
    hysteresis = Hysteresis((0.1, 0.2), (0.2, 0.6))
    straight = np.array([0, 2.0, 3.0])
    detour = np.array([0, 2.0, 1.2, 1.7, 1.2, 2.0, 3.0])
    x = respond(hysteresis, straight, np.arange(3)), respond(hysteresis, detour, np.arange(7))
    np.testing.assert_allclose(x[0][[1, 2]], x[1][[5, 6]], atol=1e-14)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(st.lists(st.floats(-5, 5), min_size=2, max_size=8), st.integers(0, 2**31))
def test_only_the_turning_points_count(turns, seed):
    hysteresis = Hysteresis((0.1, 0.3, 0.2), (0.1, 0.7, 2.0))
    expected = respond(hysteresis, turns, np.arange(len(turns)))
    rng = np.random.default_rng(seed)
    path, at = [], []
    for a, b in itertools.pairwise(turns):
        at.append(len(path))
        path += [a, *(a + (b - a) * np.sort(rng.random(5)))]
    at.append(len(path))
    path.append(turns[-1])
    y = respond(hysteresis, path, np.cumsum(rng.exponential(size=len(path)) ** 3))
    np.testing.assert_allclose(y[at], expected, atol=1e-12)


def test_small_and_large_swings():
    hysteresis = Hysteresis((0.1, 0.3), (0.5, 1.0))
    small = np.array([0, 0.2, -0.3, 0.4])
    np.testing.assert_allclose(respond(hysteresis, small, np.arange(4)), 0.6 * small, atol=1e-14)
    assert respond(hysteresis, [1e6], [0])[0] == pytest.approx(1e6 - 0.35)


def test_weights_that_sum_to_more_than_one_are_refused():
    Hysteresis((0.5, 0.3, 0.2), (1.0,))
    for weight, radius in (((0.7, 0.4), (1.0, 1.0)), ((0.4,), (1.0, 2.0, 3.0))):
        with pytest.raises(InvalidValueError, match=r"^Hysteresis: the sum of weight must lie in \[0, 1\]"):
            Hysteresis(weight, radius)
        if torch is not None:
            with pytest.raises(InvalidValueError, match=r"^Hysteresis: the sum of weight must lie in \[0, 1\]"):
                Hysteresis(torch.tensor(weight), torch.tensor(radius))


# latency


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
    # the delay itself is not off: no error of the first order
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


# sample and hold


@both
@pytest.mark.parametrize(("rate", "phase"), [(7.3, 0.0), (7.3, 0.35), (0.4, 0.9), (300.0, 0.5), (91.0, 1.0)])
def test_what_is_held_is_the_force_at_the_last_tick(kind, rate, phase):
    time, x = times(kind, 10.0, 300), np.random.default_rng(0).normal(size=300)
    tick = (np.floor(time * rate - phase + 1e-9) + phase) / rate
    # where a tick meets a frame within the tolerance it counts as at it
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


# drift and temperature


@both
@pytest.mark.parametrize("start", [0.0, 42.0])
def test_drift_curve(kind, start):
    time = times(kind, 500.0)
    t = start + time
    x = np.sin(time)
    y = respond(Drift(everywhere(1e-3), everywhere(-0.5), 100.0, start), x, time)
    np.testing.assert_allclose(y, x + 1e-3 * t + 0.5 * np.expm1(-t / 100), atol=1e-12)


def test_a_warm_up_without_time_constant_is_an_offset():
    time = times("irregular", 10.0, 20)
    np.testing.assert_allclose(respond(Drift(amplitude=everywhere(0.5), tau=0.0), time, time), time + 0.5)


def test_each_element_drifts_by_itself():
    rate = np.random.default_rng(0).normal(size=FRAME)
    x = np.zeros((3, *FRAME))
    np.testing.assert_allclose(Drift(rate).run(x, [0.0, 1.0, 3.0]), np.array([0, 1, 3]).reshape(-1, 1, 1, 1, 1) * rate)


def test_drift_does_not_lose_time_in_float32():
    drift = Drift(everywhere(1e-3))
    x = np.zeros(FRAME, np.float32)
    state = drift.initial_state(x)
    _, state = drift.step(x, state, 86_400.0)
    for _ in range(1000):
        y, state = drift.step(x, state, 0.001)
    np.testing.assert_allclose(state[0], 86_401.0, atol=1e-6)
    np.testing.assert_allclose(y, 86.401, rtol=1e-6)


def test_temperature():
    x, rng = np.random.default_rng(0).normal(size=(4, *FRAME)), np.random.default_rng(1)
    offset, temperature = rng.normal(size=FRAME), np.array([25.0, 26.0, 35.0, 5.0])
    drift = TemperatureDrift(-1e-3, offset, 25.0)
    expected = np.stack([x[i] * (1 - 1e-3 * t) + offset * t for i, t in enumerate(temperature - 25)])
    np.testing.assert_allclose(drift.run(x, np.arange(4), {"temperature": temperature}), expected, atol=1e-12)
    np.testing.assert_allclose(drift(x[1], {"temperature": 26.0}), expected[1], atol=1e-12)
    np.testing.assert_array_equal(drift(x[0], {"temperature": 25.0}), x[0])
    other = dataclasses.replace(drift, covariate="motor_temperature")
    assert other.covariate_names == ("motor_temperature",)
    np.testing.assert_array_equal(other(x, {"motor_temperature": temperature}), drift(x, {"temperature": temperature}))


# noise


def test_white_noise_has_the_deviation_it_should_and_no_memory():
    sigma = np.random.default_rng(0).uniform(0.01, 1, FRAME)
    x = np.random.default_rng(1).normal(size=(3000, *FRAME))
    n = (WhiteNoise(sigma, 3).run(x, np.arange(3000)) - x) / sigma
    assert stats.kstest(n.reshape(-1), "norm").pvalue > 0.01
    assert np.abs(n.std(0) - 1).max() < 5 / np.sqrt(2 * 3000)
    assert abs(np.mean(n[1:] * n[:-1])) * np.sqrt(n.size) < 4
    assert abs(np.mean(n * x)) * np.sqrt(n.size) < 4


def test_white_noise_depends_on_frames_not_on_time():
    x = np.zeros((20, *FRAME))
    noise = WhiteNoise(everywhere(0.1), 3)
    y = noise.run(x, np.arange(20))
    np.testing.assert_array_equal(noise.run(x, np.zeros(20)), y)
    np.testing.assert_array_equal(noise.run(x, times("irregular", 2.0, 20)), y)
    assert len(np.unique(y)) == y.size


def test_noise_repeats_from_the_parameters_alone():
    chain = Chain([WhiteNoise(everywhere(0.1), 3), RandomWalk(everywhere(0.1), 2**32 - 1), Latency(0.02, 0.01, 5)])
    x, time = np.random.default_rng(0).normal(size=(20, *FRAME)), times("irregular", 1.0, 20)
    y = chain.run(x, time)
    np.testing.assert_array_equal(chain.run(x, time), y)
    np.testing.assert_array_equal(Chain.from_json(chain.to_json()).run(x, time), y)
    for i, (name, member) in enumerate(zip(chain.names, chain, strict=True)):
        other = chain.replace(**{name: dataclasses.replace(member, seed=100 + i)})
        assert not np.allclose(other.run(x, time), y)


def test_a_reset_environment_draws_the_same_again_unless_it_gets_another_seed():
    x, mask = np.zeros((2, *FRAME)), np.array([True, False])
    noise = WhiteNoise(everywhere(0.1), np.array([1, 2]))
    state, drawn = noise.initial_state(x), []
    for _ in range(4):
        y, state = noise.step(x, state, 0.1)
        drawn.append(y)
    state = noise.reset(state, mask, x)
    y, _ = noise.step(x, state, 0.1)
    np.testing.assert_array_equal(y[0], drawn[0][0])
    assert not np.any(np.isin(y[1], np.stack(drawn)))
    y, _ = dataclasses.replace(noise, seed=np.array([5, 2])).step(x, state, 0.1)
    assert not np.any(np.isin(y, np.stack(drawn)))


def test_white_noise_and_walk_with_one_seed_are_not_the_same_numbers():
    x, time = np.zeros((2, *FRAME)), [0.0, 1.0]
    white = WhiteNoise(everywhere(1.0), 3).run(x, time)[1]
    walk = RandomWalk(everywhere(1.0), 3).run(x, time)[1]
    assert abs(np.corrcoef(white.reshape(-1), walk.reshape(-1))[0, 1]) < 4 / np.sqrt(180)


@both
def test_a_walk_has_the_variance_it_should(kind):
    time, sigma = times(kind, 9.0, 30), 0.3
    b = RandomWalk(everywhere(sigma), 3).run(np.zeros((30, 40, *FRAME)), time).reshape(30, -1)
    np.testing.assert_array_equal(b[0], 0)
    size = b.shape[1]
    variance = b[1:].var(1)
    assert np.all(np.abs(variance / (sigma**2 * time[1:]) - 1) < 5 * np.sqrt(2 / size))
    steps = np.diff(b, axis=0) / (sigma * np.sqrt(np.diff(time)))[:, None]
    assert stats.kstest(steps.reshape(-1), "norm").pvalue > 0.01
    assert abs(np.mean(steps[1:] * steps[:-1])) * np.sqrt(steps[1:].size) < 4


def test_a_walk_stands_still_in_no_time():
    b = RandomWalk(everywhere(0.3), 3).run(np.zeros((4, *FRAME)), [0.0, 1.0, 1.0, 2.0])
    np.testing.assert_array_equal(b[2], b[1])
    assert np.all(b[3] != b[2])


# all


@deterministic
@both
def test_frames_in_between_change_nothing(transform, kind):
    """x runs straight from frame to frame: ten times the frames, the same readings."""
    time, x = times(kind, 1.0, 40, seed=5), np.random.default_rng(0).normal(size=40)
    if isinstance(transform, Latency):
        transform = dataclasses.replace(transform, capacity=400)
    if isinstance(transform, SampleAndHold):
        transform = SampleAndHold(33.3, 0.41)
    fine = np.unique(np.concatenate([np.interp(np.arange(0, 39, 0.1), np.arange(40), time), time]))
    y = respond(transform, np.interp(fine, time, x), fine)
    at = np.searchsorted(fine, time)
    tolerance = 1e-10 if not isinstance(transform, SampleAndHold) else 2e-2  # a tick is moved by up to 1e-4 periods
    np.testing.assert_allclose(y[at], respond(transform, x, time), atol=tolerance)


@deterministic
def test_a_frame_again_in_no_time_changes_nothing(transform):
    x, time = np.random.default_rng(0).normal(size=(20, *FRAME)), times("irregular", 1.0, 20)
    y = transform.run(np.repeat(x, 3, axis=0), np.repeat(time, 3))
    for i in range(3):
        np.testing.assert_allclose(y[i::3], transform.run(x, time), atol=1e-12)


@every
def test_each_environment_has_its_own_time(transform):
    rng = np.random.default_rng(0)
    x, time = rng.normal(size=(20, 3, *FRAME)), np.stack([times("irregular", 1.0 + i, 20, i) for i in range(3)], axis=1)
    if "seed" in parameters(transform):
        transform = dataclasses.replace(transform, seed=np.array([1, 2, 3]))
    state, y = transform.initial_state(x[0]), []
    for i, dt in enumerate(np.diff(time, axis=0, prepend=0.0)):
        frame, state = transform.step(x[i], state, dt)
        y.append(frame)
    for i in range(3):
        alone = transform
        if "seed" in parameters(transform):
            alone = dataclasses.replace(transform, seed=int(transform.seed[i]))
        np.testing.assert_allclose(np.stack(y)[:, i], alone.run(x[:, i], time[:, i]), atol=1e-12)


@every
def test_stepping_is_running(transform):
    x, time = np.random.default_rng(0).normal(size=(20, 3, *FRAME)), times("irregular", 1.0, 20)
    state = transform.initial_state(x[0])
    y = transform.run(x, time)
    for i, dt in enumerate(np.diff(time, prepend=0.0)):
        frame, state = transform.step(x[i], state, dt)
        np.testing.assert_allclose(frame, y[i], rtol=1e-12, atol=1e-13)


@every
def test_one_environment_of_a_batch_begins_anew(transform):
    x, time = np.random.default_rng(0).normal(size=(20, 3, *FRAME)), times("irregular", 1.0, 20)
    mask = np.array([False, True, False])
    y = transform.run(x, time)
    fresh = transform.run(x[10:], time[10:])
    state = transform.initial_state(x[0])
    for i, dt in enumerate(np.diff(time, prepend=0.0)):
        dts = np.full(3, dt)
        if i == 10:
            state = transform.reset(state, mask, x[i])
            dts[mask] = 0
        frame, state = transform.step(x[i], state, dts)
        np.testing.assert_allclose(frame[~mask], y[i][~mask], rtol=1e-12, atol=1e-13)
        if i >= 10:
            np.testing.assert_allclose(frame[mask], fresh[i - 10][mask], rtol=1e-12, atol=1e-13)


@every
def test_the_caller_may_use_its_memory_again(transform):
    x, time = np.random.default_rng(0).normal(size=(20, *FRAME)), times("irregular", 1.0, 20)
    expected = transform.run(x, time)
    place = x[0].copy()
    state = transform.initial_state(place)
    for i, dt in enumerate(np.diff(time, prepend=0.0)):
        place[...] = x[i]
        y, state = transform.step(place, state, dt)
        np.testing.assert_allclose(y, expected[i], rtol=1e-12, atol=1e-13)
        y[...] = np.nan


@every
@pytest.mark.parametrize("dt", [0.0, 1e-9, 1e3, 1e9])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_no_dt_makes_it_fail(transform, dt, dtype):
    x = np.random.default_rng(0).normal(size=(5, *FRAME)).astype(dtype)
    state = transform.initial_state(x[0])
    for frame in x:
        y, state = transform.step(frame, state, dt)
        assert y.dtype == dtype
        assert np.all(np.isfinite(y))


@deterministic
def test_time_constants_next_to_nothing(transform):
    x, time = np.random.default_rng(0).normal(size=(5, *FRAME)).astype(np.float32), np.arange(5) * 0.1
    for name, about in parameters(transform).items():
        if about.unit in ("s", "N") and not set(about.core) & set("pkrc"):
            for value in (0.0, 1e-300, 1e-42, 1e-30, 1e-12):
                shape = np.shape(getattr(transform, name))
                changed = dataclasses.replace(transform, **{name: np.full(shape, value)})
                assert np.all(np.isfinite(changed.run(x, time)))


# torch


@needs_torch
@every
def test_torch_gives_the_same(transform):
    x, time = np.random.default_rng(0).normal(size=(20, 3, *FRAME)), times("irregular", 1.0, 20)
    y = transform.run(torch.as_tensor(x), time)
    np.testing.assert_allclose(y, transform.run(x, time), rtol=0, atol=1e-12)


@needs_torch
@every
def test_compiled_whole(transform):
    x, time = np.random.default_rng(0).normal(size=(6, 3, *FRAME)), times("irregular", 0.3, 6)
    tensor, expected = torch.as_tensor(x), transform.run(x, time)
    torch.compiler.reset()
    step = torch.compile(lambda x, state, dt: transform.step(x, state, dt), fullgraph=True, backend="aot_eager")
    begin = torch.compile(lambda x: transform.initial_state(x), fullgraph=True, backend="aot_eager")
    reset = torch.compile(lambda state, mask, x: transform.reset(state, mask, x), fullgraph=True, backend="aot_eager")
    state = begin(tensor[0])
    for i, dt in enumerate(np.diff(time, prepend=0.0)):
        y, state = step(tensor[i], state, torch.full((3,), dt, dtype=torch.float64))
        np.testing.assert_allclose(y, expected[i], rtol=0, atol=1e-12)
    state = reset(state, torch.tensor([True, False, True]), tensor[0])
    y, _ = step(tensor[0], state, torch.zeros(3, dtype=torch.float64))
    np.testing.assert_allclose(y[[0, 2]], expected[0][[0, 2]], rtol=0, atol=1e-12)


@needs_torch
@every
def test_under_vmap(transform):
    x, time = torch.as_tensor(np.random.default_rng(0).normal(size=(6, 3, *FRAME))), times("irregular", 0.3, 6)
    has_seed = "seed" in parameters(transform)
    seeds = torch.tensor([4, 5, 6])

    def with_seed(seed):
        return dataclasses.replace(transform, seed=seed) if has_seed else transform

    state = torch.vmap(lambda x: transform.initial_state(x))(x[0])
    expected = with_seed(seeds).run(x, time)
    for i, dt in enumerate(np.diff(time, prepend=0.0)):
        dts = torch.full((3,), dt, dtype=torch.float64)
        y, state = torch.vmap(lambda seed, x, state, dt: with_seed(seed).step(x, state, dt))(seeds, x[i], state, dts)
        torch.testing.assert_close(y, expected[i], rtol=0, atol=1e-12)
