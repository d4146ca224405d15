"""The noise ahead of a sensor's steps is told from its counts, whatever its zeros and what presses leave behind."""

import numpy as np
import pytest

from paxisim.diagnose.dither import dither_of

EPISODES, FRAMES, STEP = 10, 80, 0.1
SIZE = (2, 3, 4, 3)
SPANS = tuple(slice(k * FRAMES, (k + 1) * FRAMES) for k in range(EPISODES))
UNTOUCHED = np.tile(np.arange(FRAMES) < FRAMES // 2, EPISODES)
ALIVE = np.ones(SIZE, dtype=bool)
EVERY = np.ones(EPISODES * FRAMES, dtype=bool)


def zeros(kind, rng):
    """``(T, *SIZE)`` what is read without a force, before rounding."""
    time = np.repeat(np.linspace(0, 1, EPISODES), FRAMES)[:, None, None, None, None]
    return {"right": 0.0, "offset": 2 * STEP, "small offset": 0.3 * STEP, "drift": 2 * STEP * time}[
        kind
    ] * rng.standard_normal(SIZE) + 0 * time


def counts(force, noise, rng):
    own = noise * rng.uniform(0.7, 1.4, SIZE)  # channels differ
    return np.round((force + own * rng.standard_normal(force.shape)) / STEP) * STEP


@pytest.mark.parametrize("kind", ["right", "offset", "small offset", "drift"])
@pytest.mark.parametrize("share", [0.18, 0.25, 0.4, 0.7])
def test_zeros_are_not_taken_for_noise(kind, share):
    rng = np.random.default_rng(7)
    measured = counts(zeros(kind, rng), share * STEP, rng)
    dither = dither_of(measured, EVERY, UNTOUCHED, SPANS, STEP, ALIVE)
    assert dither == pytest.approx(share * STEP, rel=0.3)


def test_noise_that_reaches_no_count_is_said_to_be_small():
    rng = np.random.default_rng(1)
    assert dither_of(counts(zeros("right", rng), 0.05 * STEP, rng), EVERY, UNTOUCHED, SPANS, STEP, ALIVE) <= 0.15 * STEP


def test_what_a_press_leaves_behind_is_not_noise():
    rng = np.random.default_rng(3)
    tail = np.where(UNTOUCHED, 0.0, np.exp(-np.tile(np.arange(FRAMES) - FRAMES / 2, EPISODES) / 20))
    measured = counts(4 * STEP * tail[:, None, None, None, None] + zeros("right", rng), 0.3 * STEP, rng)
    assert dither_of(measured, EVERY, UNTOUCHED, SPANS, STEP, ALIVE) == pytest.approx(0.3 * STEP, rel=0.2)
    # without samples before a press it has to do
    assert dither_of(measured, EVERY, ~EVERY, SPANS, STEP, ALIVE) > 0.3 * STEP


def test_a_sensor_without_steps_and_one_that_is_always_pressed():
    rng = np.random.default_rng(5)
    measured = 0.02 * rng.standard_normal((EPISODES * FRAMES, *SIZE))
    assert dither_of(measured, EVERY, UNTOUCHED, SPANS, 0.0, ALIVE) == pytest.approx(0.02, rel=0.05)
    assert dither_of(0 * measured, EVERY, UNTOUCHED, SPANS, 0.0, ALIVE) == 0.0
    assert dither_of(measured, ~EVERY, ~EVERY, SPANS, 0.0, ALIVE) == 0.0
