"""One example of every transform, with its properties, and the helpers of the contract in `test_contract*.py`.

A transform without an example fails the contract. An example must change a tensor of 2 pads of 6x5 taxels. Its
parameters must be float64, lie inside their ranges and have the same shapes at every draw.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import numpy as np
import pytest

from paxisim import augment
from paxisim.augment.chain import Chain, _known_transforms
from paxisim.augment.parameter_spec import parameters
from paxisim.augment.transform import Transform

PADS, ROWS, COLS = 2, 6, 5
FRAME = (PADS, 3, ROWS, COLS)
TAXELS = (PADS, ROWS, COLS)
TIME = np.array([0.0, 0.011, 0.011, 0.06, 0.2, 0.213])
BATCH = 4

KINDS = {
    name: kind
    for name, kind in _known_transforms().items()
    if kind.__module__.startswith("paxisim.augment.") and name not in ("StatefulTransform", "Clocked")
}
COVARIATES = {
    "CovariateField": {"gripper_opening": (0.0, 1.0), "wrist": (-0.5, 0.5)},
    "Interference": {"gripper_opening": (0.0, 0.08)},
    "TemperatureDrift": {"temperature": (10.0, 40.0)},
}

every = pytest.mark.parametrize("name", sorted(KINDS))


@functools.cache
def examples(seed: int) -> dict[str, Transform]:
    """Draw an example of every transform."""
    rng = np.random.default_rng(seed)

    def some(count: int) -> Any:
        """Return ones at `count` random taxels of each pad, zeros elsewhere."""
        return (
            rng.permuted(np.arange(np.prod(TAXELS)).reshape(PADS, -1) % (ROWS * COLS), axis=1).reshape(TAXELS) < count
        )

    crosstalk = augment.Crosstalk(
        rng.uniform(-0.05, 0.1, 3), rng.uniform(0.3, 1), rng.uniform(0.5, 2), rng.uniform(0.3, 0.9)
    )
    gain, low_pass = augment.AxisGain(rng.uniform(0.5, 1.5, 3)), augment.LowPass(rng.uniform(0.01, 0.1))
    faults = {"dead": some(3) * 1.0, "stuck": some(4) * 1.0, "value": rng.normal(size=FRAME)}
    field, stream = rng.uniform(-0.3, 0.3, (4, *FRAME)), int(rng.integers(2**32))
    made = [
        augment.AxisCoupling(np.eye(3) + rng.uniform(-0.2, 0.2, (3, 3))),
        gain,
        Chain([crosstalk, gain, low_pass]),
        augment.ChannelCurve(field, rng.uniform(-2.1, -1.9), rng.uniform(1.4, 1.6)),
        augment.CovariateField(field, ("gripper_opening", "wrist"), (0.2, -0.1), ((2.0, 0.5), (-0.5, 2.0))),
        augment.Creep(rng.uniform(-0.1, 0.25, 3), 10 ** rng.uniform(-2, 1, 3), 0.3, 0.05),
        crosstalk,
        augment.DeadBand(rng.uniform(0.1, 0.3, 3), rng.uniform(0.2, 0.8), rng.uniform(0.1, 0.6), rng.uniform(0.1, 0.3)),
        augment.DeadTaxels(**faults),
        augment.Drift(
            rng.uniform(-1, 1, FRAME), rng.uniform(-1, 1, FRAME), rng.uniform(0.05, 0.5), rng.uniform(0, 0.3)
        ),
        augment.FailingTaxels(**faults, since=rng.uniform(-0.1, 0.2, FRAME)),
        augment.Firmware(rng.uniform(0.05, 0.2), 16.0, 31.0, 2.0),
        augment.GelOperator(
            rng.uniform(-0.3, 0.1), rng.uniform(-0.3, 0.1), *(rng.uniform(-0.3, 0.3, 2) for _ in range(7)), taken=0.4
        ),
        augment.Hysteresis(rng.uniform(0.1, 0.3, 3), rng.uniform(0.1, 1, 3), rng.uniform(0.01, 0.05, 3)),
        augment.Interference(rng.uniform(-6, 6, (PADS, 3)), rng.uniform(-75, 75, (PADS, 3))),
        augment.Latency(rng.uniform(0.005, 0.05), rng.uniform(0.001, 0.005), stream),
        augment.LayoutFault(True, True, pad_order=(1, 0), axis_order=(1, 0, 2), axis_signs=(1, -1, 1)),
        low_pass,
        augment.Offset(rng.uniform(-0.3, 0.3, FRAME)),
        augment.PadAxisGain(rng.uniform(0.5, 1.5, (PADS, 3))),
        augment.Poisson(rng.uniform(0.1, 0.3), rng.uniform(0.1, 0.3)),
        augment.Quantisation(rng.uniform(0.05, 0.2, 3)),
        augment.RandomWalk(rng.uniform(0.1, 1, FRAME), stream),
        augment.Rotation(rng.uniform(-0.6, 0.6, (PADS, 3))),
        augment.SampleAndHold(rng.uniform(20, 50), rng.uniform(0, 1)),
        augment.Saturation(rng.uniform(-1, -0.5, 3), rng.uniform(0.5, 1, 3), rng.uniform(0.1, 0.9)),
        augment.Stiffening(rng.uniform(0.7, 1.5), rng.uniform(0.5, 2), rng.uniform(0.05, 1), rng.uniform(0.2, 0.8)),
        augment.SwappedTaxels(((0, 1, 2, 3, 4), (1, 0, 0, 5, 4))),
        augment.TaxelGain(rng.uniform(0.25, 1.75, TAXELS)),
        augment.TemperatureDrift(rng.uniform(-0.002, -0.001), rng.uniform(-0.01, 0.01, FRAME), rng.uniform(20, 30)),
        augment.WhiteNoise(rng.uniform(0.01, 0.1, FRAME), stream),
    ]
    return {transform.name: transform for transform in made}


def example(name: str, seed: int = 0) -> Transform:
    """Return the example of a transform."""
    assert name in examples(seed), f"add an example of {name} to tests/augment/transform_examples.py"
    return examples(seed)[name]


def inputs(name: str, *batch: int, seed: int = 1, dtype: str = "float64") -> tuple[Any, dict[str, Any]]:
    """Return forces ``(time, *batch, ...)``, some of them zero, and every covariate that a transform needs."""
    rng = np.random.default_rng(seed)
    force = rng.normal(size=(len(TIME), *batch, *FRAME))
    series = {key: rng.uniform(*ends, (len(TIME), *batch)) for key, ends in COVARIATES.get(name, {}).items()}
    return (force * (np.abs(force) > 0.3)).astype(dtype), series


def at(series: dict[str, Any], index: Any) -> dict[str, Any]:
    """Return a part of the covariates."""
    return {key: values[index] for key, values in series.items()}


def with_parameters(change: Any, *transforms: Transform) -> Transform:
    """Return a transform with ``change(*values)`` of the others' for each of its parameters."""
    first = transforms[0]
    if isinstance(first, Chain):
        return Chain([with_parameters(change, *members) for members in zip(*transforms, strict=True)], first.names)
    return dataclasses.replace(first, **{n: change(*(getattr(t, n) for t in transforms)) for n in parameters(first)})


def stacked(name: str) -> Transform:
    """Combine examples into one transform whose parameters have a batch axis."""
    return with_parameters(lambda *values: np.stack(values), *(example(name, seed) for seed in range(BATCH)))


def keys_of(name: str) -> set[str]:
    """Return the names of the parameters of a transform, or of a chain's members."""
    members = example(name).members if name == "Chain" else (example(name),)
    return {key for member in members for key in parameters(member)}


def assert_close(ours: Any, theirs: Any, tolerance: float = 1e-12) -> None:
    """Fail unless two readings agree to rounding."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * max(1.0, float(np.abs(theirs).max())))
