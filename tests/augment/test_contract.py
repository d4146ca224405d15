"""Contract of every transform: the same checks for all, over numpy and torch, float32 and float64.

`transform_examples.py` holds the example that each transform is checked with.
"""

from __future__ import annotations

import dataclasses
import inspect
import json
import math
import os
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from optional import needs_torch, torch
from transform_examples import EXAMPLES, FRAME

from paxisim.augment.chain import Chain, _known_transforms
from paxisim.augment.clocked import Clocked
from paxisim.augment.parameter_spec import parameters
from paxisim.augment.transform import STAGES, StatefulTransform, Transform
from paxisim.errors import InvalidValueError, UnknownNameError

KINDS = {
    name: kind
    for name, kind in _known_transforms().items()
    if kind.__module__.startswith("paxisim.augment.") and kind not in (StatefulTransform, Clocked)
}
NAMES = sorted(KINDS)
TIME = np.array([0.0, 0.011, 0.011, 0.06, 0.2, 0.213])
DTYPES = ["float32", "float64"]
TOLERANCE = {"float32": 1e-5, "float64": 1e-12}
BATCH = 4

every = pytest.mark.parametrize("name", NAMES)


def example(name: str, seed: int = 0) -> Transform:
    assert name in EXAMPLES, f"add an example of {name} to tests/augment/transform_examples.py"
    return EXAMPLES[name].make(np.random.default_rng(seed))


def frames(*batch: int, seed: int = 1, dtype: str = "float64") -> Any:
    """Return a sequence of forces ``(time, *batch, ...)``, some of them zero."""
    force = np.random.default_rng(seed).normal(size=(len(TIME), *batch, *FRAME))
    return (force * (np.abs(force) > 0.3)).astype(dtype)


def covariates(name: str, *batch: int, seed: int = 2) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    return {key: rng.uniform(*range_, (len(TIME), *batch)) for key, range_ in EXAMPLES[name].covariates.items()}


def at(series: dict[str, Any], index: Any) -> dict[str, Any]:
    return {key: values[index] for key, values in series.items()}


def with_parameters(transform: Transform, change: Any) -> Transform:
    """Return the transform with ``change(value)`` applied to each of its parameters."""
    if isinstance(transform, Chain):
        return Chain([with_parameters(member, change) for member in transform], transform.names)
    return dataclasses.replace(transform, **{name: change(getattr(transform, name)) for name in parameters(transform)})


def stacked(transforms: list[Transform]) -> Transform:
    """Combine transforms into one whose parameters have a batch axis."""
    if isinstance(transforms[0], Chain):
        return Chain([stacked(list(members)) for members in zip(*transforms, strict=True)], transforms[0].names)
    names = parameters(transforms[0])
    return dataclasses.replace(transforms[0], **{n: np.stack([getattr(t, n) for t in transforms]) for n in names})


def all_parameters(transform: Transform) -> set[str]:
    members = transform.members if isinstance(transform, Chain) else (transform,)
    return {name for member in members for name in parameters(member)}


def to_torch(transform: Transform) -> Transform:
    return with_parameters(transform, lambda value: torch.as_tensor(np.asarray(value)))


def assert_close(ours: Any, theirs: Any, dtype: str = "float64", scale: float | None = None) -> None:
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    scale = max(1.0, float(np.abs(theirs).max())) if scale is None else scale
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=TOLERANCE[dtype] * scale)


def test_every_transform_has_an_example():
    assert set(NAMES) == set(EXAMPLES)


@every
def test_it_is_described(name):
    kind = KINDS[name]
    assert kind.stage in STAGES
    assert dataclasses.is_dataclass(kind)
    assert kind.__dataclass_params__.frozen
    text = inspect.getdoc(kind)
    for field in dataclasses.fields(kind):
        assert re.search(rf"^ *{field.name}: ", text, re.MULTILINE), f"{name} does not describe {field.name}"
        assert not hasattr(Transform, field.name), f"the field {field.name} of {name} hides an attribute of Transform"
    for about in parameters(kind).values():
        if about.typical is not None:
            assert about.low <= about.typical[0] <= about.typical[1] <= about.high


@every
def test_it_is_frozen(name):
    transform = example(name)
    for field in dataclasses.fields(transform):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(transform, field.name, getattr(transform, field.name))


@every
def test_the_example_changes_the_tensor_and_leaves_its_input(name):
    x, given_ = frames(), frames()
    y = example(name).run(x, TIME, covariates(name))
    assert not np.allclose(y, x)
    np.testing.assert_array_equal(x, given_)


@every
@pytest.mark.parametrize("dtype", DTYPES)
def test_shape_and_dtype_are_kept(name, dtype):
    x = frames(BATCH, dtype=dtype)
    y = example(name).run(x, TIME, covariates(name, BATCH))
    assert type(y) is np.ndarray
    assert (y.shape, y.dtype) == (x.shape, x.dtype)


@needs_torch
@every
@pytest.mark.parametrize("dtype", DTYPES)
def test_torch_agrees_with_numpy(name, dtype):
    transform, x, series = example(name), frames(BATCH, dtype=dtype), covariates(name, BATCH)
    expected = transform.run(x, TIME, series)
    tensors = {key: torch.as_tensor(values) for key, values in series.items()}
    for kind in (transform, to_torch(transform)):
        y = kind.run(torch.as_tensor(x), TIME, tensors)
        assert y.dtype == getattr(torch, dtype)
        assert y.shape == x.shape
        assert_close(y, expected, dtype)


@every
@pytest.mark.parametrize("dtype", DTYPES)
def test_it_is_the_identity_at_neutral_parameters(name, dtype):
    if EXAMPLES[name].not_neutral:
        pytest.skip(EXAMPLES[name].not_neutral)
    x = frames(BATCH, dtype=dtype)
    np.testing.assert_array_equal(KINDS[name]().run(x, TIME, covariates(name, BATCH)), x)


numbers = st.floats(-1e6, 1e6) | st.sampled_from([0.0, -0.0, 1e6, -1e6, 1e-30, -1e-30, 1.0])


@every
@settings(max_examples=15, deadline=None)
@given(st.lists(numbers, min_size=1, max_size=6), st.integers(0, 2**32 - 1), st.sampled_from(DTYPES))
def test_finite_forces_give_finite_readings(name, values, seed, dtype):
    x = np.random.default_rng(seed).choice(values, (len(TIME), *FRAME)).astype(dtype)
    y = example(name, seed).run(x, TIME, covariates(name, seed=seed))
    assert np.all(np.isfinite(y))


@pytest.mark.parametrize("name", [name for name in NAMES if name in EXAMPLES and EXAMPLES[name].linear])
@settings(max_examples=10, deadline=None)
@given(st.floats(-100, 100), st.floats(-100, 100), st.integers(0, 2**32 - 1))
def test_it_is_linear(name, a, b, seed):
    def run(x):
        return example(name, seed).run(x, TIME, covariates(name))

    x, y = frames(seed=1), frames(seed=2)
    assert_close(run(a * x + b * y), a * run(x) + b * run(y), scale=10 * (1 + abs(a) + abs(b)))


@pytest.mark.parametrize("name", [name for name in NAMES if name in EXAMPLES and EXAMPLES[name].conserves_force])
@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_it_conserves_force(name, seed):
    x = frames(seed=seed)
    y = example(name, seed).run(x, TIME, covariates(name))
    assert_close(y.sum((-2, -1)), x.sum((-2, -1)), scale=10)


@every
def test_a_batch_of_parameters_is_a_loop_over_them(name):
    transforms = [example(name, seed) for seed in range(BATCH)]
    x, series = frames(BATCH), covariates(name, BATCH)
    together = stacked(transforms).run(x, TIME, series)
    for i, transform in enumerate(transforms):
        assert_close(together[:, i], transform.run(x[:, i], TIME, at(series, (slice(None), i))))


@every
def test_one_frame_for_a_batch_of_parameters(name):
    transforms = [example(name, seed) for seed in range(BATCH)]
    if transforms[0].has_memory or not all_parameters(transforms[0]):
        pytest.skip("one frame for a batch needs parameters and no memory")
    x, series = frames()[0], at(covariates(name), 0)
    together = stacked(transforms)(x, series)
    assert together.shape == (BATCH, *FRAME)
    for i, transform in enumerate(transforms):
        assert_close(together[i], transform(x, series))


@every
def test_one_sequence_for_a_batch_of_parameters(name):
    transforms = [example(name, seed) for seed in range(BATCH)]
    if not all_parameters(transforms[0]):
        pytest.skip("it has no numeric parameters")
    x, time = frames()[:BATCH], TIME[:BATCH]  # as many frames as environments, to catch a mix-up of their axes
    series = at(covariates(name), slice(BATCH))
    together = stacked(transforms).run(x, time, series)
    assert together.shape == (len(x), BATCH, *FRAME)
    for i, transform in enumerate(transforms):
        assert_close(together[:, i], transform.run(x, time, series))


@every
def test_a_sequence_is_its_frames_one_by_one(name):
    transform, x, series = example(name), frames(BATCH), covariates(name, BATCH)
    y = transform.run(x, TIME, series)
    state = transform.initial_state(x[0], at(series, 0))
    for i, dt in enumerate(np.diff(TIME, prepend=0.0)):
        each, state = transform.step(x[i], state, dt, at(series, i))
        assert_close(each, y[i])
    if not transform.has_memory:
        np.testing.assert_array_equal(transform(x, {k: v.reshape(*v.shape) for k, v in series.items()}), y)


@every
def test_a_reset_restarts_some_of_a_batch(name):
    transform, x, series = (
        stacked([example(name, seed) for seed in range(BATCH)]),
        frames(BATCH),
        covariates(name, BATCH),
    )
    again, mask = 3, np.array([True, False, True, False])
    undisturbed = transform.run(x, TIME, series)
    later = {key: values[again:] for key, values in series.items()}
    fresh = transform.run(x[again:], TIME[again:], later)
    state = transform.initial_state(x[0], at(series, 0))
    for i, dt in enumerate(np.diff(TIME, prepend=0.0)):
        dts = np.full(BATCH, dt)
        if i == again:
            state = transform.reset(state, mask, x[i], at(series, i))
            dts[mask] = 0.0
        y, state = transform.step(x[i], state, dts, at(series, i))
        if i >= again:
            assert_close(y[mask], fresh[i - again][mask])
        assert_close(y[~mask], undisturbed[i][~mask])


@every
def test_a_reset_of_some_parameters_that_see_one_stream(name):
    transforms = [example(name, seed) for seed in range(BATCH)]
    if not all_parameters(transforms[0]):
        pytest.skip("it has no numeric parameters")
    transform, mask = stacked(transforms), np.array([True, False, True, False])
    one, series = frames(), covariates(name)
    outputs = []
    for x in (one, np.repeat(one[:, None], BATCH, axis=1)):
        state = transform.initial_state(x[0], at(series, 0))
        for i, dt in enumerate(np.diff(TIME, prepend=0.0)):
            if i == 3:
                state = transform.reset(state, mask, x[i], at(series, i))
            y, state = transform.step(x[i], state, dt, at(series, i))
        outputs.append(y)
    assert_close(*outputs)


@every
def test_it_returns_from_json_bit_for_bit(name):
    for transform in (example(name), stacked([example(name, seed) for seed in range(BATCH)]), KINDS[name]()):
        text = Chain([transform]).to_json()
        json.loads(text, parse_constant=pytest.fail)  # strict: no NaN, no Infinity
        (again,) = Chain.from_json(text)
        assert Chain([again]).to_json() == text
        assert type(again) is type(transform)
        if not isinstance(transform, Chain):
            for field in dataclasses.fields(transform):
                assert_same(getattr(again, field.name), getattr(transform, field.name))
        series = covariates(name, BATCH)
        x = frames(BATCH)
        np.testing.assert_array_equal(again.run(x, TIME, series), transform.run(x, TIME, series))


def test_a_transform_that_is_not_there_is_said_to_be_imported_first():
    text = Chain([KINDS["Stiffening"]()]).to_json().replace("Stiffening", "Wrinkling")
    with pytest.raises(UnknownNameError, match="if Wrinkling is a transform of your own, import the module"):
        Chain.from_json(text)


def assert_same(ours: Any, theirs: Any) -> None:
    assert type(ours) is type(theirs)
    if isinstance(theirs, np.ndarray):
        assert (ours.dtype, ours.shape, ours.tobytes()) == (theirs.dtype, theirs.shape, theirs.tobytes())
    else:
        assert ours == theirs


@pytest.mark.parametrize(
    "member",
    [
        {"type": "Offset"},
        {"name": "a", "type": ["Offset"], "parameters": {}},
        {"name": "a", "type": "Offset", "parameters": None},
        {"name": "a", "type": "Offset", "parameters": [1.0]},
        {"name": "a", "type": "Offset", "parameters": {"value": {"dtype": "float32", "shape": [3], "data": [1.0]}}},
        {"name": "a", "type": "Offset", "parameters": {"value": {"dtype": "int64", "shape": [1], "data": [2**70]}}},
        {"name": "a", "type": "Offset", "parameters": {"value": {"dtype": "number", "shape": [1], "data": [1.0]}}},
        {"name": "a", "type": "LowPass", "parameters": {"tau": {"number": "abc"}}},
        {"name": "a", "type": "Poisson", "parameters": {"layout": {"layout": 5}}},
        {"name": "a", "type": "Poisson", "parameters": {"layout": {"layout": {"rows": 2}}}},
    ],
)
def test_json_that_is_no_chain_is_refused(member):
    with pytest.raises(InvalidValueError, match="lacks or misuses"):
        Chain.from_json(json.dumps({"format": "paxisim-chain/1", "members": [member]}))


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({}, "'members'"),
        ({"members": {}}, "expected a list of 'members'"),
        ({"members": [{"name": "a", "type": "Offset", "parameters": {}}]}, r"'a' \(Offset\) of the JSON lacks 'value'"),
    ],
)
def test_what_a_chain_lacks_is_not_made_up(document, words):
    with pytest.raises(InvalidValueError, match=words):
        Chain.from_json(json.dumps({"format": "paxisim-chain/1", **document}))


def test_a_chain_is_saved_whole_and_errors_name_its_file(tmp_path):
    path = tmp_path / "a.json"
    chain = Chain([KINDS["Stiffening"]()])
    chain.save(path)
    assert Chain.load(path).to_json() == chain.to_json()
    with pytest.raises(InvalidValueError, match="folder does not exist"):
        chain.save(tmp_path / "none" / "a.json")
    for content, words in ((b"\xff", "expected UTF-8 text, got the byte 0xff"), (b"{", "not JSON")):
        path.write_bytes(content)
        with pytest.raises(InvalidValueError, match=rf"a\.json: .*{words}"):
            Chain.load(path)
    path.write_text(chain.to_json().replace("Stiffening", "Stiffning"))
    with pytest.raises(UnknownNameError, match=r"did you mean 'Stiffening'.*; it is in .*a\.json"):
        Chain.load(path)
    path.write_bytes(b"{")
    os.link(path, tmp_path / "before")
    chain.save(path)  # writes a new file, which then replaces the old one
    assert (tmp_path / "before").read_bytes() == b"{"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "before"]


@needs_torch
def test_bfloat16_is_saved_as_float32():
    gain = torch.tensor([0.7, 1.0, 1.3], dtype=torch.bfloat16)
    (again,) = Chain.from_json(Chain([KINDS["AxisGain"](gain)]).to_json())
    assert again.gain.dtype == np.float32
    np.testing.assert_array_equal(again.gain, gain.float().numpy())


# torch: compile, vmap and gradients


def torch_inputs(name: str, *batch: int) -> tuple[Any, dict[str, Any]]:
    series = {key: torch.as_tensor(values) for key, values in covariates(name, *batch).items()}
    return torch.as_tensor(frames(*batch)), series


@needs_torch
@every
@pytest.mark.filterwarnings("ignore::DeprecationWarning:torch")
def test_it_compiles(name):
    x, series = torch_inputs(name, BATCH)
    torch._dynamo.reset()
    for transform in (example(name), to_torch(example(name))):
        state = transform.initial_state(x[0], at(series, 0))
        step = torch.compile(transform.step, fullgraph=True, backend="eager")
        y, after = step(x[1], state, 0.01, at(series, 1))
        expected, expected_after = transform.step(x[1], state, 0.01, at(series, 1))
        assert_close(y, expected)
        assert len(after) == len(expected_after)


@needs_torch
@every
def test_it_maps_over_a_batch(name):
    if EXAMPLES[name].random:
        pytest.skip("environments that share a seed draw by their index in the batch, which vmap hides")
    x, series = torch_inputs(name, BATCH)
    transform = to_torch(example(name))
    state = transform.initial_state(x[0], at(series, 0))
    expected, _ = transform.step(x[1], state, 0.01, at(series, 1))

    def step(x, state, covariates):
        return transform.step(x, state, 0.01, covariates)[0]

    in_dims = (0, 0 if state else None, 0 if series else None)
    assert_close(torch.vmap(step, in_dims=in_dims)(x[1], state, at(series, 1)), expected)


@needs_torch
@every
def test_it_maps_over_a_batch_with_its_parameters(name):
    if name == "Chain" or not parameters(KINDS[name]):
        pytest.skip("it has no numeric parameters")
    x, series = torch_inputs(name, BATCH)
    transform = to_torch(stacked([example(name, seed) for seed in range(BATCH)]))
    state = transform.initial_state(x[0], at(series, 0))
    expected, _ = transform.step(x[1], state, 0.01, at(series, 1))

    def step(values, x, state, covariates):
        return dataclasses.replace(transform, **values).step(x, state, 0.01, covariates)[0]

    in_dims = (0, 0, 0 if state else None, 0 if series else None)
    values = {key: getattr(transform, key) for key in parameters(transform)}
    assert_close(torch.vmap(step, in_dims=in_dims)(values, x[1], state, at(series, 1)), expected)


@needs_torch
@every
def test_it_maps_over_its_parameters(name):
    if name == "Chain":
        pytest.skip("a chain has no parameters of its own")
    x, series = torch_inputs(name)
    transform = to_torch(stacked([example(name, seed) for seed in range(BATCH)]))
    values = {key: getattr(transform, key) for key in parameters(transform)}
    if not values:
        pytest.skip("it has no numeric parameters")

    def run(values):
        return dataclasses.replace(transform, **values).run(x, TIME, series)

    together = torch.vmap(run)(values)
    for i in range(BATCH):
        assert_close(together[i], run({key: value[i] for key, value in values.items()}))


@needs_torch
@every
def test_its_gradients(name):
    if not EXAMPLES[name].differentiable:
        pytest.skip("it has a straight-through gradient, not that of the function")
    x, series = torch_inputs(name)
    transform = to_torch(example(name))
    own = {} if name == "Chain" else parameters(transform)
    fitted = [key for key in own if key not in EXAMPLES[name].no_gradient]

    def run(x, *values):
        changed = dataclasses.replace(transform, **dict(zip(fitted, values, strict=True)))
        return changed.run(x, TIME[:3], {key: value[:3] for key, value in series.items()})

    values = [getattr(transform, key).double().requires_grad_() for key in fitted]
    assert torch.autograd.gradcheck(run, (x[:3].clone().requires_grad_(), *values), fast_mode=True)


@needs_torch
@every
def test_gradients_are_finite_at_rest(name):
    series = torch_inputs(name)[1]
    x = torch.zeros((len(TIME), *FRAME), dtype=torch.float64, requires_grad=True)
    to_torch(example(name)).run(x, TIME, series).sum().backward()
    assert torch.isfinite(x.grad).all()


@needs_torch
@every
def test_gradients_pass_at_neutral_parameters(name):
    x, series = torch_inputs(name)
    x.requires_grad_()
    values = {}
    if name != "Chain":
        fitted = [key for key in parameters(KINDS[name]) if key not in EXAMPLES[name].no_gradient]
        values = {key: torch.as_tensor(np.asarray(getattr(KINDS[name](), key), float)) for key in fitted}
    for value in values.values():
        value.requires_grad_()
    transform = KINDS[name](**values)
    transform.run(x, TIME, series).sum().backward()
    if not EXAMPLES[name].not_neutral:
        assert_close(x.grad, np.ones(x.shape))
    for key, value in values.items():
        assert value.grad is None or torch.isfinite(value.grad).all(), key


# bad input


def names_of(transform: Transform) -> str:
    """Return a pattern for the name of the transform, or of a chain's member, in a message."""
    members = transform.members if isinstance(transform, Chain) else ()
    return "(" + "|".join([transform.name, *(member.name for member in members)]) + ")"


@every
@pytest.mark.parametrize("shape", [(2, 4, 6, 5), (3, 6, 5), (6, 5), ()])
def test_a_wrong_shape_is_refused(name, shape):
    transform, series = example(name), covariates(name)
    message = names_of(transform) + r" expected a tensor of shape \(\.\.\., pads, 3, rows, cols\)"
    with pytest.raises(InvalidValueError, match=message):
        transform.run(np.ones((len(TIME), *shape)), TIME, series)
    state = transform.initial_state(frames()[0], at(series, 0))
    with pytest.raises(InvalidValueError, match=message):
        transform.step(np.ones(shape), state, 0.01, at(series, 0))
    if not transform.has_memory:
        with pytest.raises(InvalidValueError, match=message):
            transform(np.ones(shape), at(series, 0))


@every
def test_integers_are_refused(name):
    transform, series = example(name), covariates(name)
    message = names_of(transform) + " expected a floating point tensor in newtons, got .*int"
    kinds = [frames().astype(int)] + ([torch.as_tensor(frames()).int()] if torch else [])
    for x in kinds:
        with pytest.raises(InvalidValueError, match=message):
            transform.run(x, TIME, series)
        state = transform.initial_state(frames()[0], at(series, 0))
        with pytest.raises(InvalidValueError, match=message):
            transform.step(x[0], state, 0.01, at(series, 0))


def bad_values(kind: type[Transform]) -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for key, about in parameters(kind).items():
        shape = [3 if axis in "kj" else 1 for axis in about.core]
        inside = max(about.low, 0.5) if about.high > 0.5 else about.high
        found += [(key, np.full(shape, math.nan)), (key, "soft"), (key, np.full(shape, 1j)), (key, [[1.0], [1.0, 2.0]])]
        if not about.infinite:
            found.append((key, np.full(shape, math.inf)))
        found += [(key, np.full(shape, bound - 1 - abs(bound))) for bound in [about.low] if math.isfinite(bound)]
        found += [(key, np.full(shape, bound + 1 + abs(bound))) for bound in [about.high] if math.isfinite(bound)]
        if about.core:
            found.append((key, np.full(shape[1:], inside)))
        if "k" in about.core:
            found.append((key, np.full([2 if axis == "k" else 1 for axis in about.core], inside)))
        if about.whole:
            found.append((key, np.full(shape, 0.5)))
    return found


@every
@pytest.mark.parametrize("dtype", ["float16", "float32"])
def test_the_ends_of_a_range_are_within_it_in_every_dtype(name, dtype):
    kind = KINDS[name]
    for key, about in parameters(kind).items():
        for bound in (about.low, about.high):
            if not math.isfinite(bound) or key == "seed":  # a seed is an integer
                continue
            value = np.full([3 if axis in "kj" else 1 for axis in about.core], bound, dtype)
            kind(**{key: value})
            if torch is not None:
                kind(**{key: torch.as_tensor(value)})


@every
def test_parameters_outside_their_range_are_refused(name):
    kind = KINDS[name]
    for key, value in bad_values(kind):
        with pytest.raises(InvalidValueError, match=f"^{name}: {key} must"):
            kind(**{key: value})
        if torch is not None and isinstance(value, np.ndarray) and value.dtype.kind == "f":
            with pytest.raises(InvalidValueError, match=f"^{name}: {key} must"):
                kind(**{key: torch.as_tensor(value)})


@every
def test_a_batch_that_does_not_match_is_refused(name):
    transform = stacked([example(name, seed) for seed in range(BATCH)])
    if not all_parameters(transform):
        pytest.skip("it has no numeric parameters")
    x, series = frames(BATCH - 1), covariates(name, BATCH - 1)
    message = names_of(transform) + f": ({'|'.join(all_parameters(transform))}) of shape .* does not fit a tensor"
    with pytest.raises(InvalidValueError, match=message):
        transform.run(x, TIME, series)


@every
def test_a_parameter_of_other_taxels_is_refused(name):
    transform = example(name)
    for key, about in parameters(KINDS[name]).items():
        if not set(about.core) & set("prc"):
            continue
        value = getattr(transform, key)
        grown = (
            np.concatenate([value, value[..., :1]], axis=-1) if "c" in about.core else np.concatenate([value, value])
        )
        changed = dataclasses.replace(transform, **{key: grown})
        with pytest.raises(InvalidValueError, match=f"^{name}: {key} of shape .* does not fit a tensor"):
            changed.run(frames(), TIME, covariates(name))
        # nor is a frame of one taxel broadcast to many
        small = frames()[:, :1, :, :1, :1]
        with pytest.raises(InvalidValueError, match=f"^{name}: .* of shape .* does not fit a tensor"):
            changed.run(small, TIME, covariates(name))


@pytest.mark.parametrize("name", [name for name in NAMES if name in EXAMPLES and EXAMPLES[name].covariates])
def test_a_missing_or_misshapen_covariate_is_refused(name):
    transform = example(name)
    for key in transform.covariate_names:
        others = [n for n in transform.covariate_names if n != key]
        there = ", ".join(others) or "none"
        with pytest.raises(InvalidValueError, match=f"^{name} needs the covariate '{key}'; available: {there}"):
            transform.run(frames(), TIME, {"unneeded": TIME, **dict.fromkeys(others, TIME)})
        with pytest.raises(InvalidValueError, match=f"^{name}: the covariate '{key}' of shape"):
            transform.run(frames(BATCH), TIME, {**covariates(name, BATCH), key: covariates(name, BATCH - 1)[key]})


@every
def test_time_must_not_run_backwards(name):
    transform, x, series = example(name), frames(), covariates(name)
    for bad in (TIME[::-1], TIME * math.nan):
        with pytest.raises(
            InvalidValueError, match=names_of(transform) + ".*time must be finite and must not run backw"
        ):
            transform.run(x, bad, series)
    for bad in (TIME[:-1], TIME[:, None]):
        with pytest.raises(InvalidValueError, match=names_of(transform) + " expected one time for each of 6 frames"):
            transform.run(x, bad, series)
    state = transform.initial_state(x[0], at(series, 0))
    for bad in (-0.01, math.nan, math.inf, np.float32(-0.01), np.asarray(-0.01)):
        with pytest.raises(InvalidValueError, match=names_of(transform) + ".*dt"):
            transform.step(x[1], state, bad, at(series, 1))


@every
def test_streams_of_a_batch_may_have_clocks_of_their_own(name):
    transform = example(name)
    if "seed" in all_parameters(transform):
        pytest.skip("its draws differ along the batch")
    x, series = frames(BATCH), covariates(name, BATCH)
    time = TIME[:, None] * np.linspace(0.5, 2.0, BATCH)
    together = transform.run(x, time, series)
    for i in range(BATCH):
        alone = {key: values[:, i] for key, values in series.items()}
        assert_close(together[:, i], transform.run(x[:, i], time[:, i], alone))
