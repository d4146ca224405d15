"""Contract of every transform in numpy: what it does to shapes, batches, streams and files.

`transform_examples.py` holds the example that each transform is checked with. `test_contract_torch.py` is the same for
torch, `test_contract_refusals.py` says what every transform refuses.
"""

from __future__ import annotations

import dataclasses
import inspect
import json
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from transform_examples import (
    BATCH,
    FRAME,
    KINDS,
    TIME,
    assert_close,
    at,
    every,
    example,
    inputs,
    keys_of,
    stacked,
    with_parameters,
)

from paxisim.augment.chain import Chain
from paxisim.augment.parameter_spec import parameters
from paxisim.augment.transform import STAGES, Transform


@every
def test_it_is_described(name):
    kind = KINDS[name]
    assert kind.stage in STAGES
    assert kind.__dataclass_params__.frozen
    text = inspect.getdoc(kind)
    for field in dataclasses.fields(kind):
        assert re.search(rf"^ *{field.name}: ", text, re.MULTILINE), f"{name} does not describe {field.name}"
        assert not hasattr(Transform, field.name), f"the field {field.name} of {name} hides an attribute of Transform"
    for about in parameters(kind).values():
        if about.typical is not None:
            assert about.low <= about.typical[0] <= about.typical[1] <= about.high


@every
def test_it_changes_the_values_unless_neutral_and_nothing_else(name):
    for dtype in ("float32", "float64"):
        x, series = inputs(name, BATCH, dtype=dtype)
        given_ = x.copy()
        y = example(name).run(x, TIME, series)
        assert type(y) is np.ndarray
        assert (y.shape, y.dtype) == (x.shape, x.dtype)
        assert not np.allclose(y, x)
        np.testing.assert_array_equal(x, given_, "its input has changed")
        if name != "Firmware":  # by default it models the real firmware
            np.testing.assert_array_equal(KINDS[name]().run(x, TIME, series), x)


numbers = st.floats(-1e6, 1e6) | st.sampled_from([0.0, -0.0, 1e6, -1e6, 1e-30, -1e-30, 1.0])


@every
@settings(max_examples=8, deadline=None)
@given(st.lists(numbers, min_size=1, max_size=6), st.integers(0, 2**16), st.sampled_from(["float32", "float64"]))
def test_finite_forces_give_finite_readings(name, values, seed, dtype):
    x = np.random.default_rng(seed).choice(values, (len(TIME), *FRAME)).astype(dtype)
    assert np.all(np.isfinite(example(name, seed % 20).run(x, TIME, inputs(name, seed=seed)[1])))


@pytest.mark.parametrize("name", [name for name in sorted(KINDS) if KINDS[name]().has_memory])
def test_extreme_steps_and_time_constants_give_finite_readings(name):
    x, tried = inputs(name, dtype="float32")[0], [example(name)]
    for key, about in parameters(KINDS[name]).items():
        if about.unit in ("s", "N") and not set(about.core) & set("pkrc"):
            shape = np.shape(getattr(tried[0], key))
            tried += [dataclasses.replace(tried[0], **{key: np.full(shape, v)}) for v in (0.0, 1e-300, 1e-42, 1e-12)]
    for transform in tried:
        for dt in (0.0, 1e-9, 0.1, 1e3, 1e9):
            state = transform.initial_state(x[0])
            for frame in x:
                y, state = transform.step(frame, state, dt)
                assert y.dtype == np.float32
                assert np.all(np.isfinite(y)), (transform, dt)


LINEAR = [
    *("AxisCoupling", "AxisGain", "Chain", "Crosstalk", "GelOperator", "Latency", "LayoutFault", "LowPass"),
    *("PadAxisGain", "Poisson", "Rotation", "SampleAndHold", "SwappedTaxels", "TaxelGain"),
]


@pytest.mark.parametrize("name", LINEAR)
def test_it_is_linear(name):
    (x, _), (y, _) = inputs(name, seed=1), inputs(name, seed=2)
    both, first, second = (example(name).run(force, TIME) for force in (30 * x - 7 * y, x, y))
    assert_close(both, 30 * first - 7 * second)


# batches and streams


@every
def test_a_batch_is_a_loop_over_its_streams(name):
    """Each stream has its own parameters and clock, and the caller reads every frame into the same memory."""
    together, (x, series) = stacked(name), inputs(name, BATCH)
    time = TIME[:, None] * np.linspace(0.5, 2.0, BATCH)
    alone = [example(name, i).run(x[:, i], time[:, i], at(series, (slice(None), i))) for i in range(BATCH)]
    expected = np.stack(alone, axis=1)
    assert_close(together.run(x, time, series), expected)
    memory = x[0].copy()
    state = together.initial_state(memory, at(series, 0))
    for i, dt in enumerate(np.diff(time, axis=0, prepend=0.0)):
        memory[...] = x[i]
        y, state = together.step(memory, state, dt, at(series, i))
        assert_close(y, expected[i])
        y[...] = np.nan


@every
def test_one_stream_serves_a_batch_of_parameters(name):
    if not keys_of(name):
        return
    together, (x, series) = stacked(name), inputs(name)
    # as many frames as environments, to catch a mix-up of their axes
    x, time, series = x[:BATCH], TIME[:BATCH], at(series, slice(BATCH))
    expected = np.stack([example(name, i).run(x, time, series) for i in range(BATCH)], axis=1)
    assert_close(together.run(x, time, series), expected)
    if not together.has_memory:
        assert_close(together(x[0], at(series, 0)), expected[0])


@every
def test_a_reset_restarts_some_streams(name):
    transform, again, mask = stacked(name), 3, np.array([True, False, True, False])
    # a frame for each environment, then one for all
    for batch in [(BATCH,), ()] if keys_of(name) else [(BATCH,)]:
        x, series = inputs(name, *batch)
        expected = transform.run(x, TIME, series)
        expected[again:, mask] = transform.run(x[again:], TIME[again:], at(series, slice(again, None)))[:, mask]
        state = transform.initial_state(x[0], at(series, 0))
        for i, dt in enumerate(np.diff(TIME, prepend=0.0)):
            dts = np.full(BATCH, dt)
            if i == again:
                state = transform.reset(state, mask, x[i], at(series, i))
                dts[mask] = 0.0
            y, state = transform.step(x[i], state, dts, at(series, i))
            assert_close(y, expected[i])


# files


@every
def test_it_returns_from_json_bit_for_bit(name):
    neutral = KINDS[name]()
    for transform in (example(name), stacked(name), neutral, with_parameters(np.asarray, neutral)):  # some are infinite
        text = Chain([transform]).to_json()
        json.loads(text, parse_constant=pytest.fail)  # strict: no NaN, no Infinity
        (again,) = Chain.from_json(text)
        assert Chain([again]).to_json() == text
        assert type(again) is type(transform)
        for field in [] if name == "Chain" else dataclasses.fields(transform):
            ours, theirs = (getattr(one, field.name) for one in (again, transform))
            assert type(ours) is type(theirs)
            np.testing.assert_array_equal(ours, theirs, strict=isinstance(theirs, np.ndarray))
        x, series = inputs(name, BATCH)
        np.testing.assert_array_equal(again.run(x, TIME, series), transform.run(x, TIME, series))
