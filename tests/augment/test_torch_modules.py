"""GCS and Chain as torch modules: what is drawn when, what is kept, and that it stays on the device."""

import copy
import io
import pickle

import numpy as np
import pytest

from paxisim import InvalidValueError, TaxelLayout, UnknownNameError
from paxisim.augment import AxisGain, LowPass, Poisson, TaxelGain
from paxisim.augment import chain as chains
from paxisim.augment.gcs import GCS as Paper

torch = pytest.importorskip("torch")
modules = pytest.importorskip("paxisim.augment.torch")

X = torch.as_tensor(np.random.default_rng(0).normal(size=(6, 2, 3, 6, 5)).astype(np.float32))
MASK = torch.tensor([True, False, False, True, False, True])


def fixed_chain():
    return chains.Chain([Poisson(0.1, 0.2), AxisGain((1.2, 0.8, 1.0)), TaxelGain(np.full((2, 6, 5), 1.5))])


def chain_module(**options):
    return modules.Chain(fixed_chain(), {"poisson.cx": (0.1, 0.3), "taxel_gain.gain": (0.5, 1.5)}, **options)


@pytest.fixture(params=["GCS", "Chain"])
def build(request):
    return modules.GCS if request.param == "GCS" else chain_module


def test_training_draws_for_each_sample_and_call(build):
    module = build()
    same = X[:1].expand(6, -1, -1, -1, -1).clone().requires_grad_()
    y = module(same)
    assert y.shape == X.shape
    assert all(not torch.equal(y[0], y[i]) for i in range(1, 6))
    assert not torch.equal(module(same), y)
    y.sum().backward()
    assert same.grad.isfinite().all()
    torch.manual_seed(1)
    first = module(X)
    torch.manual_seed(1)
    assert torch.equal(module(X), first)
    assert module(X[0]).shape == X[0].shape, "a single frame"


def test_episodes_keep_their_parameters_until_resampled(build):
    module = build(per="episode")
    y = module(X)
    assert torch.equal(module(X), y)
    module.resample(MASK)
    z = module(X)
    assert torch.equal(z[~MASK], y[~MASK])
    assert all(not torch.equal(z[i], y[i]) for i in range(6) if MASK[i])
    module.resample()
    assert not torch.equal(module(X)[~MASK], y[~MASK])
    module.resample()
    module.resample(MASK)  # no parameters are kept, so all are drawn
    assert module(X).shape == X.shape
    with pytest.raises(InvalidValueError, match="mask of the batch's shape"):
        module.resample(MASK[:3])


def test_kept_parameters_refuse_another_batch(build):
    module = build(per="episode")
    y = module(X)
    assert torch.equal(module(torch.stack([X, X]))[1], y), "a sequence of the batch"
    for x, words in ((X[0], "6 kept episodes, 1 frame without a batch given: pass a batch of 6"), (X[:3], "3 given")):
        with pytest.raises(InvalidValueError, match=words):
            module(x)
    module.resample()
    assert module(X[:3]).shape == X[:3].shape
    module.resample()
    assert module(X[0]).shape == X[0].shape


def test_eval():
    assert modules.GCS().eval()(X) is X
    assert chain_module(at_eval="identity").eval()(X) is X
    torch.testing.assert_close(chain_module().eval()(X), torch.as_tensor(fixed_chain()(X.numpy())))
    module = modules.GCS(at_eval="fixed").eval()
    one, several = module(X[:1]), module(X)
    assert not torch.equal(several, X)
    torch.testing.assert_close(several[:1], one)
    torch.manual_seed(3)
    expected = torch.rand(4)
    torch.manual_seed(3)
    other = modules.GCS(at_eval="fixed").eval()
    other.load_state_dict(module.state_dict())
    assert torch.equal(torch.rand(4), expected), "loading draws nothing"
    assert torch.equal(other(X), several)
    episodes = modules.GCS(per="episode", at_eval="fixed").eval()
    episodes(X)
    episodes.train()(X)
    assert episodes.kept["poisson"].cx.shape == X.shape[:1], "what was drawn in eval mode is dropped for training"


def test_a_chain_draws_only_what_it_is_told():
    torch.manual_seed(0)
    module = chain_module(per="episode")
    module(X)
    kept = module.kept
    assert kept["poisson"].cx.shape == (6,)
    assert kept["taxel_gain"].gain.shape == (6, 2, 6, 5)
    assert 0.5 <= kept["taxel_gain"].gain.min() < 0.55 < 1.45 < kept["taxel_gain"].gain.max() <= 1.5
    torch.testing.assert_close(kept["axis_gain"].gain, torch.tensor([1.2, 0.8, 1.0]))
    assert torch.equal(modules.Chain(fixed_chain())(X), modules.Chain(fixed_chain()).eval()(X))


def test_kept_parameters_travel(build):
    module = build(per="episode")
    y = module(X)
    assert torch.equal(copy.deepcopy(module)(X), y)
    assert torch.equal(pickle.loads(pickle.dumps(module))(X), y)
    file = io.BytesIO()
    torch.save(torch.nn.Sequential(module).state_dict(), file)
    file.seek(0)
    other = torch.nn.Sequential(build(per="episode"))
    other(X)
    other.load_state_dict(torch.load(file, weights_only=True))
    assert torch.equal(other(X), y)
    other.load_state_dict(torch.nn.Sequential(build(per="episode")).state_dict())
    assert not torch.equal(other(X), y), "no parameters were kept"


def test_nothing_waits_for_the_device(build):
    """A tensor on the meta device has no values, so any transfer to the host raises."""
    x, mask = X.to("meta"), MASK.to("meta")
    for module in (build().to("meta"), build(per="episode").to("meta")):
        assert module(x).device.type == "meta"
        module.resample(mask)
        assert module(x).shape == x.shape


TIP = TaxelLayout(6, 5, 2e-3, TaxelLayout(6, 5, 2e-3).positions, [[0, 0.1 * i, -1] for i in range(30)])


SLOW = [pytest.param(options, marks=pytest.mark.slow) for options in ({}, {"per": "episode", "layout": TIP})]


@pytest.mark.parametrize("options", [{"per": "episode"}, *SLOW])
def test_they_compile_in_one_graph(options, build):
    if "layout" in options and build is chain_module:
        return
    module = build(**options)
    if module.per == "episode":  # positions off the grid cannot be drawn within the graph
        expected = module(X)
    compiled = torch.compile(module, fullgraph=True, backend="aot_eager")
    y = compiled(X)
    if module.per == "episode":
        torch.testing.assert_close(y, expected)
    else:
        assert not torch.equal(compiled(X), y)


def test_the_ablation():
    module = modules.GCS(Paper(scaling=False), per="episode", layout=TIP)
    module(X)
    assert module.kept.names == ("poisson",)
    assert module.kept["poisson"].layout == TIP
    module = modules.GCS(Paper(scaling=False, convolution=False), per="episode")
    module(X)
    module.resample(MASK)
    assert torch.equal(module(X), X)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: modules.GCS(per="batch"), "per must be 'sample' or 'episode', got 'batch'"),
        (lambda: modules.GCS(at_eval="none"), "at_eval must be"),
        (lambda: modules.Chain(chains.Chain([LowPass(0.1)])), "no memory"),
        (lambda: modules.Chain(fixed_chain(), {"poison.cx": (0, 1)}), "unknown member of the chain 'poison'"),
        (lambda: modules.Chain(fixed_chain(), {"poisson.c": (0, 1)}), "unknown parameter of poisson 'c'"),
        (lambda: modules.Chain(fixed_chain(), {"poisson.cx": (1, 0)}), r"bounds of poisson\.cx must be in order"),
    ],
)
def test_bad_arguments(make, words):
    with pytest.raises((InvalidValueError, UnknownNameError), match=words):
        make()
