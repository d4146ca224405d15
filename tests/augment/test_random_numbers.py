"""Random numbers: the same everywhere and statistically sound; white noise and random walk made of them."""

import dataclasses

import array_api_compat.numpy as xp
import numpy as np
import pytest
from forces import both, everywhere, needs_torch, times, torch
from scipy import stats
from transform_examples import FRAME

from paxisim.augment import Chain, Latency, RandomWalk, WhiteNoise
from paxisim.augment.random_numbers import SEEDS, _to_unit, _words, no_draws, normal, uniform


def frames(*batch, dtype="float64"):
    return np.zeros((*batch, *FRAME), dtype)


def counting(count):
    return np.arange(count).reshape(count, 1, 1, 1, 1)


def correlation(a, b):
    """Return the absolute correlation, in units of its standard deviation for independent numbers."""
    a, b = a.reshape(-1), b.reshape(-1)
    return abs(np.corrcoef(a, b)[0, 1]) * np.sqrt(len(a))


def test_normal_numbers_are_normal():
    n = normal(np.full(5000, 7), counting(5000), frames(5000), 1).reshape(-1)
    assert stats.kstest(n, "norm").pvalue > 0.01
    assert abs(n.mean()) < 4 / np.sqrt(n.size)
    assert abs(n.var() - 1) < 4 * np.sqrt(2 / n.size)
    for limit in (2, 3, 4):
        share = 2 * stats.norm.sf(limit)
        assert abs((np.abs(n) > limit).mean() - share) < 4 * np.sqrt(share / n.size)


def test_uniform_numbers_are_uniform_over_environments_and_over_time():
    zeros = frames(100_000)
    for u in (uniform(7, no_draws(zeros), zeros, 1), uniform(np.full(100_000, 7), counting(100_000), zeros, 1)):
        assert 0 < u.min() < 1e-4 < 1 - 1e-4 < u.max() < 1
        assert stats.kstest(u.reshape(-1), "uniform").pvalue > 0.01
        assert stats.chisquare(np.histogram(u, 1000, (0, 1))[0]).pvalue > 0.01


def test_one_bit_of_seed_or_count_changes_half_of_the_bits():
    rng = np.random.default_rng(0)
    seeds, counts = rng.integers(SEEDS, size=2000), rng.integers(100_000, size=(2000, 1, 1, 1, 1))
    before = _words(seeds, counts, frames(2000), 1, 1)
    for bit in range(32):
        for key in ((seeds ^ (1 << bit), counts), (seeds, counts ^ (1 << bit))):
            flips = ((_words(*key, frames(2000), 1, 1) ^ before) >> np.arange(32)) & 1
            assert np.all(np.abs(flips.mean(0) - 0.5) < 5 * 0.5 / np.sqrt(2000))


def test_elements_frames_seeds_streams_and_environments_do_not_correlate():
    x, zero, seeds = frames(1000), no_draws(frames(1000)), np.arange(1000)
    n = normal(np.full(1000, 7), counting(1000), x, 1).reshape(1000, -1)
    for lag in (1, 2, 5, 30, 60, 90):
        assert correlation(n[:, lag:], n[:, :-lag]) < 4, "elements"
        assert correlation(n[lag:], n[:-lag]) < 4, "frames"
        assert correlation(n[lag:, lag:], n[:-lag, :-lag]) < 4, "both"
    for values in (n**2, np.sign(n)):
        assert correlation(values[:, 90:], values[:, :90]) < 4, "the two numbers of one radius and angle"
    first = normal(seeds, zero, x, 1)
    for other in (
        normal(seeds + 1, zero, x, 1),
        normal(seeds ^ (1 << 31), zero, x, 1),
        normal(seeds, zero + 1, x, 1),
        normal(seeds, zero, x, 2),
        normal(seeds + 1, zero - 1, x, 1),
        normal(np.zeros(1000, int), counting(1000), x, 1),
        normal(7, zero, x, 1),
    ):
        assert correlation(first, other) < 4
        assert correlation(other[1:], other[:-1]) < 4
        assert len(np.unique(other)) == other.size


def test_an_environment_with_a_seed_of_its_own_is_the_same_wherever_it_is_and_others_draw_their_own():
    n = normal(np.array([[1], [2]]), no_draws(frames(2, 3)), frames(2, 3), 1)
    assert n.shape == (2, 3, *FRAME)
    assert len(np.unique(n)) == n.size
    np.testing.assert_array_equal(n[1], normal(2, no_draws(frames(3)), frames(3), 1))
    seeds = np.array([3, 14, 3, 0])
    alone = [normal(seed, no_draws(frames()), frames(), 1) for seed in seeds]
    np.testing.assert_array_equal(normal(seeds, no_draws(frames(4)), frames(4), 1), alone)


def test_extremes_dtypes_and_an_odd_number_of_elements():
    for seed in (0, SEEDS - 1):
        for count in (0, SEEDS - 1, SEEDS + 5, 2**62):
            n = normal(seed, no_draws(frames()) + count, frames(), 2**40)
            assert np.all(np.isfinite(n))
            assert np.unique(n).size == n.size
    assert 0 < _to_unit(np.array(0), xp) < _to_unit(np.array(SEEDS - 1), xp) < 1, "their logarithm is finite"
    odd, single = np.zeros((1, 3, 1, 1)), frames(2, dtype="float32")
    assert normal(1, no_draws(odd), odd, 1).shape == odd.shape
    for draw in (normal, uniform):
        double = draw(1, no_draws(single), frames(2), 1)
        np.testing.assert_array_equal(draw(1, no_draws(single), single, 1), double.astype("float32"), strict=True)


@needs_torch
@pytest.mark.parametrize("seed", [7, SEEDS - 1, np.arange(4) + SEEDS - 4])
def test_torch_gives_the_same_bits_and_numbers(seed):
    x, count = frames(4), counting(4)
    tensor, counts = torch.as_tensor(x), torch.as_tensor(count)
    for each in (seed, torch.as_tensor(seed)):
        np.testing.assert_array_equal(uniform(each, counts, tensor, 1), uniform(seed, count, x, 1))
        np.testing.assert_allclose(normal(each, counts, tensor, 1), normal(seed, count, x, 1), rtol=0, atol=1e-14)


def test_white_noise_has_the_deviation_it_should_and_no_memory():
    sigma = np.random.default_rng(0).uniform(0.01, 1, FRAME)
    x = np.random.default_rng(1).normal(size=(1500, *FRAME))
    noise = WhiteNoise(sigma, 3).run(x, np.arange(1500)) - x
    n = noise / sigma
    assert stats.kstest(n.reshape(-1), "norm").pvalue > 0.01
    assert np.abs(n.std(0) - 1).max() < 5 / np.sqrt(2 * 1500)
    assert correlation(n[1:], n[:-1]) < 4
    assert correlation(n, x) < 4
    at_once = WhiteNoise(sigma, 3).run(x, np.zeros(1500)) - x
    np.testing.assert_array_equal(at_once, noise, "it depends on the frames, not on time")


def test_every_seed_of_a_chain_counts():
    chain = Chain([WhiteNoise(everywhere(0.1), 3), RandomWalk(everywhere(0.1), 2**32 - 1), Latency(0.02, 0.01, 5)])
    x, time = np.random.default_rng(0).normal(size=(20, *FRAME)), times("irregular", 1.0, 20)
    for name, member in zip(chain.names, chain, strict=True):
        other = chain.replace(**{name: dataclasses.replace(member, seed=100)})
        assert not np.allclose(other.run(x, time), chain.run(x, time))
    white, walk = (kind(everywhere(1.0), 3).run(frames(2), [0.0, 1.0])[1] for kind in (WhiteNoise, RandomWalk))
    assert correlation(white, walk) < 4


@both
def test_a_walk_has_the_variance_it_should_and_stands_still_in_no_time(kind):
    time, sigma = times(kind, 9.0, 30), 0.3
    b = RandomWalk(everywhere(sigma), 3).run(frames(30, 40), time).reshape(30, -1)
    np.testing.assert_array_equal(b[0], 0)
    assert np.all(np.abs(b[1:].var(1) / (sigma**2 * time[1:]) - 1) < 5 * np.sqrt(2 / b.shape[1]))
    steps = np.diff(b, axis=0) / (sigma * np.sqrt(np.diff(time)))[:, None]
    assert stats.kstest(steps.reshape(-1), "norm").pvalue > 0.01
    assert correlation(steps[1:], steps[:-1]) < 4
    still = RandomWalk(everywhere(0.3), 3).run(frames(3), [0.0, 1.0, 1.0])
    np.testing.assert_array_equal(still[2], still[1])
