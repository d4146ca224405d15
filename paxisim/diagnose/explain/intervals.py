"""Intervals of fitted parameters, robust to errors that are correlated within episodes and channels."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.stats import t as student

from paxisim.augment.chain import Chain
from paxisim.augment.parameter_spec import parameters
from paxisim.augment.transform import Transform
from paxisim.diagnose.causes.kinds import BaselineCause, FittedCause, PerChannelCause
from paxisim.diagnose.causes.parameters import Free
from paxisim.diagnose.data.baseline import Curves
from paxisim.diagnose.data.deviations import CORRELATED_SAMPLES
from paxisim.diagnose.data.noise import differences
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.data.replayed import replay_errors
from paxisim.diagnose.explain.explanation import Explanation, Named
from paxisim.diagnose.explain.heldout import CONFIDENCE_LEVEL
from paxisim.diagnose.result import FittedParameter, Interval
from paxisim.diagnose.scorer.fitting import with_curves

_FEWEST = 3  # episodes that give an interval
_LEVELS, _PER_OCTAVE = 64, 8  # force levels, counted down from the peak, and levels per octave
_LEAST_REST = 5  # fewest frames at rest in an episode
DERIVED_STEP = 0.01  # change of a parameter for the gradient of a derived number, in units of its scale
_NOISES = (0.6, 1.0, 1.5)  # plausible noise of a channel, relative to the usual noise


def parameters_of(found: Explanation) -> Mapping[str, tuple[FittedParameter, ...]]:
    """Fitted parameters with units and 90 % intervals, by cause."""
    has_intervals = len(found.problem.episodes) >= _FEWEST
    spreads = _spreads(found) if has_intervals else {}
    return {named.name: tuple(_parameters(found, named, spreads, has_intervals)) for named in found.named}


def _parameters(
    found: Explanation, named: Named, spreads: Mapping[tuple[str, str], float], has_intervals: bool
) -> Iterator[FittedParameter]:
    """The numbers derived from a cause's parameters, its scalar parameters, and each element of its arrays."""
    copies = named.cause.copies(found.problem)
    for own in named.cause.derived if isinstance(named.cause, FittedCause) else ():
        values = [float(value) for value in named.values.values()]
        number, reach = own.of(values, found.problem), spreads.get((named.name, own.name))
        interval = Interval(number) if reach is None else Interval(number, number - reach, number + reach)
        size = named.cause.amount(np.array(values), found.problem)  # the number stands for the whole cause
        yield FittedParameter(own.name, own.unit, interval, own.words, size=size)
    free = {item.name: item for item in named.cause.parameters(found.problem)}
    for name, value in named.values.items():
        array, item = np.asarray(value, dtype=float), free.get(name)
        if item is not None and array.ndim == 0:
            unit, words, low, high = item.unit, item.words, item.low, item.high
            neutral, end = item.neutral, name.rpartition("_")[2]
            pad = int(end) if copies > 1 and end.isdecimal() and int(end) < copies else None
            size = abs(float(array) - neutral) / item.material if item.material else None
            half = spreads.get((named.name, name))
        else:
            words = named.cause.numbers.get(name, "") if isinstance(named.cause, BaselineCause) else ""
            unit, low, high = _unit(named, name), -np.inf, np.inf
            neutral = size = pad = None
            half = _half_width(found, named, name) if has_intervals else None
        for place in np.ndindex(array.shape):
            interval = Interval(float(array[place]))
            if half is not None:
                number, reach = interval.value, float(np.asarray(half)[place])
                interval = Interval(number, max(number - reach, low), min(number + reach, high))
            yield FittedParameter(name + "".join(f"_{i}" for i in place), unit, interval, words, neutral, size, pad)


def _unit(named: Named, name: str) -> str:
    if isinstance(named.cause, PerChannelCause):
        return named.cause.unit
    if isinstance(named.cause, BaselineCause) and name in named.cause.numbers:
        return "s"
    return {"dead": "1", "stuck": "1", "since": "s"}.get(name, "N") if named.evidence is None else "N"


def _half_width(found: Explanation, named: Named, name: str) -> FloatArray | None:
    """Half-widths of the intervals of an array; None if the recording does not determine any."""
    if isinstance(named.cause, PerChannelCause):
        problem = replace(found.problem, curves=Curves(np.ones((1, len(found.problem.time)))))
        return named.cause.error(problem, found.prediction, np.asarray(named.values[name]))
    if isinstance(named.cause, BaselineCause) and name == named.cause.amounts:
        return _zero_spread(found, named)
    return None


def _spreads(found: Explanation) -> dict[tuple[str, str], float]:
    """Half-width of the interval of each parameter, and of each number that is derived from them.

    The variance is cluster-robust. Errors that are correlated within an episode, a channel or a force level do not
    average out, so the scores of each cluster are summed before they are squared. Force levels account for a fitted
    form that differs from the sensor's. The effects of errors that all samples may share, such as a misplaced contact,
    are added, and in a scene the error of parameters that are fitted beside poses.
    """
    squares, residual, slopes = found.scorer.fitter.linearised(found.fit)
    rows, free, prediction = squares.rows, squares.free, squares.prediction
    if not free:
        return {}
    frames = len(rows.time)
    residual, slopes = residual.reshape(frames, -1), slopes.reshape(len(free), frames, -1)
    flat = slopes.reshape(len(free), -1)
    inverse = np.linalg.pinv(flat @ flat.T + np.diag(squares.prior), rcond=1e-9, hermitian=True)
    derived, gradients = _derived(found, free)
    numbers = np.concatenate([np.eye(len(free)), gradients])
    inverse = numbers @ inverse
    variance, degrees = _clustered(rows, residual, slopes, inverse)
    errors = [rows.noise.tolerance.place * change / 2 for change in differences(prediction)]
    for error in errors if rows.scene is None else (*errors, *replay_errors(rows, prediction)):
        effect = rows.weigh(error).reshape(frames, -1)
        variance += (inverse @ np.einsum("atc,tc->a", slopes, effect)) ** 2
    if rows.scene is not None:
        variance += CORRELATED_SAMPLES * np.sum(inverse * numbers, axis=1)
    reach = np.sqrt(variance) * student.ppf(0.5 + CONFIDENCE_LEVEL / 2, degrees)
    strength = np.sum(flat**2, axis=1)
    seen = strength > 1e-9 * strength.max()
    known = {(n, f.name): float(r * f.scale) for (n, _, f), r, shows in zip(free, reach, seen, strict=False) if shows}
    return known | {key: float(r) for key, r in zip(derived, reach[len(free) :], strict=True)}


def _derived(found: Explanation, free: Sequence[tuple[str, int, Free]]) -> tuple[list[tuple[str, str]], FloatArray]:
    """The cause and name of each derived number, and its ``(numbers, free)`` gradient per unit of the scales."""
    keys, rows = [], []
    for item in (c for c in found.fit.causes if isinstance(c, FittedCause)):
        values = found.fit.whole.values[item.name]
        for own in item.derived:
            now, row = own.of(values, found.problem), np.zeros(len(free))
            for place, (name, index, about) in enumerate(free):
                for step in (DERIVED_STEP, -DERIVED_STEP) if name == item.name else ():
                    moved = values + step * about.scale * np.eye(len(values))[index]
                    if moved[index] <= about.high:
                        with contextlib.suppress(ValueError):  # each value is allowed, but not the combination
                            row[place] = (own.of(moved, found.problem) - now) / step
                            break
            keys.append((item.name, own.name))
            rows.append(row)
    return keys, np.reshape(rows, (len(rows), len(free)))


def _clustered(
    rows: Problem, residual: FloatArray, slopes: FloatArray, inverse: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """``(free,)`` variances of the parameters, in units of their scales, and degrees of freedom."""
    scores = slopes * residual
    size = np.abs(rows.simulated).ravel() / rows.peak
    level = np.clip(np.log2(np.maximum(size, 1e-9)) * _PER_OCTAVE + _LEVELS, 0, _LEVELS - 1).astype(np.intp)
    by_episode = np.stack([scores[:, span].sum(axis=1) for span in rows.episodes], axis=-1)  # (free, C, episodes)
    count = len(rows.episodes)
    clusters = (
        by_episode.sum(axis=1) * np.sqrt(count / (count - 1)),
        by_episode.sum(axis=2),
        np.stack([np.bincount(level, row.ravel(), _LEVELS) for row in scores]),
    )
    each = [(inverse @ cluster) ** 2 for cluster in clusters]
    variances = np.array([part.sum(axis=1) for part in each])  # (3, free)
    # effective degrees of freedom: few influential clusters estimate a variance poorly
    squares = np.array([np.sum(part**2, axis=1) for part in each])
    degrees = np.maximum(variances**2 / np.maximum(squares, 1e-300) - 1, 1.0)
    noise = np.sum((inverse @ by_episode.reshape(len(scores), -1)) ** 2, axis=1)  # part of all three variances
    together = np.maximum(variances.sum(axis=0) - 2 * noise, variances.max(axis=0))
    shared = variances.sum(axis=0) ** 2 / np.maximum((variances**2 / degrees).sum(axis=0), 1e-300)
    return together, np.maximum(shared, 1.0)


def _zero_spread(found: Explanation, named: Named) -> FloatArray | None:
    """Half-widths for each channel's amplitudes, in the shape of the cause's array, from the residual at rest."""
    problem = found.problem
    curved = with_curves(problem, found.fit.causes, found.fit.shapes).curves
    assert curved is not None
    curves, own = curved.values, curved.owned_by(named.name)
    spans = [span for span in problem.baseline.by_episode if len(span) >= _LEAST_REST]
    if len(spans) <= len(curves) + 1:
        return None
    left = problem.measured - problem.read(found.prediction)
    basis = np.array([[curve[span].mean() for curve in curves] for span in spans])  # (episodes, curves)
    shares = np.linalg.pinv(basis)[own]  # weight of each episode in each amplitude
    degrees = len(spans) - len(curves)
    means = np.stack([left[span].mean(axis=0) for span in spans])
    variance = np.einsum("ce,e...->c...", shares**2, means**2) * len(spans) / degrees
    typical = np.median(variance, axis=(3, 4), keepdims=True)  # pools similar taxels: few episodes give a poor variance
    reach = np.sqrt(np.maximum(variance, typical)) * student.ppf(0.5 + CONFIDENCE_LEVEL / 2, degrees)
    zero = np.tensordot(np.array([curve.mean() for curve in curves]), found.fit.whole.zero, 1) + found.fit.constant
    middle = problem.read(zero[None])[0]
    # the noise determines how far the zero offset is from a rounding edge
    noises = [replace(problem.noise, dither=share * problem.noise.dither) for share in _NOISES]
    half = np.ptp([noise.unread(end) for noise in noises for end in (middle - reach, middle + reach)], axis=0) / 2
    return half[0] if len(half) == 1 else half


def model_intervals(
    found: Explanation, fitted: Mapping[str, tuple[FittedParameter, ...]]
) -> Mapping[str, Mapping[str, Any]]:
    """Ranges of the parameters of the model's members, in the format of ``GCS.around``.

    The parameters of a cause, `fitted`, may differ from those of its transform. Each is therefore moved to both ends of
    its interval, and the resulting parameters of the transform give the range, as far as they are valid.
    """
    intervals = {}
    for named in found.named:
        derived = {number.name for number in named.cause.derived} if isinstance(named.cause, FittedCause) else ()
        own = [p for p in fitted[named.name] if p.value.low is not None and p.name not in derived]
        if not own or named.cause.in_scene:
            continue
        if isinstance(named.cause, BaselineCause):  # its amplitudes are the transform's
            amounts = named.cause.amounts
            reach = {amounts: tuple(_array_ends(own, np.shape(named.values[amounts])))}
        else:
            reach = _reach(named.transform, _moved(found, named, own))
        member = found.model[named.name]
        alone = isinstance(member, Chain) and not isinstance(named.transform, Chain)  # wrapped by `in_order`
        intervals[named.name] = {member.names[0]: reach} if alone else reach
    return {name: own for name, own in intervals.items() if own}


def _array_ends(own: Sequence[FittedParameter], shape: tuple[int, ...]) -> list[FloatArray]:
    """Lowest and highest values of an array whose elements are the given parameters."""
    return [np.reshape([p.value.ends[end] for p in own], shape) for end in (0, 1)]


def _moved(found: Explanation, named: Named, own: Sequence[FittedParameter]) -> list[Transform]:
    """A cause's transform with its parameters at the ends of their intervals."""
    item = named.cause
    if isinstance(item, PerChannelCause):
        make, ends = item.make, _array_ends(own, np.shape(named.values[item.array]))
    else:
        assert isinstance(item, FittedCause)
        make = item.transform
        ends = [np.array([*{**named.values, p.name: end}.values()], dtype=float) for p in own for end in p.value.ends]
    moved = []
    for values in ends:
        with contextlib.suppress(ValueError):  # each value is allowed, but not the combination
            moved.append(make(values, found.problem))
    return moved


def _reach(middle: Transform, moved: Sequence[Transform]) -> dict[str, Any]:
    """Lowest and highest value of each parameter over `middle` and `moved`, for the parameters that differ."""
    if isinstance(middle, Chain):
        alike = [other for other in moved if isinstance(other, Chain) and other.names == middle.names]
        members = {n: _reach(middle[n], [other[n] for other in alike]) for n in middle.names}
        return {name: own for name, own in members.items() if own}
    out: dict[str, Any] = {}
    moved = [next(iter(m)) if isinstance(m, Chain) else m for m in moved]
    for name in parameters(middle):
        values = np.stack([np.asarray(getattr(t, name), dtype=np.float64) for t in (middle, *moved)])
        if np.ptp(values, axis=0).any():
            out[name] = values.min(axis=0), values.max(axis=0)
    return out
