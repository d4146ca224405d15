"""Low-pass and creep compared with their analytic responses; hysteresis: loops, their area and what they forget."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from optional import torch
from responses import both, respond, times
from transform_examples import FRAME

from paxisim.augment import Creep, Hysteresis, LowPass
from paxisim.errors import InvalidValueError

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


def test_a_stream_begins_with_its_creep_complete():
    creep = Creep((0.1, 0.2), (0.5, 5.0))
    x = np.random.default_rng(0).normal(size=FRAME)
    state = creep.initial_state(x)
    for load, dt, reading in ((x, 0.0, 1.3 * x), (x, 1e3, 1.3 * x), (x + 1, 0.0, 1.3 * x + 1)):
        y, state = creep.step(load, state, dt)
        np.testing.assert_allclose(y, reading, rtol=1e-12)


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


@pytest.mark.parametrize(("kind", "names"), [(Creep, ("amplitude", "tau")), (Hysteresis, ("weight", "radius"))])
def test_the_number_of_modes(kind, names):
    x, time = np.random.default_rng(0).normal(size=(9, *FRAME)), times("irregular", 1.0, 9)
    for short, long in (
        (((0.1,), (0.1, 0.2)), ((0.1, 0.1), (0.1, 0.2))),
        (((0.1, 0.2), (0.1,)), ((0.1, 0.2), (0.1, 0.1))),
    ):
        np.testing.assert_array_equal(kind(*short).run(x, time), kind(*long).run(x, time))
    for bad, words in (
        (((0.1, 0.1), (0.1, 0.2, 0.3)), f"got 2 in {names[0]}, 3 in {names[1]}"),
        (((), (0.1,)), f"0 in {names[0]}"),
        ((0.1, (0.1,)), rf"{names[0]} must have shape \(..., modes\)"),
    ):
        with pytest.raises(InvalidValueError, match=rf"^{kind.__name__}: .*{words}"):
            kind(*bad)


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


@settings(derandomize=True, deadline=None, max_examples=15)
@given(st.lists(st.floats(-5, 5), min_size=2, max_size=8), st.integers(0, 2**31))
def test_only_the_turning_points_count(turns, seed):
    hysteresis = Hysteresis((0.1, 0.3, 0.2), (0.1, 0.7, 2.0))
    rng = np.random.default_rng(seed)
    legs = [[a, *(a + (b - a) * np.sort(rng.random(5)))] for a, b in itertools.pairwise(turns)]
    path = [*itertools.chain(*legs), turns[-1]]
    y = respond(hysteresis, path, np.cumsum(rng.exponential(size=len(path)) ** 3))
    np.testing.assert_allclose(y[::6], respond(hysteresis, turns, np.arange(len(turns))), atol=1e-12)


def test_what_hysteresis_keeps_and_forgets():
    hysteresis = Hysteresis((0.1, 0.2), (0.2, 0.6))
    straight = respond(hysteresis, [0, 2.0, 3.0], np.arange(3))
    detour = respond(hysteresis, [0, 2.0, 1.2, 1.7, 1.2, 2.0, 3.0], np.arange(7))
    np.testing.assert_allclose(straight[1:], detour[5:], atol=1e-14, err_msg="an inner loop is wiped out")
    small = np.array([0, 0.2, -0.3, 0.4])  # within all radii
    np.testing.assert_allclose(
        respond(Hysteresis((0.1, 0.3), (0.5, 1.0)), small, np.arange(4)), 0.6 * small, atol=1e-14
    )


def test_weights_that_sum_to_more_than_one_are_refused():
    Hysteresis((0.5, 0.3, 0.2), (1.0,))
    for weight, radius in (((0.7, 0.4), (1.0, 1.0)), ((0.4,), (1.0, 2.0, 3.0))):
        for convert in (tuple, *([torch.tensor] if torch else [])):
            with pytest.raises(InvalidValueError, match=r"^Hysteresis: the sum of weight must lie in \[0, 1\]"):
                Hysteresis(convert(weight), convert(radius))
