"""One example of every transform, with its properties, and the helpers of the contract in `test_contract*.py`.

A transform without an example fails the contract. An example must change a tensor of 2 pads of 6x5 taxels. Its
parameters must be float64, lie inside their ranges and have the same shapes at every draw.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from paxisim.augment import (
    axis_coupling,
    chain,
    channel_curve,
    covariate_field,
    creep,
    crosstalk,
    dead_band,
    dead_taxels,
    drift,
    failing_taxels,
    firmware,
    gains,
    hysteresis,
    interference,
    latency,
    layout_faults,
    low_pass,
    noise,
    offset,
    poisson,
    quantisation,
    rotation,
    sample_and_hold,
    saturation,
    stiffening,
    swapped_taxels,
    temperature,
)
from paxisim.augment.clocked import Clocked
from paxisim.augment.parameter_spec import parameters
from paxisim.augment.transform import StatefulTransform, Transform

PADS, ROWS, COLS = 2, 6, 5
FRAME = (PADS, 3, ROWS, COLS)
TAXELS = (PADS, ROWS, COLS)


@dataclass(frozen=True)
class Example:
    """An example of a transform.

    Attributes:
        make: Function that draws an example.
        linear: Whether ``t(a x + b y) = a t(x) + b t(y)``.
        conserves_force: Whether the sum over the taxels of a pad, axis by axis, equals that of the input.
        differentiable: Whether the gradient is that of the function, wherever it has one.
        no_gradient: Parameters that have no gradient.
        random: Whether it draws random numbers.
        not_neutral: Why it is not the identity by default; empty if it is.
        covariates: Range of each covariate it needs.
    """

    make: Callable[[np.random.Generator], Transform]
    linear: bool = False
    conserves_force: bool = False
    differentiable: bool = True
    no_gradient: tuple[str, ...] = ()
    random: bool = False
    not_neutral: str = ""
    covariates: dict[str, tuple[float, float]] = field(default_factory=dict)


def some_of(rng: np.random.Generator, count: int) -> Any:
    """Return ones at `count` random taxels of each pad, zeros elsewhere."""
    chosen = rng.permuted(np.tile(np.arange(ROWS * COLS), (PADS, 1)), axis=1) < count
    return chosen.reshape(TAXELS).astype(float)


EXAMPLES: dict[str, Example] = {
    "AxisCoupling": Example(
        lambda rng: axis_coupling.AxisCoupling(np.eye(3) + rng.uniform(-0.2, 0.2, (3, 3))), linear=True
    ),
    "AxisGain": Example(lambda rng: gains.AxisGain(rng.uniform(0.5, 1.5, 3)), linear=True),
    "Chain": Example(
        lambda rng: chain.Chain(
            [
                crosstalk.Crosstalk(rng.uniform(0.01, 0.12, 3)),
                gains.AxisGain(rng.uniform(0.5, 1.5, 3)),
                low_pass.LowPass(rng.uniform(0.01, 0.1)),
            ]
        ),
        linear=True,
    ),
    "ChannelCurve": Example(
        lambda rng: channel_curve.ChannelCurve(
            rng.uniform(-0.3, 0.3, (4, *FRAME)), rng.uniform(-2.1, -1.9), rng.uniform(1.4, 1.6)
        )
    ),
    "CovariateField": Example(
        lambda rng: covariate_field.CovariateField(
            rng.uniform(-0.3, 0.3, (4, *FRAME)), ("gripper_opening", "wrist"), (0.2, -0.1), ((2.0, 0.5), (-0.5, 2.0))
        ),
        covariates={"gripper_opening": (0.0, 1.0), "wrist": (-0.5, 0.5)},
    ),
    "Creep": Example(
        lambda rng: creep.Creep(rng.uniform(-0.1, 0.25, 3), 10 ** rng.uniform(-2, 1, 3)),
        linear=True,
    ),
    "Crosstalk": Example(
        lambda rng: crosstalk.Crosstalk(
            rng.uniform(-0.05, 0.1, 3), rng.uniform(0.3, 1), rng.uniform(0.5, 2), rng.uniform(0.3, 0.9)
        ),
        linear=True,
    ),
    "DeadBand": Example(
        lambda rng: dead_band.DeadBand(rng.uniform(0.1, 0.3, 3), rng.uniform(0.2, 0.8), rng.uniform(0.1, 0.6))
    ),
    "DeadTaxels": Example(
        lambda rng: dead_taxels.DeadTaxels(some_of(rng, 3), some_of(rng, 4), rng.normal(size=FRAME)),
        no_gradient=("dead", "stuck"),
    ),
    "Drift": Example(
        lambda rng: drift.Drift(
            rng.uniform(-1, 1, FRAME), rng.uniform(-1, 1, FRAME), rng.uniform(0.05, 0.5), rng.uniform(0, 0.3)
        )
    ),
    "FailingTaxels": Example(
        lambda rng: failing_taxels.FailingTaxels(
            some_of(rng, 3), some_of(rng, 4), rng.normal(size=FRAME), rng.uniform(-0.1, 0.2, FRAME)
        ),
        no_gradient=("dead", "stuck", "since"),
    ),
    "Firmware": Example(
        lambda rng: firmware.Firmware(rng.uniform(0.05, 0.2), 16.0, 31.0, 2.0),
        differentiable=False,
        not_neutral="by default it models the real firmware",
    ),
    "Hysteresis": Example(lambda rng: hysteresis.Hysteresis(rng.uniform(0.1, 0.3, 3), rng.uniform(0.1, 1, 3))),
    "Interference": Example(
        lambda rng: interference.Interference(rng.uniform(-6, 6, (PADS, 3)), rng.uniform(-75, 75, (PADS, 3))),
        covariates={"gripper_opening": (0.0, 0.08)},
    ),
    "Latency": Example(
        lambda rng: latency.Latency(rng.uniform(0.005, 0.05), rng.uniform(0.001, 0.005), int(rng.integers(2**32))),
        linear=True,
        no_gradient=("seed",),
        random=True,
    ),
    "LayoutFault": Example(
        lambda rng: layout_faults.LayoutFault(
            flip_rows=True, flip_cols=True, pad_order=(1, 0), axis_order=(1, 0, 2), axis_signs=(1, -1, 1)
        ),
        linear=True,
    ),
    "LowPass": Example(lambda rng: low_pass.LowPass(rng.uniform(0.01, 0.1)), linear=True),
    "Offset": Example(lambda rng: offset.Offset(rng.uniform(-0.3, 0.3, FRAME))),
    "PadAxisGain": Example(lambda rng: gains.PadAxisGain(rng.uniform(0.5, 1.5, (PADS, 3))), linear=True),
    "Poisson": Example(lambda rng: poisson.Poisson(rng.uniform(0.1, 0.3), rng.uniform(0.1, 0.3)), linear=True),
    "Quantisation": Example(lambda rng: quantisation.Quantisation(rng.uniform(0.05, 0.2, 3)), differentiable=False),
    "RandomWalk": Example(
        lambda rng: noise.RandomWalk(rng.uniform(0.1, 1, FRAME), int(rng.integers(2**32))),
        no_gradient=("seed",),
        random=True,
    ),
    "Rotation": Example(lambda rng: rotation.Rotation(rng.uniform(-0.6, 0.6, (PADS, 3))), linear=True),
    "SampleAndHold": Example(
        lambda rng: sample_and_hold.SampleAndHold(rng.uniform(20, 50), rng.uniform(0, 1)), linear=True
    ),
    "Saturation": Example(
        lambda rng: saturation.Saturation(rng.uniform(-1, -0.5, 3), rng.uniform(0.5, 1, 3), rng.uniform(0.1, 0.9))
    ),
    "Stiffening": Example(
        lambda rng: stiffening.Stiffening(
            rng.uniform(0.7, 1.5), rng.uniform(0.5, 2), rng.uniform(0.05, 1), rng.uniform(0.2, 0.8)
        )
    ),
    "SwappedTaxels": Example(
        lambda rng: swapped_taxels.SwappedTaxels(((0, 1, 2, 3, 4), (1, 0, 0, 5, 4))),
        linear=True,
        conserves_force=True,
    ),
    "TaxelGain": Example(lambda rng: gains.TaxelGain(rng.uniform(0.25, 1.75, TAXELS)), linear=True),
    "TemperatureDrift": Example(
        lambda rng: temperature.TemperatureDrift(
            rng.uniform(-0.002, -0.001), rng.uniform(-0.01, 0.01, FRAME), rng.uniform(20, 30)
        ),
        covariates={"temperature": (10.0, 40.0)},
    ),
    "WhiteNoise": Example(
        lambda rng: noise.WhiteNoise(rng.uniform(0.01, 0.1, FRAME), int(rng.integers(2**32))),
        no_gradient=("seed",),
        random=True,
    ),
}

KINDS = {
    name: kind
    for name, kind in chain._known_transforms().items()
    if kind.__module__.startswith("paxisim.augment.") and kind not in (StatefulTransform, Clocked)
}
NAMES = sorted(KINDS)
TIME = np.array([0.0, 0.011, 0.011, 0.06, 0.2, 0.213])
BATCH = 4
DTYPES = ["float32", "float64"]
TOLERANCE = {"float32": 1e-5, "float64": 1e-12}

every = pytest.mark.parametrize("name", NAMES)


def example(name: str, seed: int = 0) -> Transform:
    """Draw the example of a transform."""
    assert name in EXAMPLES, f"add an example of {name} to tests/augment/transform_examples.py"
    return EXAMPLES[name].make(np.random.default_rng(seed))


def frames(*batch: int, seed: int = 1, dtype: str = "float64") -> Any:
    """Return a sequence of forces ``(time, *batch, ...)``, some of them zero."""
    force = np.random.default_rng(seed).normal(size=(len(TIME), *batch, *FRAME))
    return (force * (np.abs(force) > 0.3)).astype(dtype)


def covariates(name: str, *batch: int, seed: int = 2) -> dict[str, Any]:
    """Return a sequence of every covariate that a transform needs."""
    rng = np.random.default_rng(seed)
    return {key: rng.uniform(*range_, (len(TIME), *batch)) for key, range_ in EXAMPLES[name].covariates.items()}


def at(series: dict[str, Any], index: Any) -> dict[str, Any]:
    """Return a part of the covariates."""
    return {key: values[index] for key, values in series.items()}


def with_parameters(transform: Transform, change: Any) -> Transform:
    """Return the transform with ``change(value)`` applied to each of its parameters."""
    if isinstance(transform, chain.Chain):
        return chain.Chain([with_parameters(member, change) for member in transform], transform.names)
    return dataclasses.replace(transform, **{name: change(getattr(transform, name)) for name in parameters(transform)})


def stacked(transforms: list[Transform]) -> Transform:
    """Combine transforms into one whose parameters have a batch axis."""
    if isinstance(transforms[0], chain.Chain):
        return chain.Chain([stacked(list(members)) for members in zip(*transforms, strict=True)], transforms[0].names)
    names = parameters(transforms[0])
    return dataclasses.replace(transforms[0], **{n: np.stack([getattr(t, n) for t in transforms]) for n in names})


def all_parameters(transform: Transform) -> set[str]:
    """Return the names of the parameters of a transform, or of a chain's members."""
    members = transform.members if isinstance(transform, chain.Chain) else (transform,)
    return {name for member in members for name in parameters(member)}


def assert_close(ours: Any, theirs: Any, dtype: str = "float64", scale: float | None = None) -> None:
    """Fail unless two readings agree to rounding."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    scale = max(1.0, float(np.abs(theirs).max())) if scale is None else scale
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=TOLERANCE[dtype] * scale)
