"""The noise before quantisation is estimated from counts, despite zero offsets and after-effects of presses."""

import numpy as np
import pytest

from paxisim.diagnose.data.noise_floor import dither_of
from paxisim.diagnose.rules import NOISE as LIMITS

EPISODES, FRAMES, STEP, INTERVAL = 10, 80, 0.1, 0.02
SIZE = (2, 3, 4, 3)
SPANS = tuple(slice(k * FRAMES, (k + 1) * FRAMES) for k in range(EPISODES))
UNTOUCHED = np.tile(np.arange(FRAMES) < FRAMES // 4, EPISODES)
AT_REST = np.tile((np.arange(FRAMES) < FRAMES // 4) | (np.arange(FRAMES) >= 3 * FRAMES // 4), EPISODES)
ALIVE = np.ones(SIZE, dtype=bool)


def held(rng, largest=8 * STEP, slope=0.0):
    """Return ``(T, *SIZE)`` forces applied at once, held while growing by `slope` per second, and released."""
    level = (
        rng.uniform(-largest, largest, (EPISODES, 1, *SIZE))
        + slope * np.linspace(0, FRAMES * INTERVAL, FRAMES)[:, None, None, None, None]
    )
    return np.where(AT_REST[:, None, None, None, None], 0.0, level.reshape(-1, *SIZE))


def zeros(kind, rng):
    """Return ``(T, *SIZE)`` readings without force, before rounding."""
    time = np.repeat(np.linspace(0, 1, EPISODES), FRAMES)[:, None, None, None, None]
    edges = 0.5 * STEP * rng.choice([-1, 1], SIZE) + 0 * time
    if kind == "at the edges":
        return edges
    size = {"right": 0.0, "offset": 2 * STEP, "small offset": 0.3 * STEP, "drift": 2 * STEP * time}[kind]
    return size * rng.standard_normal(SIZE) + 0 * time


def counts(force, noise, rng):
    own = noise * rng.uniform(0.7, 1.4, SIZE)  # channels differ
    return np.round((force + own * rng.standard_normal(force.shape)) / STEP) * STEP


def found(measured, simulated, at_rest=AT_REST, untouched=UNTOUCHED, step=STEP):
    return dither_of(measured, simulated, at_rest, untouched, SPANS, INTERVAL, step, ALIVE)


@pytest.mark.parametrize("kind", ["right", "offset", "small offset", "drift", "at the edges"])
def test_zeros_are_not_taken_for_noise(kind):
    for share in (0.02, 0.18, 0.7):
        rng = np.random.default_rng(7)
        force = held(rng)
        measured = counts(force + zeros(kind, rng), share * STEP, rng)
        assert found(measured, force) == pytest.approx(share * STEP, rel=0.3), share


def test_a_force_that_moves_faster_than_simulated_is_not_taken_for_noise():
    rng = np.random.default_rng(8)
    slowly, fast = held(rng, slope=0.5 * STEP), held(rng, slope=5 * STEP)
    assert found(counts(1.1 * slowly, 0.1 * STEP, rng), slowly) == pytest.approx(0.1 * STEP, rel=0.3)
    assert found(counts(1.1 * fast, 0.1 * STEP, rng), fast) == LIMITS.hidden * STEP


def test_a_slow_sensor_is_given_time_to_settle_and_what_a_press_leaves_behind_is_no_noise():
    rng = np.random.default_rng(9)
    force = held(rng)
    since = np.tile(np.arange(FRAMES) - FRAMES // 4, EPISODES)[:, None, None, None, None] * INTERVAL
    slow = np.where(force != 0, force * -np.expm1(-np.maximum(since, 0) / 0.06), 0.0)
    assert found(counts(slow, 0.05 * STEP, rng), force) == pytest.approx(0.05 * STEP, rel=0.3)
    released = (AT_REST & ~UNTOUCHED)[:, None, None, None, None]
    tail = np.where(released, np.exp(-(since - FRAMES / 2 * INTERVAL) / (10 * INTERVAL)), 0.0)
    assert found(counts(force + 4 * STEP * tail, 0.3 * STEP, rng), force) == pytest.approx(0.3 * STEP, rel=0.2)


def test_noise_is_a_guess_where_hardly_a_force_passes_a_step():
    rng = np.random.default_rng(1)
    force = held(rng, largest=0.9 * STEP)
    assert found(counts(force, 0.05 * STEP, rng), force) == LIMITS.hidden * STEP


def test_a_sensor_without_steps_and_one_that_is_always_pressed():
    rng = np.random.default_rng(5)
    measured = 0.02 * rng.standard_normal((EPISODES * FRAMES, *SIZE))
    never = np.zeros_like(AT_REST)
    assert found(measured, 0 * measured, step=0.0) == pytest.approx(0.02, rel=0.05)
    assert found(0 * measured, 0 * measured, step=0.0) == 0.0
    assert found(measured, 0 * measured, never, never, step=0.0) == 0.0
    force = held(rng)
    assert found(counts(force, 0.1 * STEP, rng), force, never, never) == pytest.approx(0.1 * STEP, rel=0.2)
