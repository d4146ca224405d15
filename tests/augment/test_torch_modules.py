import copy
import io
import pickle
import subprocess
import sys

import numpy as np
import pytest

from paxisim.augment import chain as chains
from paxisim.augment.gains import AxisGain, TaxelGain
from paxisim.augment.gcs import GCS as Paper
from paxisim.augment.low_pass import LowPass
from paxisim.augment.poisson import Poisson
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout

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
    same = X[:1].expand(6, -1, -1, -1, -1)
    y = module(same)
    assert y.shape == X.shape
    assert all(not torch.equal(y[0], y[i]) for i in range(1, 6))
    assert not torch.equal(module(same), y)
    torch.manual_seed(1)
    first = module(X)
    torch.manual_seed(1)
    assert torch.equal(module(X), first)


def test_a_single_frame(build):
    assert build()(X[0]).shape == X[0].shape


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


def test_eval():
    module = modules.GCS().eval()
    assert module(X) is X
    module = modules.GCS(at_eval="fixed").eval()
    assert torch.equal(module(X), module(X))
    assert not torch.equal(module(X), X)
    module = chain_module().eval()
    torch.testing.assert_close(module(X), torch.as_tensor(fixed_chain()(X.numpy())))
    assert chain_module(at_eval="identity").eval()(X) is X


def test_eval_takes_any_batch_and_loading_draws_nothing():
    module = modules.GCS(at_eval="fixed").eval()
    one, several = module(X[:1]), module(X)
    torch.testing.assert_close(several[:1], one)
    torch.manual_seed(3)
    expected = torch.rand(4)
    torch.manual_seed(3)
    other = modules.GCS(at_eval="fixed").eval()
    other.load_state_dict(module.state_dict())
    assert torch.equal(torch.rand(4), expected)
    assert torch.equal(other(X), several)
    episodes = modules.GCS(per="episode", at_eval="fixed").eval()
    episodes(X)
    assert episodes.train()(X).shape == X.shape
    assert episodes.kept["poisson"].cx.shape == X.shape[:1]


def test_a_chain_draws_only_what_it_is_told():
    torch.manual_seed(0)
    module = chain_module(per="episode")
    module(X)
    kept = module.kept
    assert kept["poisson"].cx.shape == (6,)
    assert kept["taxel_gain"].gain.shape == (6, 2, 6, 5)
    assert 0.5 <= kept["taxel_gain"].gain.min() <= kept["taxel_gain"].gain.max() <= 1.5
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
    assert module.to("meta")(X.to("meta")).device.type == "meta"


def test_nothing_waits_for_the_device(build):
    """A tensor on the meta device has no values, so any transfer to the host raises."""
    x, mask = X.to("meta"), MASK.to("meta")
    for module in (build().to("meta"), build(per="episode").to("meta")):
        assert module(x).device.type == "meta"
        module.resample(mask)
        assert module(x).shape == x.shape


@pytest.mark.parametrize("per", ["sample", "episode"])
def test_they_compile_in_one_graph(build, per):
    module = build(per=per)
    compiled = torch.compile(module, fullgraph=True, backend="aot_eager")
    if per == "episode":
        torch.testing.assert_close(compiled(X), module(X))
    else:
        y = compiled(X)
        assert y.shape == X.shape
        assert not torch.equal(compiled(X), y)


def test_positions_off_the_grid_compile_too():
    normals = [[0, 0.1 * i, -1] for i in range(30)]
    layout = TaxelLayout(6, 5, 2e-3, TaxelLayout(6, 5, 2e-3).positions, normals)
    module = modules.GCS(layout=layout, per="episode")
    y = module(X)
    torch.testing.assert_close(torch.compile(module, fullgraph=True, backend="aot_eager")(X), y)
    assert modules.GCS(layout=layout)(X).shape == X.shape


def test_gradients_pass(build):
    x = X.clone().requires_grad_()
    build()(x).sum().backward()
    assert x.grad is not None
    assert x.grad.isfinite().all()


def test_the_ablation():
    module = modules.GCS(Paper(scaling=False), per="episode")
    module(X)
    assert module.kept.names == ("poisson",)
    assert torch.equal(modules.GCS(Paper(scaling=False, convolution=False))(X), X)
    module = modules.GCS(Paper(scaling=False, convolution=False), per="episode")
    module(X)
    module.resample(MASK)
    assert torch.equal(module(X), X)


def test_bad_arguments():
    with pytest.raises(InvalidValueError, match="per must be 'sample' or 'episode', got 'batch'"):
        modules.GCS(per="batch")
    with pytest.raises(InvalidValueError, match="at_eval must be"):
        modules.GCS(at_eval="none")
    with pytest.raises(InvalidValueError, match="no memory"):
        modules.Chain(chains.Chain([LowPass(0.1)]))
    with pytest.raises(UnknownNameError, match="unknown member of the chain 'poison'"):
        modules.Chain(fixed_chain(), {"poison.cx": (0, 1)})
    with pytest.raises(UnknownNameError, match="unknown parameter of poisson 'c'"):
        modules.Chain(fixed_chain(), {"poisson.c": (0, 1)})
    with pytest.raises(InvalidValueError, match=r"bounds of poisson\.cx must be in order"):
        modules.Chain(fixed_chain(), {"poisson.cx": (1, 0)})


def test_without_torch_the_error_names_the_extra():
    code = """
import sys
sys.modules["torch"] = None
import paxisim.augment.gcs, paxisim.augment.history, numpy
from paxisim.errors import MissingExtraError
try:
    import paxisim.augment.torch
except MissingExtraError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert "pip install 'paxisim[torch]'" in done.stdout
