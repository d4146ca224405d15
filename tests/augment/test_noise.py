"""White noise and the random walk: distribution and reproducibility."""

import dataclasses

import numpy as np
from responses import both, everywhere, times
from scipy import stats
from transform_examples import FRAME

from paxisim.augment.chain import Chain
from paxisim.augment.latency import Latency
from paxisim.augment.noise import RandomWalk, WhiteNoise


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
