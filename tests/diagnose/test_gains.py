"""Taxel gains: exact where episodes agree, shrunk towards their mean as far as episodes disagree."""

import numpy as np
import pytest

from paxisim.diagnose.causes.taxel_gain import GAIN_PRIOR, drawn

SHAPE = (2, 6, 5)


def summed(gains, off, weights, rng):
    """Return the pulls of episodes whose gains differ from the common ones by `off` times standard normal numbers."""
    own = gains - 1 + off * rng.standard_normal(weights.shape)
    return own * weights + np.sqrt(weights) * rng.standard_normal(weights.shape)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.fixture
def weights(rng):
    """Load of each taxel in eight episodes: high, low or zero."""
    weights = rng.choice([0.0, 300.0, 3e4], size=(8, *SHAPE), p=[0.5, 0.3, 0.2])
    weights[:, 0, 0] = 0.0
    return weights


def test_gains_that_all_episodes_agree_on_are_found(rng, weights):
    spread = 0.05
    gains = 1 + spread * rng.standard_normal(SHAPE)
    away, ridge = drawn(summed(gains, 0.0, weights, rng), weights)
    weight = weights.sum(axis=0)
    error = (1 + away - gains) * np.sqrt(weight)
    assert np.sqrt(np.mean(error[weight > 1e4] ** 2)) < 1.5, "gains should be as accurate as the noise permits"
    assert 0.5 < 1 / np.sqrt(ridge) / spread < 2
    assert np.ptp(away[weight == 0]) < 1e-12, "taxels that were never pressed should share one common gain"


def test_where_episodes_disagree_gains_are_drawn_together_and_so_to_the_truth(rng, weights):
    gains = 1 + 0.05 * rng.standard_normal(SHAPE)
    pulls = summed(gains, 0.15, weights, rng)
    away, ridge = drawn(pulls, weights)
    alone = pulls.sum(axis=0) / (weights.sum(axis=0) + 1 / GAIN_PRIOR**2)
    assert ridge > 3 / GAIN_PRIOR**2
    assert np.sum((1 + away - gains) ** 2) < 0.7 * np.sum((1 + alone - gains) ** 2)
    away, ridge = drawn(summed(gains - 0.2, 0.1, weights, rng), weights)
    assert ridge > 5 / 0.05**2, "a single gain would be shrunk strongly"
    assert np.mean(away) == pytest.approx(-0.2, abs=0.03), "a gain of all taxels is kept"


def test_without_any_effect_gains_stay_at_1_and_with_one_episode_nothing_breaks(rng, weights):
    away, _ = drawn(summed(np.ones(SHAPE), 0.02, weights, rng), weights)
    assert np.sqrt(np.mean(away**2)) < 0.015
    lone = np.full((1, *SHAPE), 3e4)
    away, _ = drawn(summed(np.full(SHAPE, 1.1), 0.0, lone, rng), lone)
    assert np.median(away) == pytest.approx(0.1, abs=0.01), "a single episode should be trusted"
    nothing, _ = drawn(np.zeros((3, *SHAPE)), np.zeros((3, *SHAPE)))
    assert np.all(nothing == 0)
