"""Hysteresis: closed loops, wiping-out of inner loops, and dependence on the turning points alone."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from optional import torch
from responses import respond

from paxisim.augment.hysteresis import Hysteresis
from paxisim.errors import InvalidValueError


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
    # sampling at 50 points cuts the corners of the loop slightly
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
