"""Contract of every transform in torch: the numbers of numpy, vmap, compilation and gradients."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from transform_examples import BATCH, KINDS, TIME, assert_close, at, every, example, inputs, stacked, with_parameters

from paxisim.augment.chain import Chain
from paxisim.augment.parameter_spec import parameters
from paxisim.augment.transform import Transform

torch = pytest.importorskip("torch")
NO_GRADIENT = ("dead", "stuck", "since", "seed")  # parameters


def to_torch(transform: Transform) -> Transform:
    return with_parameters(lambda value: torch.as_tensor(np.asarray(value)), transform)


def own_parameters(name: str) -> list[str]:
    """Return the names of the numeric parameters; a chain has none of its own."""
    return [] if name == "Chain" else list(parameters(KINDS[name]))


def torch_inputs(name: str, *batch: int) -> tuple[Any, dict[str, Any]]:
    x, series = inputs(name, *batch)
    return torch.as_tensor(x), {key: torch.as_tensor(values) for key, values in series.items()}


@every
@pytest.mark.parametrize(("dtype", "tolerance"), [("float32", 1e-5), ("float64", 1e-12)])
def test_it_agrees_with_numpy(name, dtype, tolerance):
    transform, (x, series) = example(name), inputs(name, BATCH, dtype=dtype)
    expected = transform.run(x, TIME, series)
    tensors = {key: torch.as_tensor(values) for key, values in series.items()}
    for kind in (transform, to_torch(transform)):
        y = kind.run(torch.as_tensor(x), TIME, tensors)
        assert y.dtype == getattr(torch, dtype)
        assert_close(y, expected, tolerance)


@every
def test_it_maps_over_its_streams_and_parameters(name):
    x, series = torch_inputs(name, BATCH)
    transform = to_torch(example(name) if name == "Chain" else stacked(name))
    values = {key: getattr(transform, key) for key in own_parameters(name)}
    state = transform.initial_state(x[0], at(series, 0))
    expected, _ = transform.step(x[1], state, 0.01, at(series, 1))

    def step(values, x, state, covariates):
        return dataclasses.replace(transform, **values).step(x, state, 0.01, covariates)[0]

    in_dims = (0 if values else None, 0, 0 if state else None, 0 if series else None)
    assert_close(torch.vmap(step, in_dims=in_dims)(values, x[1], state, at(series, 1)), expected)
    if not values:
        return
    x, series = torch_inputs(name)  # one stream for all parameters

    def run(values):
        return dataclasses.replace(transform, **values).run(x, TIME, series)

    together = torch.vmap(run)(values)
    for i in range(BATCH):
        assert_close(together[i], run(at(values, i)))


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(KINDS))
@pytest.mark.filterwarnings("ignore::DeprecationWarning:torch")
def test_it_compiles_in_one_graph(name):
    x, series = torch_inputs(name, BATCH)
    torch._dynamo.reset()
    for transform in (example(name), to_torch(example(name))):
        begin, step, reset = (
            torch.compile(method, fullgraph=True, backend="aot_eager" if transform.has_memory else "eager")
            for method in (transform.initial_state, transform.step, transform.reset)
        )
        expected, state = transform.run(x, TIME, series), begin(x[0], at(series, 0))
        for i, dt in enumerate(np.diff(TIME, prepend=0.0)):
            y, state = step(x[i], state, torch.full((BATCH,), dt, dtype=torch.float64), at(series, i))
            assert_close(y, expected[i])
        mask = torch.arange(BATCH) % 2 == 0
        state = reset(state, mask, x[0], at(series, 0))
        y, _ = step(x[0], state, torch.zeros(BATCH, dtype=torch.float64), at(series, 0))
        assert_close(y[mask], expected[0][mask])


@pytest.mark.parametrize("name", sorted({*KINDS} - {"Firmware", "Quantisation"}))
def test_its_gradients(name):
    x, series = torch_inputs(name)
    transform = to_torch(example(name))
    fitted = [key for key in own_parameters(name) if key not in NO_GRADIENT]

    def run(x, *values):
        changed = dataclasses.replace(transform, **dict(zip(fitted, values, strict=True)))
        return changed.run(x, TIME[:3], at(series, slice(3)))

    values = [getattr(transform, key).double().requires_grad_() for key in fitted]
    assert torch.autograd.gradcheck(run, (x[:3].clone().requires_grad_(), *values), fast_mode=True)


@every
def test_gradients_are_finite_at_rest_and_pass_at_neutral_parameters(name):
    x, series = torch_inputs(name)
    at_rest = torch.zeros_like(x, requires_grad=True)
    to_torch(example(name)).run(at_rest, TIME, series).sum().backward()
    assert torch.isfinite(at_rest.grad).all()
    fitted = [key for key in own_parameters(name) if key not in NO_GRADIENT]
    values = {key: torch.tensor(np.asarray(getattr(KINDS[name](), key), float), requires_grad=True) for key in fitted}
    KINDS[name](**values).run(x.requires_grad_(), TIME, series).sum().backward()
    if name != "Firmware":
        assert_close(x.grad, np.ones(x.shape))
    for key, value in values.items():
        assert value.grad is None or torch.isfinite(value.grad).all(), key


def test_bfloat16_is_saved_as_float32():
    gain = torch.tensor([0.7, 1.0, 1.3], dtype=torch.bfloat16)
    (again,) = Chain.from_json(Chain([KINDS["AxisGain"](gain)]).to_json())
    assert again.gain.dtype == np.float32
    np.testing.assert_array_equal(again.gain, gain.float().numpy())
