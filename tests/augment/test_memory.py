"""Transforms with memory: what they share beyond the contract, then low-pass, creep, hysteresis and drift.

`test_latency_and_sample_and_hold.py` has those that only move readings in time.
"""

import dataclasses
import itertools

import numpy as np
import pytest
from forces import both, everywhere, respond, times
from hypothesis import given, settings
from hypothesis import strategies as st
from transform_examples import FRAME

from paxisim import augment
from paxisim.augment import Creep, Drift, FailingTaxels, Hysteresis, Latency, LowPass, SampleAndHold

DETERMINISTIC = [
    LowPass(0.05),
    Creep((0.1, -0.05, 0.2), (0.02, 0.3, 5.0)),
    Hysteresis((0.2, 0.1, 0.3), (0.1, 0.5, 1.0)),
    Latency(0.037, capacity=400),
    SampleAndHold(33.3, 0.41),
    Drift(everywhere(0.3), everywhere(0.5), 0.4, 0.1),
]


@pytest.mark.parametrize(
    ("transform", "x", "y"),
    [
        (Creep((0.2,), (1.0,)), [0, 1, 1, 1], [0, 1.074, 1.153, 1.183]),
        (Hysteresis((0.5,), (0.2,)), [0, 1, 0.8, 0], [0, 0.9, 0.8, 0.1]),
        (Latency(1.5), [0, 1, 4, 9], [0, 0, 0.5, 2.5]),
        (SampleAndHold(0.4), [0, 1, 4, 9], [0, 0, 0, 6.5]),
        (Drift(everywhere(0.01), everywhere(0.1), 1.0), [0, 0, 0, 0], [0, 0.0732, 0.1065, 0.125]),
        (FailingTaxels(stuck=[[[1.0]]], value=everywhere(0.5), since=2.0), [0, 3, 4, 0], [0, 3, 0.5, 0.5]),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_the_worked_examples(transform, x, y):
    np.testing.assert_allclose(respond(transform, x, np.arange(4.0)), y, rtol=0, atol=0.51e-3)


@pytest.mark.parametrize("transform", DETERMINISTIC, ids=lambda transform: transform.name)
@both
def test_frames_in_between_change_nothing(transform, kind):
    """x is linear between frames, so ten times as many frames, or the same frame again, give the same readings."""
    time, x = times(kind, 1.0, 40, seed=5), np.random.default_rng(0).normal(size=40)
    fine = np.unique(np.concatenate([np.interp(np.arange(0, 39, 0.1), np.arange(40), time), time]))
    y = respond(transform, np.interp(fine, time, x), fine)
    tolerance = 1e-10 if not isinstance(transform, SampleAndHold) else 2e-2  # a tick is moved by up to 1e-4 periods
    expected = respond(transform, x, time)
    np.testing.assert_allclose(y[np.searchsorted(fine, time)], expected, atol=tolerance)
    again = respond(transform, np.repeat(x, 3), np.repeat(time, 3))
    np.testing.assert_allclose(again.reshape(40, 3), np.stack([expected] * 3, axis=1), atol=1e-12)


# low-pass and creep, compared with their analytic responses

AMPLITUDE, TAU = np.array([0.1, 0.2, -0.05]), np.array([0.05, 1.5, 40.0])


@both
def test_step_and_ramp_response(kind):
    time = times(kind, 10.0)
    jump, at = np.concatenate([[0], np.ones(len(time))]), np.concatenate([[0], time])  # two frames at time 0
    np.testing.assert_allclose(respond(LowPass(0.7), jump, at)[1:], 1 - np.exp(-time / 0.7), atol=1e-12)
    expected = 1 + (AMPLITUDE * -np.expm1(-time[:, None] / TAU)).sum(1)
    np.testing.assert_allclose(respond(Creep(AMPLITUDE, TAU), jump, at)[1:], expected, atol=1e-12)
    modes = time[:, None] + TAU * np.expm1(-time[:, None] / TAU)
    np.testing.assert_allclose(respond(LowPass(1.5), time, time), modes[:, 1], atol=1e-12)
    np.testing.assert_allclose(respond(Creep(AMPLITUDE, TAU), time, time), time + modes @ AMPLITUDE, atol=1e-11)


def test_creep_is_a_sum_of_low_passes_and_without_time_constant_a_gain():
    x, time = np.random.default_rng(0).normal(size=(50, *FRAME)), times("irregular", 5.0, 50)
    y = Creep((0.1, 0.3), (0.2, 1.0)).run(x, time)
    np.testing.assert_allclose(y, x + 0.1 * LowPass(0.2).run(x, time) + 0.3 * LowPass(1.0).run(x, time), atol=1e-12)
    np.testing.assert_allclose(Creep((0.2,), (0.0,)).run(x, time), 1.2 * x, rtol=1e-12)


def test_slow_creep_does_not_stall_in_float32():
    """At 100 Hz and a time constant of 60 s, each increment is tiny compared with the state."""
    time = np.arange(12_000) * 0.01
    loads = 20 * np.concatenate([[0], np.ones(len(time))])
    y = respond(Creep((0.25,), (60.0,)), loads, np.concatenate([[0], time]), np.float32)[1:]
    np.testing.assert_allclose(y, 20 * (1 + 0.25 * -np.expm1(-time / 60)), rtol=1e-4)


@pytest.mark.parametrize("transform", [LowPass(0.05), Creep((0.2, -0.1), (1e-4, 3.0)), LowPass(1e4)])
def test_a_long_sequence_runs_as_it_steps(transform):
    """Frames small enough for parallel stretches, and larger ones; some times repeat."""
    for frames, batch in itertools.product([1, 2, 3, 101], [(), (60,)]):
        rng = np.random.default_rng(frames)
        x = rng.normal(size=(frames, *batch, *FRAME)).cumsum(axis=0)
        time = np.cumsum(np.where(rng.random(frames) < 0.1, 0.0, rng.uniform(0.001, 0.03, frames)))
        y, state = transform.run(x, time), transform.initial_state(x[0])
        for frame, dt, ran in zip(x, np.diff(time, prepend=time[0]), y, strict=True):
            stepped, state = transform.step(frame, state, dt)
            np.testing.assert_allclose(ran, stepped, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("kind", [Creep, Hysteresis])
def test_one_of_the_parameters_may_serve_all_modes(kind):
    x, time = np.random.default_rng(0).normal(size=(9, *FRAME)), times("irregular", 1.0, 9)
    for short, long in (
        (((0.1,), (0.1, 0.2)), ((0.1, 0.1), (0.1, 0.2))),
        (((0.1, 0.2), (0.1,)), ((0.1, 0.2), (0.1, 0.1))),
    ):
        np.testing.assert_array_equal(kind(*short).run(x, time), kind(*long).run(x, time))


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
    # a stream that starts under load is taken to have been loaded along the virgin curve
    np.testing.assert_allclose([respond(hysteresis, [load], [0.0])[0] for load in x], expected, atol=1e-14)


def test_the_loop_closes_and_has_the_area_it_should():
    weight, radius, swing = np.array([0.1, 0.2, 0.15]), np.array([0.3, 0.8, 3.0]), 2.0
    x = np.concatenate([cycle(0, swing), cycle(-swing, swing), cycle(-swing, swing)])
    y = respond(Hysteresis(weight, radius), x, np.arange(len(x)))
    first, second = slice(99, 198), slice(198, 297)
    np.testing.assert_allclose(y[second], y[first], atol=1e-14)
    x, y = x[second], y[second]
    area = np.sum((y[1:] + y[:-1]) / 2 * np.diff(x))
    # sampling at 50 points cuts the corners of the loop slightly
    assert -area == pytest.approx((weight * 4 * radius * np.maximum(0, swing - radius)).sum(), rel=5e-3)
    width = y[49:][::-1] - y[:50]
    assert np.all(width > -1e-12)
    assert width.max() == pytest.approx(2 * (0.1 * 0.3 + 0.2 * 0.8))


def test_friction_that_grows_with_the_load_widens_the_loop():
    radius, growth = 0.4, 0.05
    x = np.concatenate([cycle(0, 3.0), cycle(0, 3.0)])
    y = respond(Hysteresis((0.0,), (radius,), (growth,)), x, np.arange(len(x)))
    loading, unloading = y[99:149], y[148:][::-1][: len(y[99:149])]
    inside = (x[99:149] > 2 * radius) & (x[99:149] < 3.0 - 2 * radius)
    np.testing.assert_allclose((unloading - loading)[inside], 2 * growth * radius * x[99:149][inside], rtol=1e-9)


def test_creep_that_grows_with_the_load_and_was_calibrated_with_held_loads():
    time = np.array([0.0, 1e-6, 0.5, 1.0, 1e3])
    growth, amplitude, tau = 0.1, 0.2, 1.0
    for load in (1.0, -4.0):
        drive = load * (1 + growth * abs(load))
        for held in (0.0, 0.5, 1.0):
            y = respond(Creep((amplitude,), (tau,), held, growth), np.where(time > 0, load, 0.0), time)
            expected = load + amplitude * drive * (-np.expm1(-time[1:] / tau) - held)
            np.testing.assert_allclose(y[1:], expected, atol=1e-5)


@settings(derandomize=True, deadline=None, max_examples=15)
@given(st.lists(st.floats(-5, 5), min_size=2, max_size=8), st.integers(0, 2**31))
def test_only_the_turning_points_count(turns, seed):
    hysteresis = Hysteresis((0.1, 0.3, 0.2), (0.1, 0.7, 2.0))
    rng = np.random.default_rng(seed)
    legs = [[a, *(a + (b - a) * np.sort(rng.random(5)))] for a, b in itertools.pairwise(turns)]
    path = [*itertools.chain(*legs), turns[-1]]
    y = respond(hysteresis, path, np.cumsum(rng.exponential(size=len(path)) ** 3))
    np.testing.assert_allclose(y[::6], respond(hysteresis, turns, np.arange(len(turns))), atol=1e-12)


# drift


@both
@pytest.mark.parametrize("start", [0.0, 42.0])
def test_drift_curve(kind, start):
    time = times(kind, 500.0)
    t = start + time
    x = np.sin(time)
    y = respond(Drift(everywhere(1e-3), everywhere(-0.5), 100.0, start), x, time)
    np.testing.assert_allclose(y, x + 1e-3 * t + 0.5 * np.expm1(-t / 100), atol=1e-12)
    at_once = Drift(amplitude=everywhere(0.5), tau=0.0, start=start)
    np.testing.assert_allclose(respond(at_once, x, time), x + 0.5, err_msg="without time constant: an offset")


def test_time_is_kept_over_a_day_in_float32():
    drift, fails = Drift(everywhere(1e-3)), FailingTaxels(dead=np.ones((1, 1, 1)), since=86_400.5)
    x = np.ones(FRAME, np.float32)
    drifted, failed = drift.initial_state(x), fails.initial_state(x)
    _, drifted = drift.step(x, drifted, 86_400.0)
    y, failed = fails.step(x, failed, 86_400.0)
    np.testing.assert_array_equal(y, x)
    for _ in range(1000):
        z, drifted = drift.step(x, drifted, 0.001)
        y, failed = fails.step(x, failed, 0.001)
    np.testing.assert_allclose(drifted[0], 86_401.0, atol=1e-6)
    np.testing.assert_allclose(z - x, 86.401, rtol=1e-6)
    assert not y.any()


def test_temperature():
    x, rng = np.random.default_rng(0).normal(size=(4, *FRAME)), np.random.default_rng(1)
    offset, temperature = rng.normal(size=FRAME), np.array([25.0, 26.0, 35.0, 5.0])
    drift = augment.TemperatureDrift(-1e-3, offset, 25.0)
    expected = np.stack([x[i] * (1 - 1e-3 * t) + offset * t for i, t in enumerate(temperature - 25)])
    np.testing.assert_allclose(drift.run(x, np.arange(4), {"temperature": temperature}), expected, atol=1e-12)
    other = dataclasses.replace(drift, covariate="motor_temperature")
    assert other.covariate_names == ("motor_temperature",)
    np.testing.assert_allclose(other(x, {"motor_temperature": temperature}), expected, atol=1e-12)


# taxels that fail at some time


def test_failing_taxels_fail_each_at_its_own_moment_as_dead_taxels_do():
    rng = np.random.default_rng(1)
    faults = (rng.random((2, 6, 5)) < 0.3, rng.random((2, 6, 5)) < 0.3, rng.normal(size=FRAME))
    x, time = rng.normal(size=(5, *FRAME)), np.arange(5.0)
    np.testing.assert_array_equal(FailingTaxels(*faults, since=-1.0).run(x, time), augment.DeadTaxels(*faults)(x))
    since = np.reshape([1.0, np.inf, 3.0], (1, 3, 1, 1))
    y = FailingTaxels(dead=np.ones((1, 1, 1)), since=since).run(x, time)
    gone = time[:, None] >= since.ravel()
    np.testing.assert_array_equal(y, np.where(gone[:, None, :, None, None], 0, x))
