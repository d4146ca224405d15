"""Random numbers: identical everywhere and statistically sound."""

import numpy as np
import pytest
from optional import needs_torch, torch
from scipy import stats
from transform_examples import FRAME

from paxisim.augment.noise import WhiteNoise
from paxisim.augment.random_numbers import SEEDS, _mix, _words, check_seed, no_draws, normal, uniform
from paxisim.errors import InvalidValueError

SIZE = 180


def frames(*batch, dtype="float64"):
    return np.zeros((*batch, *FRAME), dtype)


def many(count, draw, *args):
    """Return ``count`` consecutive frames of numbers, ``(count, 180)``."""
    x = frames(count)
    return draw(np.full(count, 7), np.arange(count).reshape(count, 1, 1, 1, 1), x, 1, *args).reshape(count, -1)


def correlation(a, b):
    """Return the absolute correlation, in units of its standard deviation for independent numbers."""
    a, b = a.reshape(-1), b.reshape(-1)
    return abs(np.corrcoef(a, b)[0, 1]) * np.sqrt(len(a))


def test_normal_numbers_are_normal():
    n = many(5000, normal).reshape(-1)
    size = len(n)
    assert abs(n.mean()) < 4 / np.sqrt(size)
    assert abs(n.var() - 1) < 4 * np.sqrt(2 / size)
    assert abs(stats.skew(n)) < 4 * np.sqrt(6 / size)
    assert abs(stats.kurtosis(n)) < 4 * np.sqrt(24 / size)
    assert stats.kstest(n, "norm").pvalue > 0.01
    for limit in (2, 3, 4):
        share = 2 * stats.norm.sf(limit)
        assert abs((np.abs(n) > limit).mean() - share) < 4 * np.sqrt(share / size)


def test_normal_frames_are_normal_each_and_each_element_over_time():
    n = many(2000, normal)
    for axis, count in ((1, SIZE), (0, 2000)):
        p = stats.kstest(n, "norm", axis=axis).pvalue
        assert stats.kstest(p, "uniform").pvalue > 0.01
        means = n.mean(axis) * np.sqrt(count)
        assert stats.kstest(means, "norm").pvalue > 0.01


def test_uniform_numbers_are_uniform():
    u = uniform(7, no_draws(frames(500_000)), frames(500_000), 1).reshape(-1)
    assert 0 < u.min() < 1e-5 < 1 - 1e-5 < u.max() < 1
    assert stats.kstest(u, "uniform").pvalue > 0.01
    assert stats.chisquare(np.histogram(u, 1000, (0, 1))[0]).pvalue > 0.01
    # one environment over time
    counts = np.arange(100_000).reshape(-1, 1, 1, 1, 1)
    u = uniform(np.full(100_000, 7), counts, frames(100_000), 1).reshape(-1)
    assert stats.kstest(u, "uniform").pvalue > 0.01


def test_words_have_fair_bits_in_every_place():
    words = _words(0, no_draws(frames()), frames(), 200_000, 1).reshape(-1)
    ones = ((words[:, None] >> np.arange(32)) & 1).mean(0)
    assert np.all(np.abs(ones - 0.5) < 4 * 0.5 / np.sqrt(len(words)))
    pairs = np.histogram2d(words[:-1] >> 24, words[1:] >> 24, bins=[np.arange(0, 257, 8)] * 2)[0]
    assert stats.chisquare(pairs.reshape(-1)).pvalue > 0.01


def test_one_bit_of_seed_or_count_changes_half_of_the_bits():
    rng = np.random.default_rng(0)
    seeds, counts = rng.integers(SEEDS, size=2000), rng.integers(100_000, size=2000)

    def words(seeds, counts):
        return _words(seeds, counts.reshape(-1, 1, 1, 1, 1), frames(2000), 1, 1).reshape(-1)

    for bit in range(32):
        for changed in (words(seeds ^ (1 << bit), counts), words(seeds, counts ^ (1 << bit))):
            flips = ((changed ^ words(seeds, counts))[:, None] >> np.arange(32)) & 1
            assert np.all(np.abs(flips.mean(0) - 0.5) < 5 * 0.5 / np.sqrt(2000))


def test_the_hash_is_a_bijection_where_it_can_be_seen():
    some = np.arange(1 << 20)
    for step in (1, 4096, 12345):
        assert len(np.unique(_mix((some * step) & (SEEDS - 1)))) == len(np.unique((some * step) & (SEEDS - 1)))


def test_numbers_do_not_correlate():
    n = many(1000, normal)
    for lag in (1, 2, 5, 30, 60, 90):
        assert correlation(n[:, lag:], n[:, :-lag]) < 4, "elements"
    for lag in (1, 2, 3, 10, 100):
        assert correlation(n[lag:], n[:-lag]) < 4, "frames"
        assert correlation(n[lag:, lag:], n[:-lag, :-lag]) < 4, "both"
    for values in (n**2, np.abs(n), np.sign(n)):
        assert correlation(values[:, 90:], values[:, :90]) < 4, "the two numbers of one radius and angle"
        assert correlation(values[1:], values[:-1]) < 4
    matrix = np.corrcoef(n.T) - np.eye(SIZE)
    assert np.abs(matrix).max() * np.sqrt(1000) < 5


def test_seeds_streams_and_environments_do_not_correlate():
    x, zero = frames(1000), no_draws(frames(1000))
    first = normal(np.arange(1000), zero, x, 1)
    for other in (
        normal(np.arange(1000) + 1, zero, x, 1),
        normal(np.arange(1000) ^ (1 << 31), zero, x, 1),
        normal(np.arange(1000), zero + 1, x, 1),
        normal(np.arange(1000), zero, x, 2),
        normal(np.arange(1000) + 1, zero - 1, x, 1),
        normal(np.zeros(1000, int), np.arange(1000).reshape(-1, 1, 1, 1, 1), x, 1),
        normal(7, zero, x, 1),
    ):
        assert correlation(first, other) < 4
    one_seed = normal(7, zero, x, 1)
    for values in (first, one_seed):
        assert correlation(values[1:], values[:-1]) < 4
        assert len(np.unique(values)) == values.size


def test_no_key_comes_twice():
    # seeds and counts in the range of a training run give distinct keys; 63 bits of two words are compared
    seeds, counts = np.meshgrid(np.arange(500), np.arange(2000))
    x = np.zeros((seeds.size, 1, 1, 1, 1))
    words = _words(seeds.reshape(-1), counts.reshape(-1, 1, 1, 1, 1), x, 2, 1)
    assert len(np.unique(words[:, 0] * 2**31 + words[:, 1] // 2)) == len(words)


def test_a_seed_each_makes_an_environment_the_same_wherever_it_is():
    seeds = np.array([3, 14, 3, 0])
    n = normal(seeds, no_draws(frames(4)), frames(4), 1)
    np.testing.assert_array_equal(n[0], n[2])
    for i, seed in enumerate(seeds):
        np.testing.assert_array_equal(n[i], normal(seed, no_draws(frames()), frames(), 1))


def test_environments_that_share_a_seed_draw_their_own():
    n = normal(np.array([[1], [2]]), no_draws(frames(2, 3)), frames(2, 3), 1)
    assert n.shape == (2, 3, *FRAME)
    assert len(np.unique(n)) == n.size
    np.testing.assert_array_equal(n[1], normal(2, no_draws(frames(3)), frames(3), 1))


def test_an_odd_number_of_elements():
    x = np.zeros((1, 3, 1, 1))
    assert normal(1, no_draws(x), x, 1).shape == x.shape


def test_extremes():
    for seed in (0, SEEDS - 1):
        for count in (0, SEEDS - 1, SEEDS + 5, 2**62):
            n = normal(seed, no_draws(frames()) + count, frames(), 2**40)
            assert np.all(np.isfinite(n))
            assert np.unique(n).size == n.size
    # the smallest word gives the largest normal number
    assert np.sqrt(-2 * np.log(0.5 / SEEDS)) < 6.77


@pytest.mark.parametrize("seed", [0.0, np.array([1.0]), 1j, "1"])
def test_a_seed_that_is_no_integer_is_refused(seed):
    with pytest.raises(InvalidValueError, match=r"^Someone: seed must be integers, got"):
        check_seed("Someone", seed)


@needs_torch
def test_a_torch_seed_that_is_no_integer_is_refused():
    with pytest.raises(InvalidValueError, match="seed must be integers"):
        WhiteNoise(seed=torch.tensor(1.0))


# numpy and torch


@needs_torch
@pytest.mark.parametrize("seed", [7, SEEDS - 1, np.arange(4) + SEEDS - 4])
def test_torch_gives_the_same_bits_and_numbers(seed):
    x, count = frames(4), np.arange(4).reshape(4, 1, 1, 1, 1)
    tensor, counts = torch.as_tensor(x), torch.as_tensor(count)
    for each in (seed, torch.as_tensor(seed)):
        np.testing.assert_array_equal(_words(each, counts, tensor, SIZE, 1), _words(seed, count, x, SIZE, 1))
        np.testing.assert_array_equal(uniform(each, counts, tensor, 1), uniform(seed, count, x, 1))
        np.testing.assert_allclose(normal(each, counts, tensor, 1), normal(seed, count, x, 1), rtol=0, atol=1e-14)


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_the_dtype_is_that_of_the_frames(dtype):
    x = frames(2, dtype=dtype)
    for draw in (normal, uniform):
        assert draw(1, no_draws(x), x, 1).dtype == dtype
        double = draw(1, no_draws(x), frames(2), 1)
        np.testing.assert_array_equal(draw(1, no_draws(x), x, 1), double.astype(dtype))


@needs_torch
def test_under_compile_and_vmap():
    x, seeds = torch.zeros(4, *FRAME), torch.arange(4)
    expected = normal(seeds, no_draws(x), x, 1)

    def draw(seed, x):
        return normal(seed, no_draws(x), x, 1)

    torch.testing.assert_close(torch.compile(draw, fullgraph=True, backend="aot_eager")(seeds, x), expected)
    torch.testing.assert_close(torch.vmap(draw)(seeds, x), expected)
