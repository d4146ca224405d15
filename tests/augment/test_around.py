"""`GCS.around` draws chains around a fitted model, each parameter within its interval."""

import numpy as np
import pytest
from forces import needs_torch, torch
from scipy import stats

from paxisim import GCS, Chain, InvalidValueError, UnknownNameError
from paxisim.augment import AxisGain, Creep, FittedGCS, Hysteresis, Latency, LowPass, RandomWalk, TaxelGain, WhiteNoise

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


@pytest.fixture(params=["numpy", pytest.param("torch", marks=needs_torch)])
def rng(request):
    return np.random.default_rng(0) if request.param == "numpy" else torch.Generator().manual_seed(0)


def assert_uniform(values, low, high):
    """Fail unless numbers are uniform; the seeds are fixed."""
    assert stats.kstest(np.asarray(values).reshape(-1), stats.uniform(low, high - low).cdf).pvalue > 1e-3


def test_numbers_with_an_interval_are_uniform_over_it_and_the_others_stay(rng):
    chain = GCS.around(MODEL, INTERVALS).sample(rng, (4000,))
    assert chain.names == MODEL.names
    amplitude = np.asarray(chain["creep"].amplitude)
    assert amplitude.shape == (4000, 2)
    assert_uniform(amplitude[:, 0], 0.05, 0.15)
    np.testing.assert_allclose(amplitude[:, 1], 0.02, rtol=1e-6)
    gain = np.asarray(chain["taxel_gain"].gain)
    assert gain.shape == (4000, 2, 6, 5)
    assert_uniform((gain - GAINS).reshape(-1)[::17], -0.05, 0.05)
    assert_uniform(chain["low_pass"]["low_pass_2"].tau, 0.01, 0.03)
    assert_uniform(chain["latency"].delay, 0, 0.05)  # no drawn latency reads ahead
    assert chain["low_pass"]["low_pass"].tau == 0.05
    assert chain["creep"].tau == (0.5, 5.0)
    assert chain["hysteresis"] is MODEL["hysteresis"]
    assert FittedGCS(model=MODEL).sample(rng).to_json() == MODEL.to_json(), "without intervals it is the model"


def test_a_latency_that_reads_ahead_is_left_out_and_one_of_many_environments_stays(rng):
    ahead = MODEL.replace(latency=Latency(-0.03))
    assert "latency" not in GCS.around(ahead, {"latency": {"delay": (-0.05, -0.01)}}).sample(rng).names
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


def test_noise_differs_between_chains_and_environments(rng):
    model = Chain([WhiteNoise(0.1), RandomWalk(0.1), Latency(0.02, jitter=0.01)])
    gcs = GCS.around(model, {"latency": {"delay": (0.01, 0.03)}})
    several = gcs.sample(rng, (3,))
    seeds = np.concatenate([np.asarray(member.seed) for member in several])
    assert len(np.unique(seeds)) == 9
    assert seeds.max() > 2**16
    x = np.zeros((1, 2, 3, 6, 5)) if isinstance(rng, np.random.Generator) else torch.zeros((1, 2, 3, 6, 5))
    first, second = (np.asarray(gcs.sample(rng)["white_noise"].run(x, np.zeros(1))) for _ in range(2))
    assert abs(np.corrcoef(first.ravel(), second.ravel())[0, 1]) < 0.5


def test_a_seed_and_the_intervals_in_any_order_give_one_chain_and_the_surfaces_of_gcs():
    backwards = {name: INTERVALS[name] for name in reversed(INTERVALS)}
    one, other = (GCS.around(MODEL, own).sample(np.random.default_rng(3)) for own in (INTERVALS, backwards))
    assert one.to_json() == other.to_json() != MODEL.to_json()
    assert Chain.from_json(one.to_json()).to_json() == one.to_json()
    ours, theirs = (gcs.sample_surface(np.random.default_rng(0), (3,)) for gcs in (GCS(), GCS.around(MODEL, INTERVALS)))
    np.testing.assert_array_equal(ours, theirs)


@needs_torch
def test_the_torch_module_takes_it_where_there_is_no_memory():
    from paxisim.augment.torch import GCS as Module

    module = Module(GCS.around(MODEL[2:4], {"taxel_gain": INTERVALS["taxel_gain"]}))
    torch.manual_seed(0)
    ratio = (module(torch.ones(5, 2, 3, 6, 5))[:, :, 2] / torch.as_tensor(GAINS, dtype=torch.float32)).numpy()
    assert 0.94 < ratio.min() < 0.96 < 1.04 < ratio.max() < 1.06
    assert np.ptp(ratio, axis=0).min() > 0


@pytest.mark.parametrize(
    ("intervals", "error", "words"),
    [
        ({"krep": {}}, UnknownNameError, "creep"),
        ({"creep": {"amplitud": (0, 1)}}, UnknownNameError, "amplitude"),
        ({"creep": {"amplitude": ([0.0, 0.0], 1.0)}}, InvalidValueError, r"must have its shape \(2,\)"),
        ({"latency": {"delay": (0.1, 0.0)}}, InvalidValueError, "latency.delay must be finite and in order"),
        ({"latency": {"delay": (0.1, np.inf)}}, InvalidValueError, "must be finite"),
        ({"latency": {"delay": 0.1}}, InvalidValueError, r"latency.delay must be \(low, high\)"),
        ({"latency": 0.1}, InvalidValueError, "must be a mapping by parameter"),
        ({"low_pass": {"tau": (0.1, 0.2)}}, UnknownNameError, "low_pass"),
        ({"latency": {"seed": (0, 9)}}, InvalidValueError, "latency.seed is a whole number"),
        ({"hysteresis": {"weight": ([0.5, 0.6], [0.9, 0.9])}}, InvalidValueError, "sum to more than 1"),
    ],
)
def test_what_is_refused(intervals, error, words):
    with pytest.raises(error, match=words):
        GCS.around(MODEL, intervals)
    with pytest.raises(InvalidValueError, match="the model must be a Chain, got Creep"):
        GCS.around(Creep(), {})
