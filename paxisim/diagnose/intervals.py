"""Intervals of fitted parameters, wide enough for errors that episodes and channels have in common."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import t as student

from paxisim.augment.chain import Chain
from paxisim.augment.parameter import parameters
from paxisim.augment.transform import Transform
from paxisim.diagnose.cause import TAXEL_GAIN, cause
from paxisim.diagnose.channels import CHANNEL_CURVE, curve_error
from paxisim.diagnose.diagnosis import FittedParameter, Interval
from paxisim.diagnose.engine import Explanation, Named
from paxisim.diagnose.fitting import predict
from paxisim.diagnose.problem import FloatArray

LEVEL = 0.9
_STEP = 0.02  # of a parameter's scale, to see what it does


def parameters_of(found: Explanation) -> Mapping[str, tuple[FittedParameter, ...]]:
    """By cause, its fitted numbers with units and 90 % intervals."""
    spreads = _spreads(found)
    return {named.name: tuple(_parameters(found, named, spreads)) for named in found.found}


def model_intervals(
    found: Explanation, fitted: Mapping[str, tuple[FittedParameter, ...]]
) -> Mapping[str, Mapping[str, Any]]:
    """What the parameters of the model's members may be, as ``GCS.around`` takes it.

    A cause's numbers need not be its transform's: each is moved to both ends of its interval, and what the transform's
    parameters then are is taken, as far as it is physical.

    Args:
        found: The causes and the model.
        fitted: By cause, its fitted numbers, as `parameters_of` gives them.
    """
    intervals = {}
    for named in found.found:
        own = [p for p in fitted[named.name] if p.value.low is not None and p.value.high is not None]
        if not own:
            continue
        item, problem = cause(named.name), found.problem
        if item.solve:
            shape = np.shape(named.values[item.solves])
            ends = [np.reshape([getattr(p.value, end) for p in own], shape) for end in ("low", "high")]
        else:
            names = list(named.values)
            middle = [float(value) for value in named.values.values()]  # type: ignore[arg-type]
            ends = [
                [float(end) if name == p.name else value for name, value in zip(names, middle, strict=True)]  # type: ignore[arg-type]
                for p in own
                for end in (p.value.low, p.value.high)
            ]
        moved = []
        for values in ends:
            try:
                moved.append(item.make(values, problem))  # type: ignore[arg-type]
            except ValueError:  # values that are allowed one by one, but not together
                continue
        reach = _reach(named.transform, moved)
        member = found.model[named.name]
        alone = isinstance(member, Chain) and not isinstance(named.transform, Chain)  # put in its place by `in_order`
        intervals[named.name] = {member.names[0]: reach} if alone else reach
    return {name: own for name, own in intervals.items() if own}


def _reach(middle: Transform, moved: Sequence[Transform]) -> dict[str, Any]:
    """By parameter of a transform its least and largest values among `moved` ones, of those that differ."""
    if isinstance(middle, Chain):
        members = {n: _reach(middle[n], [other[n] for other in moved]) for n in middle.names}  # type: ignore[index]
        return {name: own for name, own in members.items() if own}
    out: dict[str, Any] = {}
    for name in parameters(middle):
        values = np.stack([np.asarray(getattr(t, name), dtype=np.float64) for t in (middle, *moved)])
        if np.ptp(values, axis=0).any():
            out[name] = values.min(axis=0), values.max(axis=0)
    return out


def _parameters(
    found: Explanation, named: Named, spreads: Mapping[tuple[str, str], float]
) -> Iterator[FittedParameter]:
    free = {item.name: item for item in cause(named.name).free(found.problem)}
    for name, value in named.values.items():
        item = free.get(name)
        if item is not None and np.ndim(value) == 0:
            reach = spreads.get((named.name, name))
            number = float(value)
            if reach is None:
                yield FittedParameter(name, item.unit, Interval(number))
            else:
                low, high = max(number - reach, item.low), min(number + reach, item.high)
                yield FittedParameter(name, item.unit, Interval(number, low, high))
            continue
        unit = "1" if named.name in (TAXEL_GAIN, "dead_taxels") and name != "value" else "N"
        unit = "s" if name == "tau" else unit
        array = np.asarray(value, dtype=float)
        reach_of = None
        if named.name == TAXEL_GAIN:
            reach_of = _gain_spread(found, array)
        elif named.name == CHANNEL_CURVE and len(found.problem.episodes) >= 3:
            count = len(found.problem.episodes)
            reach_of = curve_error(found.problem, found.prediction) * student.ppf(0.5 + LEVEL / 2, count - 1)
        for place in np.ndindex(array.shape):
            label = name + "".join(f"_{i}" for i in place)
            number = float(array[place])
            if reach_of is None:
                yield FittedParameter(label, unit, Interval(number))
            else:
                reach = float(reach_of[place])
                yield FittedParameter(label, unit, Interval(number, number - reach, number + reach))


def _spreads(found: Explanation) -> dict[tuple[str, str], float]:
    """Half the width of each parameter's interval: from the scores of episodes, and those of channels, as clusters."""
    problem = found.problem
    chosen = [named for named in found.found if cause(named.name).probes is not None or cause(named.name).solve]
    causes = [cause(named.name) for named in chosen]
    moved = [(n, c) for n, c in zip(chosen, causes, strict=True) if c.solve is None]
    free = [(n, item) for n, c in moved for item in c.free(problem)]
    if not free or len(problem.episodes) < 3:
        return {}
    values = {n.name: np.array([float(v) for v in n.values.values()]) for n, _ in moved}  # type: ignore[arg-type]
    base = problem.residual(predict(problem, causes, values)[0])
    slopes = []
    for named, item in free:
        index = list(named.values).index(item.name)
        step = _STEP * item.scale * (-1 if values[named.name][index] + _STEP * item.scale > item.high else 1)
        value = values[named.name].copy()
        value[index] += step
        try:
            change = problem.residual(predict(problem, causes, {**values, named.name: value})[0]) - base
        except ValueError:  # values that are allowed one by one, but not together
            change = np.zeros_like(base)
        slopes.append(change / step)
    slope = np.stack([s.reshape(len(base), -1) for s in slopes])  # (D, T, channels)
    scores = slope * base.reshape(len(base), -1)
    by_episode = np.stack([scores[:, span].sum(axis=(1, 2)) for span in problem.episodes])
    by_channel = scores.sum(axis=1).T
    normal = np.einsum("atc,btc->ab", slope, slope, optimize=True)
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-12))
    inverse = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-6) / np.outer(scale, scale)
    count = len(problem.episodes)
    middle = by_episode.T @ by_episode * count / (count - 1) + by_channel.T @ by_channel
    variance = np.maximum(np.diag(inverse @ middle @ inverse), 0.0)
    reach = np.sqrt(variance) * student.ppf(0.5 + LEVEL / 2, count - 1)
    return {(named.name, item.name): float(r) for (named, item), r in zip(free, reach, strict=True)}


def _gain_spread(found: Explanation, gains: FloatArray) -> FloatArray | None:
    """``(pads, rows, cols)`` half the width of each taxel's interval, from episode to episode."""
    problem = found.problem
    if len(problem.episodes) < 3:
        return None
    load = problem.weigh(found.prediction) / np.maximum(np.abs(gains), 0.05)[:, None]
    rest = problem.residual(found.prediction)
    products = np.stack([np.sum(load[span] ** 2, axis=(0, 2)) for span in problem.episodes])
    scores = np.stack([np.sum((load * rest)[span], axis=(0, 2)) for span in problem.episodes])
    total = products.sum(axis=0) + 1.0
    count = len(problem.episodes)
    error = np.sqrt(np.sum(scores**2, axis=0) * count / (count - 1)) / total
    return np.maximum(error, 1 / np.sqrt(total)) * student.ppf(0.5 + LEVEL / 2, count - 1)
