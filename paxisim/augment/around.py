"""Parameters of a fitted sensor model drawn from their intervals, for domain randomisation around it."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from paxisim.augment.chain import Chain
from paxisim.augment.draws import seeds, uniform
from paxisim.augment.hysteresis import Hysteresis
from paxisim.augment.latency import Latency
from paxisim.augment.parameter_spec import as_like, is_torch, namespace, parameters
from paxisim.augment.transform import Transform
from paxisim.errors import InvalidValueError, UnknownNameError


def check_intervals(chain: Chain, intervals: Mapping[str, Any]) -> None:
    """Check that intervals fit a chain; see `FittedGCS`.

    Raises:
        UnknownNameError: There is no such member or parameter.
        InvalidValueError: Bounds cannot be used.
    """
    for name, own in intervals.items():
        member = chain[name]
        if not isinstance(own, Mapping):
            raise InvalidValueError(f"GCS.around: the intervals of {name} must be a mapping by parameter, got {own!r}")
        if isinstance(member, Chain):
            check_intervals(member, own)
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


def drawn(chain: Chain, intervals: Mapping[str, Any], rng: Any, batch: tuple[int, ...]) -> Chain:
    """Return the chain with parameters drawn from their intervals; see `FittedGCS`."""
    members, names = [], []
    for name, member in zip(chain.names, chain.members, strict=True):
        own = intervals.get(name, {})
        if isinstance(member, Latency) and member.reads_ahead:
            continue
        members.append(drawn(member, own, rng, batch) if isinstance(member, Chain) else _one(member, own, rng, batch))
        names.append(name)
    return Chain(members, names)


def _one(member: Transform, intervals: Mapping[str, Any], rng: Any, batch: tuple[int, ...]) -> Transform:
    values = {}
    for name, about in parameters(member).items():
        if about.seeds and (about.seeds in intervals or _any(getattr(member, about.seeds))):
            values[name] = seeds(rng, (*batch, *np.shape(getattr(member, name))))
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
