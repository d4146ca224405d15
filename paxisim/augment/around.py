"""FittedGCS: domain randomisation around a sensor model fitted to measurements."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from paxisim.augment.chain import Chain
from paxisim.augment.gcs import GCS, PAPER_LAYOUT, torch_of, uniform
from paxisim.augment.hysteresis import Hysteresis
from paxisim.augment.latency import Latency
from paxisim.augment.parameter_spec import as_like, is_torch, namespace, parameters
from paxisim.augment.random_numbers import SEEDS
from paxisim.augment.transform import Transform
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout


@dataclass(frozen=True)
class FittedGCS(GCS):
    """GCS that samples chains around a fitted model, with parameters drawn from their uncertainty intervals.

    The fit determines what the paper's C and S have to guess, so `convolution`, `scaling` and their ranges are ignored.
    The surfaces (G) are drawn as in `GCS`, because no fit determines them. Each number with an interval is drawn
    independently from the uniform distribution over it, and each seed of noise or jitter from all seeds; all others
    keep the model's values. The intervals are meant
    to be the 90 % intervals of a diagnosis. The distribution is uniform so that a policy sees the ends of an interval
    as often as its middle.

    Hysteresis weights that sum to more than 1 are shrunk towards their lower bounds until they sum to 1.

    A negative latency describes how the streams of a recording were aligned in time, not the sensor. It is left out, so
    the chains can be stepped.

    Example:
        ```python
        found = paxisim.diagnose(recording)
        gcs = paxisim.GCS.around(found.model, found.intervals)
        chain = gcs.sample(np.random.default_rng(0), (4096,))  # one for each environment
        ```

    Attributes:
        model: The fitted chain.
        intervals: Lower and upper bounds by member and parameter, each with the parameter's own shape:
            ``{"creep": {"amplitude": ([0.1, 0.0], [0.2, 0.1])}}``. For a member that is itself a chain, a mapping of
            the same form over its members.

    Raises:
        UnknownNameError: There is no such member or parameter.
        InvalidValueError: Bounds are not finite, not in order, or not of the parameter's shape; a parameter with an
            interval is a whole number; or the lower bounds of hysteresis weights sum to more than 1.
    """

    model: Chain = field(default_factory=Chain)
    intervals: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the options and the intervals."""
        super().__post_init__()
        if not isinstance(self.model, Chain):
            raise InvalidValueError(f"GCS.around: the model must be a Chain, got {type(self.model).__name__}")
        _check(self.model, self.intervals)

    def sample(
        self, rng: Any, batch_shape: tuple[int, ...] = (), *, layout: TaxelLayout = PAPER_LAYOUT, pads: int = 2
    ) -> Chain:
        """Draw a chain around the model.

        Args:
            rng: As for `GCS.sample`.
            batch_shape: Leading batch dimensions; each element gets its own parameters.
            layout: Ignored: the model fixes the layout.
            pads: Ignored.

        Returns:
            The model's members under their names; drawn parameters are float32 of shape ``(*batch, ...)``, followed by
            the parameter's own shape.
        """
        return _drawn(self.model, self.intervals, rng, tuple(batch_shape))

    def sample_taxels(
        self, rng: Any, batch_shape: tuple[int, ...], taxels: tuple[int, int, int], positions: TaxelLayout | None
    ) -> Chain:
        """Draw a chain as `sample` does; called by ``paxisim.augment.torch.GCS``."""
        return _drawn(self.model, self.intervals, rng, tuple(batch_shape))


def _check(chain: Chain, intervals: Mapping[str, Any]) -> None:
    for name, own in intervals.items():
        member = chain[name]
        if not isinstance(own, Mapping):
            raise InvalidValueError(f"GCS.around: the intervals of {name} must be a mapping by parameter, got {own!r}")
        if isinstance(member, Chain):
            _check(member, own)
            continue
        for parameter, bounds in own.items():
            if parameter not in parameters(member):
                raise UnknownNameError(f"parameter of {name}", parameter, parameters(member))
            shape = np.shape(getattr(member, parameter))
            try:
                low, high = (np.asarray(bound, dtype=np.float64) for bound in bounds)
            except (TypeError, ValueError) as error:
                raise InvalidValueError(
                    f"GCS.around: {name}.{parameter} must be (low, high), got {bounds!r}"
                ) from error
            if low.shape != shape or high.shape != shape:
                raise InvalidValueError(
                    f"GCS.around: the bounds of {name}.{parameter} must have its shape {shape}, got {low.shape} and "
                    f"{high.shape}"
                )
            if not (np.isfinite(low).all() and np.isfinite(high).all() and np.all(low <= high)):
                raise InvalidValueError(f"GCS.around: the bounds of {name}.{parameter} must be finite and in order")
            if parameters(member)[parameter].whole:
                raise InvalidValueError(
                    f"GCS.around: {name}.{parameter} is a whole number and cannot be drawn from an interval: set it in "
                    "the model instead"
                )
            if isinstance(member, Hysteresis) and parameter == "weight":
                least = np.maximum(low, 0.0).sum(-1)
                if np.any(least > _most_weight(member) + 1e-6):
                    raise InvalidValueError(f"GCS.around: the lower bounds of {name}.weight sum to more than 1")


def _drawn(chain: Chain, intervals: Mapping[str, Any], rng: Any, batch: tuple[int, ...]) -> Chain:
    members, names = [], []
    for name, member in zip(chain.names, chain.members, strict=True):
        own = intervals.get(name, {})
        if isinstance(member, Latency) and member.reads_ahead:
            continue
        members.append(_drawn(member, own, rng, batch) if isinstance(member, Chain) else _one(member, own, rng, batch))
        names.append(name)
    return Chain(members, names)


def _one(member: Transform, intervals: Mapping[str, Any], rng: Any, batch: tuple[int, ...]) -> Transform:
    values = {}
    for name, about in parameters(member).items():
        if about.seeds and (about.seeds in intervals or _any(getattr(member, about.seeds))):
            values[name] = _seeds(rng, (*batch, *np.shape(getattr(member, name))))
        if name not in intervals:
            continue
        low, high = (np.asarray(bound, dtype=np.float64) for bound in intervals[name])
        if isinstance(member, Latency):
            low = np.maximum(low, 0.0)
        share = uniform(rng, (*batch, *low.shape), (0.0, 1.0))
        low, high = as_like(low, share), as_like(high, share)
        values[name] = (low + (high - low) * share).clip(min=about.low, max=about.high)  # against rounding errors
        if isinstance(member, Hysteresis) and name == "weight":
            values[name] = _sum_of_one(values[name], low.clip(min=0.0), _most_weight(member))
    return dataclasses.replace(member, **values) if values else member  # type: ignore[type-var]


def _any(value: Any) -> bool:
    return bool(np.any(value.cpu().numpy() if is_torch(value) else value))


def _seeds(rng: Any, shape: tuple[int, ...]) -> Any:
    if isinstance(rng, np.random.Generator):
        return rng.integers(0, SEEDS, shape)
    torch, where = torch_of(rng)
    return torch.randint(0, SEEDS, shape, **{**where, "dtype": torch.int64})


def _most_weight(member: Hysteresis) -> float:
    """Upper bound on the sum of a member's weights: 1, or less where one weight stands for several plays."""
    own = np.shape(member.weight)[-1]
    return own / max(own, np.shape(member.radius)[-1])


def _sum_of_one(weight: Any, low: Any, most: float) -> Any:
    """Return the weights, shrunk towards `low` where they sum to more than `most`, so that they sum to `most`."""
    xp = namespace(weight)
    above = (weight - low).sum(-1)[..., None]
    allowed = (most - low.sum(-1)[..., None]).clip(min=0.0)
    one = xp.ones_like(above)
    return low + (weight - low) * xp.where(above > allowed, allowed / xp.where(above > allowed, above, one), one)
