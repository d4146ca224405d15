"""Contract of every transform: what it refuses, with its name in the message; and JSON that is no chain."""

from __future__ import annotations

import dataclasses
import json
import math
import os
from typing import Any

import numpy as np
import pytest
from forces import torch
from transform_examples import BATCH, COVARIATES, KINDS, TIME, at, every, example, inputs, keys_of, stacked

from paxisim import Chain, InvalidValueError, TaxelLayout, UnknownNameError, augment
from paxisim.augment.parameter_spec import Parameter, parameters
from paxisim.augment.transform import Transform


def refused(transform: Transform, words: str) -> Any:
    """Expect an error that names the transform, or a chain's member."""
    members = transform.members if isinstance(transform, Chain) else ()
    names = "|".join([transform.name, *(member.name for member in members)])
    return pytest.raises(InvalidValueError, match=f"^({names}).*{words}")


@every
def test_what_is_no_force_tensor(name):
    transform, (x, series) = example(name), inputs(name)
    state = transform.initial_state(x[0], at(series, 0))
    bad = [(np.ones(shape), r"shape \(\.\.\., pads, 3, rows, cols\)") for shape in [(2, 4, 6, 5), (3, 6, 5), ()]]
    bad += [(x[0].astype(int), "floating point tensor in newtons, got .*int")]
    bad += [(torch.as_tensor(x[0]).int(), "floating point tensor in newtons, got .*int")] if torch else []
    for frame, words in bad:
        with refused(transform, words):
            transform.run(frame[None] if frame.ndim else np.ones(len(TIME)), TIME[: 1 if frame.ndim else None], series)
        with refused(transform, words):
            transform.step(frame, state, 0.01, at(series, 0))
        if not transform.has_memory:
            with refused(transform, words):
                transform(frame, at(series, 0))


def shape_of(about: Parameter) -> list[int]:
    return [3 if axis in "kj" else 1 for axis in about.core]


def bad_values(about: Parameter) -> list[Any]:
    """Return values that a parameter must refuse."""
    shape = shape_of(about)
    inside = max(about.low, 0.5) if about.high > 0.5 else about.high
    found: list[Any] = [np.full(shape, math.nan), "soft", np.full(shape, 1j), [[1.0], [1.0, 2.0]]]
    found += [] if about.infinite else [np.full(shape, math.inf)]
    found += [np.full(shape, about.low - 1 - abs(about.low))] if math.isfinite(about.low) else []
    found += [np.full(shape, about.high + 1 + abs(about.high))] if math.isfinite(about.high) else []
    found += [np.full(shape[1:], inside)] if about.core else []
    found += [np.full([2 if axis == "k" else 1 for axis in about.core], inside)] if "k" in about.core else []
    return found + ([np.full(shape, 0.5)] if about.whole else [])


@every
def test_parameters_outside_their_range_and_not_those_at_its_ends(name):
    kind = KINDS[name]
    for key, about in parameters(kind).items():
        whole_float = [np.ones(1)] if key == "seed" else []  # a seed must be an integer
        for value in bad_values(about) + whole_float:
            numeric = isinstance(value, np.ndarray) and value.dtype.kind == "f"
            for same in [value, *([torch.as_tensor(value)] if torch is not None and numeric else [])]:
                with pytest.raises(InvalidValueError, match=f"^{name}: {key} must"):
                    kind(**{key: same})
        for bound in (about.low, about.high):
            for dtype in ("float16", "float32"):
                if math.isfinite(bound) and key != "seed":
                    value = np.full(shape_of(about), bound, dtype)
                    kind(**{key: value})
                    if torch is not None:
                        kind(**{key: torch.as_tensor(value)})


@every
def test_parameters_of_another_batch_or_other_taxels(name):
    if keys := "|".join(keys_of(name)):
        with refused(stacked(name), rf"({keys}) of shape .* does not fit a tensor"):
            x, series = inputs(name, BATCH - 1)
            stacked(name).run(x, TIME, series)
    for key, about in parameters(KINDS[name]).items():
        if not set(about.core) & set("prc"):
            continue
        value = getattr(example(name), key)
        more = [value, value[..., :1]] if "c" in about.core else [value, value]
        changed = dataclasses.replace(example(name), **{key: np.concatenate(more, axis=-1 if "c" in about.core else 0)})
        x, series = inputs(name)
        for force in (x, x[:, :1, :, :1, :1]):  # nor is a frame of one taxel broadcast to many
            with refused(changed, "of shape .* does not fit a tensor"):
                changed.run(force, TIME, series)


@pytest.mark.parametrize("name", list(COVARIATES))
def test_a_missing_or_misshapen_covariate(name):
    transform = example(name)
    for key in transform.covariate_names:
        others = [n for n in transform.covariate_names if n != key]
        with refused(transform, f"needs the covariate '{key}'; available: {', '.join(others) or 'none'}"):
            transform.run(inputs(name)[0], TIME, {"unneeded": TIME, **dict.fromkeys(others, TIME)})
        x, series = inputs(name, BATCH)
        with refused(transform, f"the covariate '{key}' of shape"):
            transform.run(x, TIME, series | {key: series[key][:, 1:]})


@every
def test_time_that_runs_backwards_or_is_not_one_for_each_frame(name):
    transform, (x, series) = example(name), inputs(name)
    for time in (TIME[::-1], TIME * math.nan):
        with refused(transform, "time must be finite and must not run backw"):
            transform.run(x, time, series)
    for time in (TIME[:-1], TIME[:, None]):
        with refused(transform, "expected one time for each of 6 frames"):
            transform.run(x, time, series)
    state = transform.initial_state(x[0], at(series, 0))
    for dt in (-0.01, math.nan, math.inf, np.float32(-0.01), np.asarray(-0.01)):
        with refused(transform, "dt"):
            transform.step(x[1], state, dt, at(series, 1))


# what some of them refuse beyond that

WEIGHT = r"the sum of weight must lie in \[0, 1\]"
FAR = augment.Latency(-0.04)
OTHER = TaxelLayout(2, 2, 1e-3)
POSES = {"covariates": ("a", "b"), "middle": (0.0, 0.0), "directions": ((1.0, 0.0), (0.0, 1.0))}


def frame():
    return inputs("Offset")[0][0]


@pytest.mark.parametrize(
    ("name", "make", "words"),
    [
        ("ChannelCurve", lambda: augment.ChannelCurve(low=2.0, high=0.0), "high - low must lie in"),
        ("ChannelCurve", lambda: augment.ChannelCurve(low=np.array([-1.0, 2.0]), high=0.0), "high - low must lie in"),
        ("CovariateField", lambda: augment.CovariateField(**POSES | {"middle": (0.0,)}), "one number for each of 2"),
        ("CovariateField", lambda: augment.CovariateField(**POSES | {"directions": ((1.0,),)}), "one number for each"),
        ("CovariateField", lambda: augment.CovariateField(**POSES), "for 2 directions, got 2 modes"),
        ("Creep", lambda: augment.Creep((0.1, 0.1), (0.1, 0.2, 0.3)), "got 2 in amplitude, 3 in tau"),
        ("Creep", lambda: augment.Creep((), (0.1,)), "0 in amplitude"),
        ("Creep", lambda: augment.Creep(0.1, (0.1,)), r"amplitude must have shape \(..., modes\)"),
        ("Crosstalk", lambda: augment.Crosstalk(layout=OTHER)(frame()), "layout has 2x2 taxels, the tensor 6x5"),
        ("Hysteresis", lambda: augment.Hysteresis((0.1, 0.1), (1, 2, 3)), "got 2 in weight, 3 in radius"),
        ("Hysteresis", lambda: augment.Hysteresis((0.7, 0.4), (1.0, 1.0)), WEIGHT),
        ("Hysteresis", lambda: augment.Hysteresis((0.4,), (1.0, 2.0, 3.0)), WEIGHT),
        ("Latency", lambda: FAR.initial_state(frame()), r"a delay of -0\.04 s .* delay the simulated stream"),
        ("Latency", lambda: Chain([augment.LowPass(0.1), FAR]).initial_state(frame()), "delay the simulated stream"),
        ("Latency", lambda: augment.Latency(np.array([-0.01, 0.02])), "must be one number, without jitter"),
        ("Latency", lambda: augment.Latency(-0.02, 0.01), "must be one number, without jitter"),
        ("Latency", lambda: augment.Latency(capacity=2), "capacity must be a whole number of at least 3"),
        ("Latency", lambda: augment.Latency(capacity="16"), "capacity must be a whole number of at least 3"),
        ("LayoutFault", lambda: augment.LayoutFault(pad_order=(0, 2)), "pad_order must be a permutation"),
        ("LayoutFault", lambda: augment.LayoutFault(axis_order=(0, 1, 1)), "axis_order must be a permutation"),
        ("LayoutFault", lambda: augment.LayoutFault(axis_signs=(1, 1, 0)), "axis_signs must be three of 1 and -1"),
        ("LayoutFault", lambda: augment.LayoutFault(axis_signs=(1, 1)), "axis_signs must be three of 1 and -1"),
        ("LayoutFault", lambda: augment.LayoutFault(axis_signs=1), "axis_signs must be whole numbers"),
        ("LayoutFault", lambda: augment.LayoutFault(pad_order=(0, 0.5)), "pad_order must be whole numbers"),
        ("LayoutFault", lambda: augment.LayoutFault(flip_rows="yes"), "flip_rows must be true or false"),
        ("LayoutFault", lambda: augment.LayoutFault(transpose=True)(frame()), "transpose needs as many rows"),
        ("LayoutFault", lambda: augment.LayoutFault(pad_order=(2, 0, 1))(frame()), "pad_order names 3 pads"),
        ("Poisson", lambda: augment.Poisson(reach=0.5), "reach must be at least 1 pitch"),
        ("Poisson", lambda: augment.Poisson(reach=np.inf), "reach must be at least 1 pitch"),
        ("Poisson", lambda: augment.Poisson(falloff=0.0), "falloff must be positive"),
        ("Poisson", lambda: augment.Poisson(layout=OTHER)(frame()), "layout has 2x2 taxels, the tensor 6x5"),
        ("SwappedTaxels", lambda: augment.SwappedTaxels([(0, 1, 1, 2)]), "must be .*each"),
        ("SwappedTaxels", lambda: augment.SwappedTaxels([(0, 1, 1, 2, -1)]), "must be .*each"),
        ("SwappedTaxels", lambda: augment.SwappedTaxels([(0, 1, 1, 2, 0.5)]), "must be .*each"),
        ("SwappedTaxels", lambda: augment.SwappedTaxels([(0, 1, 1)]), "must be .*each"),
        ("SwappedTaxels", lambda: augment.SwappedTaxels(3), "must be .*each"),
        ("SwappedTaxels", lambda: augment.SwappedTaxels([(0, 1, 1, 1, 1)]), r"\(1, 1\) of pad 0 twice"),
        (
            "SwappedTaxels",
            lambda: augment.SwappedTaxels([(1, 1, 1, 2, 1), (1, 0, 0, 1, 1)]),
            r"\(1, 1\) of pad 1 twice",
        ),
        ("SwappedTaxels", lambda: augment.SwappedTaxels([(2, 0, 0, 1, 1)])(frame()), "is not in a tensor"),
        ("SwappedTaxels", lambda: augment.SwappedTaxels([(0, 6, 0, 1, 1)])(frame()), "is not in a tensor"),
        ("SwappedTaxels", lambda: augment.SwappedTaxels([(0, 0, 0, 1, 5)])(frame()), "is not in a tensor"),
        ("GCS", lambda: augment.Ranges(axis_gain=(1.5, 0.5)), "axis_gain must be finite bounds, at least 0"),
        ("GCS", lambda: augment.Ranges(convolution=(0.1, np.inf)), "convolution must be finite bounds"),
        ("GCS", lambda: augment.Ranges(deviation=(0.0, 1.0)), "deviation must be finite bounds, above 0"),
        ("GCS", lambda: augment.Ranges(taxel_gain=(1.0, -0.25)), "taxel_gain"),
        ("GCS", lambda: augment.Ranges(dropout=1.2), "dropout must be a probability"),
        ("GCS", lambda: augment.Ranges(offset=-0.1), "offset must be finite and at least 0 N"),
        ("GCS", lambda: augment.GCS(dropout_of="pad"), "dropout_of must be"),
        ("Poisson", lambda: augment.GCS(reach=0), "reach"),
        ("GCS", lambda: augment.GCS().sample(3), r"numpy\.random\.Generator or a torch\.Generator, got 3"),
        ("TaxelBinarization", lambda: augment.TaxelBinarization(OTHER, of="z"), "of must be"),
        ("TotalForce", lambda: augment.TotalForce(OTHER).encode(np.zeros((3, 2, 2))), "expected a floating point"),
        ("TotalForce", lambda: augment.TotalForce(OTHER).encode(np.zeros((2, 3, 2, 2), int)), "expected a floating"),
        ("History", lambda: augment.History(augment.TotalForce(OTHER), 0), "k must be"),
        ("History", lambda: augment.History(augment.TotalForce(OTHER), 1.5), "k must be"),
        ("History", lambda: augment.History(augment.TotalForce(OTHER), fill="ones"), "fill must be"),
    ],
)
def test_what_is_refused(name, make, words):
    with pytest.raises(InvalidValueError, match=f"^{name}: .*{words}|^{name} .*{words}"):
        make()


def test_an_encoding_that_is_not_there():
    with pytest.raises(UnknownNameError, match="unknown encoding 'COP'; did you mean 'CoP'"):
        augment.encoding("COP", OTHER)


# chains in JSON

ARRAY = {"dtype": "float32", "shape": [3], "data": [1.0]}
HUGE = {"dtype": "int64", "shape": [1], "data": [2**70]}
LACKS = "lacks or misuses"


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({}, "'members'"),
        ({"members": {}}, "a list of 'members'"),
        ({"members": [{"type": "Offset"}]}, LACKS),
        ({"members": [{"name": "a", "type": ["Offset"], "parameters": {}}]}, LACKS),
        ({"members": [{"name": "a", "type": "Offset", "parameters": {}}]}, r"'a' \(Offset\) of the JSON lacks 'value'"),
        ({"members": [{"name": "a", "type": "Offset", "parameters": [1.0]}]}, LACKS),
        ({"members": [{"name": "a", "type": "Offset", "parameters": {"value": ARRAY}}]}, LACKS),
        ({"members": [{"name": "a", "type": "Offset", "parameters": {"value": HUGE}}]}, LACKS),
        ({"members": [{"name": "a", "type": "LowPass", "parameters": {"tau": {"number": "abc"}}}]}, LACKS),
        ({"members": [{"name": "a", "type": "Poisson", "parameters": {"layout": {"layout": {"rows": 2}}}}]}, LACKS),
    ],
)
def test_json_that_is_no_chain(document, words):
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
    unknown = chain.to_json().replace("Stiffening", "Stiffning")
    path.write_text(unknown)
    with pytest.raises(UnknownNameError, match=r"did you mean 'Stiffening'.*import the module.*; it is in .*a\.json"):
        Chain.load(path)
    with pytest.raises(UnknownNameError, match="if Stiffning is a transform of your own, import the module"):
        Chain.from_json(unknown)
    path.write_bytes(b"{")
    os.link(path, tmp_path / "before")
    chain.save(path)  # writes a new file, which then replaces the old one
    assert (tmp_path / "before").read_bytes() == b"{"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "before"]
