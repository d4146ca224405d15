"""`GCS.around` draws chains around a fitted model, each parameter within its interval."""

import numpy as np
import pytest
from optional import needs_torch, torch
from scipy import stats

from paxisim import GCS
from paxisim.augment.chain import Chain
from paxisim.augment.creep import Creep
from paxisim.augment.gains import AxisGain, TaxelGain
from paxisim.augment.gcs import FittedGCS
from paxisim.augment.hysteresis import Hysteresis
from paxisim.augment.latency import Latency
from paxisim.augment.low_pass import LowPass
from paxisim.augment.noise import RandomWalk, WhiteNoise
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout

GAINS = np.linspace(0.9, 1.1, 60).reshape(2, 6, 5)
MODEL = Chain(
    [
        Creep((0.1, 0.02), (0.5, 5.0)),
        Hysteresis((0.1, 0.05), (0.2, 1.0)),
        AxisGain((1.1, 0.9, 1.0)),
        TaxelGain(GAINS),
        Chain([LowPass(0.05), LowPass(0.02)]),
        Latency(0.03),
    ],
    ["creep", "hysteresis", "axis_gain", "taxel_gain", "low_pass", "latency"],
)
INTERVALS = {
    "creep": {"amplitude": ([0.05, 0.02], [0.15, 0.02])},
    "taxel_gain": {"gain": (GAINS - 0.05, GAINS + 0.05)},
    "low_pass": {"low_pass_2": {"tau": (0.01, 0.03)}},
    "latency": {"delay": (-0.01, 0.05)},
}
LEAST_P = 1e-3  # smallest accepted p-value; the seeds are fixed


@pytest.fixture(params=["numpy", pytest.param("torch", marks=needs_torch)])
def rng(request):
    return np.random.default_rng(0) if request.param == "numpy" else torch.Generator().manual_seed(0)


def test_numbers_with_an_interval_are_uniform_over_it_and_the_others_stay(rng):
    chain = GCS.around(MODEL, INTERVALS).sample(rng, (4000,))
    assert chain.names == MODEL.names
    amplitude = np.asarray(chain["creep"].amplitude)
    assert amplitude.shape == (4000, 2)
    assert stats.kstest(amplitude[:, 0], stats.uniform(0.05, 0.1).cdf).pvalue > LEAST_P
    np.testing.assert_allclose(amplitude[:, 1], 0.02, rtol=1e-6)
    gain = np.asarray(chain["taxel_gain"].gain)
    assert gain.shape == (4000, 2, 6, 5)
    assert stats.kstest((gain - GAINS).reshape(-1)[::17], stats.uniform(-0.05, 0.1).cdf).pvalue > LEAST_P
    tau = np.asarray(chain["low_pass"]["low_pass_2"].tau)
    assert stats.kstest(tau, stats.uniform(0.01, 0.02).cdf).pvalue > LEAST_P
    assert chain["low_pass"]["low_pass"].tau == 0.05
    assert chain["creep"].tau == (0.5, 5.0)
    assert chain["hysteresis"] is MODEL["hysteresis"]


def test_no_drawn_latency_reads_ahead(rng):
    delay = np.asarray(GCS.around(MODEL, INTERVALS).sample(rng, (500,))["latency"].delay)
    assert delay.min() >= 0
    assert stats.kstest(delay, stats.uniform(0.0, 0.05).cdf).pvalue > LEAST_P
    ahead = MODEL.replace(latency=Latency(-0.03))
    assert "latency" not in GCS.around(ahead, {"latency": {"delay": (-0.05, -0.01)}}).sample(rng).names


def test_a_latency_of_many_environments_stays(rng):
    model = Chain([Latency(np.array([0.01, 0.02]))])
    assert GCS.around(model, {}).sample(rng)["latency"] is model["latency"]


@pytest.mark.parametrize("radius", [(0.1, 0.5), (0.1,)])
def test_weights_of_a_hysteresis_sum_to_1_at_most(rng, radius):
    low, high = [0.3, 0.2], [0.7, 0.6]
    gcs = GCS.around(Chain([Hysteresis((0.5, 0.4), radius)]), {"hysteresis": {"weight": (low, high)}})
    weight = np.asarray(gcs.sample(rng, (4000,))["hysteresis"].weight)
    np.testing.assert_allclose(weight.sum(-1).max(), 1, rtol=1e-6)
    assert 0.4 < np.mean(weight.sum(-1) < 0.9999) < 0.8
    assert np.all((weight > np.array(low) - 1e-6) & (weight < np.array(high) + 1e-6))
    one = GCS.around(Chain([Hysteresis((0.3,), (0.1, 0.5, 1.0))]), {"hysteresis": {"weight": ([0.2], [0.4])}})
    np.testing.assert_allclose(np.asarray(one.sample(rng, (4000,))["hysteresis"].weight).max(), 1 / 3, rtol=1e-6)


def test_a_batch_is_stepped_each_environment_with_its_own(rng):
    chain = GCS.around(MODEL, INTERVALS).sample(rng, (4,))
    x = np.random.default_rng(1).uniform(0, 5, (8, 4, 2, 3, 6, 5)).astype(np.float32)
    frames = torch.as_tensor(x) if not isinstance(rng, np.random.Generator) else x
    state, out = chain.initial_state(frames[0]), []
    for i in range(len(x)):
        y, state = chain.step(frames[i], state, 0.02 if i else 0.0)
        out.append(np.asarray(y))
    assert out[-1].dtype == np.float32
    assert np.ptp(np.asarray(out) - np.asarray(out)[:, :1], axis=(0, 2, 3, 4, 5))[1:].min() > 0
    np.testing.assert_allclose(out, np.asarray(chain.run(frames, np.arange(8) * 0.02)), atol=1e-5)


def test_noise_differs_between_chains_and_environments(rng):
    model = Chain([WhiteNoise(0.1), RandomWalk(0.1), Latency(0.02, jitter=0.01)])
    gcs = GCS.around(model, {"latency": {"delay": (0.01, 0.03)}})
    several = gcs.sample(rng, (3,))
    seeds = np.concatenate([np.asarray(member.seed) for member in several])
    assert len(np.unique(seeds)) == 9
    assert seeds.max() > 2**16
    x = np.zeros((2, 3, 6, 5)) if isinstance(rng, np.random.Generator) else torch.zeros((2, 3, 6, 5))
    first, second = (np.asarray(gcs.sample(rng)["white_noise"].run(x[None], np.zeros(1))) for _ in range(2))
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.5
    assert Chain.from_json(several.to_json()) is not None


def test_one_chain_is_reproducible_and_saves():
    gcs = GCS.around(MODEL, INTERVALS)
    one, other = (gcs.sample(np.random.default_rng(3)) for _ in range(2))
    assert one.to_json() == other.to_json() != MODEL.to_json()
    assert Chain.from_json(one.to_json()).to_json() == one.to_json()
    backwards = {name: INTERVALS[name] for name in reversed(INTERVALS)}
    assert GCS.around(MODEL, backwards).sample(np.random.default_rng(3)).to_json() == one.to_json()


def test_surfaces_are_drawn_as_by_gcs():
    layout = TaxelLayout(6, 5, 4e-3)
    ours = GCS.around(MODEL, INTERVALS).sample_surface(np.random.default_rng(0), (3,), layout=layout)
    np.testing.assert_array_equal(ours, GCS().sample_surface(np.random.default_rng(0), (3,), layout=layout))


def test_without_intervals_it_is_the_model():
    assert FittedGCS(model=MODEL).sample(np.random.default_rng(0)).to_json() == MODEL.to_json()


@needs_torch
def test_the_torch_module_takes_it_where_there_is_no_memory():
    from paxisim.augment.torch import GCS as Module

    module = Module(GCS.around(MODEL[2:4], {"taxel_gain": INTERVALS["taxel_gain"]}))
    torch.manual_seed(0)
    y = module(torch.ones(5, 2, 3, 6, 5))
    assert y.shape == (5, 2, 3, 6, 5)
    ratio = (y[:, :, 2] / torch.as_tensor(GAINS, dtype=torch.float32)).numpy()
    assert 0.94 < ratio.min() < 0.96 < 1.04 < ratio.max() < 1.06
    assert np.ptp(ratio, axis=0).min() > 0


def test_the_wrapper_of_environments_takes_it():
    gymnasium = pytest.importorskip("gymnasium")
    from paxisim.augment.gym import TactileTransform

    class Touch(gymnasium.Env):
        observation_space = gymnasium.spaces.Box(0, 10, (2, 3, 6, 5), np.float32)
        action_space = gymnasium.spaces.Discrete(2)

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            return np.ones((2, 3, 6, 5), np.float32), {}

        def step(self, action):
            return np.full((2, 3, 6, 5), 2, np.float32), 0.0, False, False, {}

    env = TactileTransform(Touch(), GCS.around(MODEL, INTERVALS), dt=0.05)
    drawn = []
    for seed in (0, 1, 0):
        env.reset(seed=seed)
        env.step(0)
        drawn.append(float(np.asarray(env.transform["creep"].amplitude)[0]))
    assert drawn[0] == drawn[2] != drawn[1]


@pytest.mark.parametrize(
    ("intervals", "error", "match"),
    [
        ({"krep": {}}, UnknownNameError, "creep"),
        ({"creep": {"amplitud": (0, 1)}}, UnknownNameError, "amplitude"),
        ({"creep": {"amplitude": (0.0, 1.0)}}, InvalidValueError, r"must have its shape \(2,\)"),
        ({"latency": {"delay": (0.1, 0.0)}}, InvalidValueError, "latency.delay must be finite and in order"),
        ({"latency": {"delay": (0.1, np.inf)}}, InvalidValueError, "must be finite"),
        ({"latency": {"delay": 0.1}}, InvalidValueError, r"latency.delay must be \(low, high\)"),
        ({"latency": 0.1}, InvalidValueError, "must be a mapping by parameter"),
        ({"low_pass": {"tau": (0.1, 0.2)}}, UnknownNameError, "low_pass"),
        ({"latency": {"seed": (0, 9)}}, InvalidValueError, "latency.seed is a whole number"),
        ({"hysteresis": {"weight": ([0.5, 0.6], [0.9, 0.9])}}, InvalidValueError, "sum to more than 1"),
    ],
)
def test_bad_intervals(intervals, error, match):
    with pytest.raises(error, match=match):
        GCS.around(MODEL, intervals)


def test_a_model_is_a_chain():
    with pytest.raises(InvalidValueError, match="the model must be a Chain, got Creep"):
        GCS.around(Creep(), {})
