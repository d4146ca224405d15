"""Intervals of fitted parameters, wide enough for errors that episodes and channels have in common."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.stats import t as student

from paxisim.augment.chain import Chain
from paxisim.augment.parameter import parameters
from paxisim.augment.transform import Transform
from paxisim.diagnose.cause import DEAD_BAND, GAIN_PRIOR, TAXEL_GAIN, Cause, Free, cause
from paxisim.diagnose.channels import CHANNEL_CURVE, curve_error
from paxisim.diagnose.diagnosis import FittedParameter, Interval
from paxisim.diagnose.engine import Explanation, Named
from paxisim.diagnose.fitting import Fitted, predict
from paxisim.diagnose.gains import by_episode, drawn
from paxisim.diagnose.noise import Tolerance, differences
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.diagnose.under_load import tells_under_load

LEVEL = 0.9
_LEVELS, _PER_OCTAVE = 64, 8  # of force, down from the peak
_LEAST_REST = 5  # frames of an episode at rest
_NOISES = (0.6, 1.0, 1.5)  # of the usual noise, that channels may have
_FINER = 4  # times the frames, to see what straight lines between them do
_STEP = 0.1  # of a parameter's scale, to see what it does


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
        if not item.is_searched:  # read off the data: its numbers are the transform's
            intervals[named.name] = _read_ends(named, own)
            continue
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


def _read_ends(named: Named, own: Sequence[FittedParameter]) -> dict[str, Any]:
    """By array of a cause that was read off the data, the least and largest values that its numbers may have."""
    out: dict[str, Any] = {}
    for name, value in named.values.items():
        ends = [p.value for p in own if p.name.startswith(f"{name}_")]
        if np.ndim(value) and len(ends) == np.size(value):
            out[name] = tuple(np.reshape([getattr(e, end) for e in ends], np.shape(value)) for end in ("low", "high"))
    return out


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
    found: Explanation, named: Named, spreads: Mapping[tuple[str, str], tuple[float, float]]
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
                low, high = max(number - reach[0], item.low), min(number + reach[1], item.high)
                yield FittedParameter(name, item.unit, Interval(number, low, high))
            continue
        unit = "1" if named.name in (TAXEL_GAIN, "dead_taxels") and name != "value" else "N"
        unit = "s" if name == "tau" else unit
        array = np.asarray(value, dtype=float)
        reach_of = None
        if named.name == TAXEL_GAIN:
            reach_of = _gain_spread(found, array)
        elif (named.name, name) in (("offset", "value"), ("drift", "amplitude")):
            reach_of = _zero_spread(found, named.name)
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


def _spreads(found: Explanation) -> dict[tuple[str, str], tuple[float, float]]:
    """How far each parameter's interval reaches below and above its value.

    Errors that episodes, channels or levels of force have in common do not average out within them: the scores of each
    are summed before they are squared. The last stand for a form that is not quite that of the sensor. To these come
    what a contact that is off its place does, and what a simulation that bends between the frames would change.
    """
    problem = found.problem
    chosen = [named for named in found.found if cause(named.name).is_searched]
    causes = [cause(named.name) for named in chosen]
    fitted = [(n, c) for n, c in zip(chosen, causes, strict=True) if c.solve is None]
    names = [n.name for n, _ in fitted]
    free = [(n, item) for n, c in fitted for item in c.free(problem) if not item.is_held(names)]
    if not free or len(problem.episodes) < 3:
        return {}
    values = {n.name: np.array([float(v) for v in n.values.values()]) for n, _ in fitted}  # type: ignore[arg-type]
    problem = problem.thinned
    linear = _Linear(problem, causes, values, [(named.name, item) for named, item in free])
    reach = linear.spread()
    moved = [linear.moved_by(effect) for effect in _misplaced(problem, linear.prediction)]
    reach = np.sqrt(reach**2 + np.sum(np.square(moved), axis=0))
    finer = np.zeros(len(free))
    if any(named.transform.has_memory for named in chosen):
        finer = -linear.moved_by(_finer(problem, causes, linear.values) - linear.prediction)
    low, high = reach + np.maximum(-finer, 0.0), reach + np.maximum(finer, 0.0)
    return {
        (named.name, item.name): (float(below), float(above))
        for (named, item), below, above, seen in zip(free, low, high, linear.seen, strict=True)
        if seen
    }


def _finer(problem: Problem, causes: Sequence[Cause], values: Fitted) -> FloatArray:
    """What the causes make of a simulation that bends smoothly between the frames instead of running straight."""
    times, forces, zeros, spans = [], [], [], []
    begin = 0
    for span in problem.episodes:
        time = problem.time[span]
        if len(time) < 4 or np.diff(time).min() <= 0:
            return predict(problem, causes, values)[0]
        fine = np.interp(np.arange(_FINER * (len(time) - 1) + 1) / _FINER, np.arange(len(time)), time)
        times.append(fine)
        forces.append(CubicSpline(time, problem.simulated[span])(fine))
        zeros.append(np.searchsorted(time, fine, side="right") - 1 + span.start)
        spans.append(slice(begin, begin + len(fine)))
        begin += len(fine)
    nearest = np.concatenate(zeros)
    fine = replace(
        problem,
        simulated=np.concatenate(forces),
        time=np.concatenate(times),
        covariates={name: np.interp(np.concatenate(times), problem.time, c) for name, c in problem.covariates.items()},
        episodes=tuple(spans),
        zero=problem.zero if isinstance(problem.zero, (int, float)) else problem.zero[nearest],
    )
    made = predict(fine, causes, values)[0]
    return np.concatenate([made[span][::_FINER] for span in spans])


class _Linear:
    """A fit as it is near its values: the residual and its slopes."""

    def __init__(
        self, problem: Problem, causes: Sequence[Cause], values: Fitted, free: Sequence[tuple[str, Free]]
    ) -> None:
        self._problem, at = problem.compared, problem.at_compared
        self._at = at
        self.prediction, self.values = predict(problem, causes, values)
        base = self._problem.residual(at(self.prediction))
        slope = np.zeros((len(free), *base.shape))
        for row, (name, item) in enumerate(free):
            index = [f.name for f in cause(name).free(problem)].index(item.name)
            step = _STEP * item.scale * (-1 if values[name][index] + _STEP * item.scale > item.high else 1)
            moved = values[name].copy()
            moved[index] += step
            try:
                after = self._problem.residual(at(predict(problem, causes, {**values, name: moved})[0]))
                slope[row] = (after - base) / step
            except ValueError:  # values that are allowed one by one, but not together
                continue
        frames = len(base)
        self._base, self._slope = base.reshape(frames, -1), slope.reshape(len(free), frames, -1)
        normal = np.einsum("atc,btc->ab", self._slope, self._slope, optimize=True)
        scale = np.sqrt(np.maximum(np.diag(normal), 1e-12))
        self._inverse = np.linalg.pinv(normal / np.outer(scale, scale), rcond=1e-6) / np.outer(scale, scale)

    @property
    def seen(self) -> NDArray[np.bool_]:
        """``(free,)`` whether a parameter changes anything in the recording."""
        return np.asarray(self._slope.any(axis=(1, 2)), dtype=np.bool_)

    def spread(self) -> FloatArray:
        """Half the widths of intervals that come from the scores."""
        problem, scores = self._problem, self._slope * self._base
        level = _levels(problem)
        by_episode = np.stack([scores[:, span].sum(axis=1) for span in problem.episodes], axis=-1)  # (D, C, episodes)
        count = len(problem.episodes)
        clusters = (
            by_episode.sum(axis=1) * np.sqrt(count / (count - 1)),
            by_episode.sum(axis=2),
            np.stack([np.bincount(level.ravel(), row.ravel(), _LEVELS) for row in scores]),
        )
        each = [(self._inverse @ scores) ** 2 for scores in clusters]
        variances = np.array([part.sum(axis=1) for part in each])  # (3, D)
        # few that matter tell little of how much they vary
        squares = np.array([np.sum(part**2, axis=1) for part in each])
        degrees = np.maximum(variances**2 / np.maximum(squares, 1e-300) - 1, 1.0)
        noise = np.sum((self._inverse @ by_episode.reshape(len(scores), -1)) ** 2, axis=1)  # it is in each of them
        together = np.maximum(variances.sum(axis=0) - 2 * noise, variances.max(axis=0))
        shared = variances.sum(axis=0) ** 2 / np.maximum((variances**2 / degrees).sum(axis=0), 1e-300)
        return np.sqrt(together) * student.ppf(0.5 + LEVEL / 2, np.maximum(shared, 1.0))

    def moved_by(self, effect: FloatArray) -> FloatArray:
        """By how much an `effect` ``(T, pads, 3, rows, cols)`` on the reading (N) moves each parameter."""
        weighed = self._problem.weigh(self._at(effect)).reshape(self._base.shape)
        return -self._inverse @ np.einsum("atc,tc->a", self._slope, weighed)


def _levels(problem: Problem) -> NDArray[np.intp]:
    """``(T, channels)`` the level of force of each sample, each a fixed ratio above the one below."""
    size = np.abs(problem.simulated).reshape(len(problem.time), -1) / problem.peak
    return np.clip(np.log2(np.maximum(size, 1e-9)) * _PER_OCTAVE + _LEVELS, 0, _LEVELS - 1).astype(np.intp)


def _misplaced(problem: Problem, x: FloatArray) -> Iterator[FloatArray]:
    """What contacts that are off by the tolerance along rows and columns change in `x`."""
    for change in differences(x):
        yield Tolerance().place * change / 2


def _gain_spread(found: Explanation, gains: FloatArray) -> FloatArray | None:
    """``(pads, rows, cols)`` half the width of each taxel's interval.

    Made of what differs from episode to episode, of gains by which the axes of a taxel may be off, of contacts off
    their place, and, for taxels that were hardly pressed, of how far the gains of the others are spread.
    """
    problem = found.problem
    count = len(problem.episodes)
    if count < 3:
        return None
    load = problem.weigh(found.prediction)
    scores = problem.residual(found.prediction) * load
    load = load / np.maximum(np.abs(gains), 0.05)[:, None]
    squares = load**2
    by_axis, weights = squares.sum(axis=0), by_episode(problem, squares)
    products = weights.sum(axis=0)
    scores = by_episode(problem, scores) / np.maximum(np.abs(gains), 0.05)
    prior = drawn(scores + (gains - 1) * weights, weights)[1]
    total = products + prior
    episodes = np.sum(scores**2, axis=0) * count / (count - 1)
    tolerance = Tolerance()
    axes = np.sum((tolerance.gain * gains[:, None] * by_axis) ** 2, axis=1)
    places = sum(np.sum(load * problem.weigh(e), axis=(0, 2)) ** 2 for e in _misplaced(problem, found.prediction))
    told = products > prior
    spread = float(np.std(gains[told])) if told.sum() > 1 else GAIN_PRIOR
    shrunk = (prior * spread) ** 2
    error = np.sqrt(np.maximum(episodes, products) + axes + places + shrunk) / total
    return error * student.ppf(0.5 + LEVEL / 2, count - 1)


def _zero_spread(found: Explanation, name: str) -> FloatArray | None:
    """``(pads, 3, rows, cols)`` half the width of each channel's interval: "offset" or the drift's "amplitude".

    Told, as they are, by what the episodes leave at rest; by all of their frames where noise does not reach a count, by
    those with a load where a dead band holds back the others.
    """
    problem = found.problem
    curves = [np.ones(len(problem.time))]
    for named in found.found:
        if named.name == "drift":
            curves.append(-np.expm1(-(problem.time - problem.time[0]) / np.max(named.values["tau"])))
    frames = np.ones(len(problem.time), dtype=bool) if tells_under_load(problem) else problem.at_rest
    if any(named.name == DEAD_BAND for named in found.found):
        frames = ~problem.at_rest
    spans = [np.flatnonzero(frames[span]) + span.start for span in problem.episodes]
    spans = [span for span in spans if len(span) >= _LEAST_REST]
    if len(spans) <= len(curves) + 1:
        return None
    left = problem.measured - problem.read(found.prediction)
    basis = np.array([[curve[span].mean() for curve in curves] for span in spans])  # (episodes, curves)
    share = (np.linalg.pinv(basis.T @ basis) @ basis.T)[0 if name == "offset" else -1]  # of each episode
    degrees = len(spans) - len(curves)
    means = np.stack([left[span].mean(axis=0) for span in spans])
    variance = np.einsum("e,e...->...", share**2, means**2) * len(spans) / degrees
    typical = np.median(variance, axis=(2, 3), keepdims=True)  # a few episodes tell a variance badly, taxels are alike
    reach = np.sqrt(np.maximum(variance, typical)) * student.ppf(0.5 + LEVEL / 2, degrees)
    middle = problem.read(np.mean(problem.zero, axis=0, keepdims=True))[0] if np.ndim(problem.zero) else 0.0 * reach
    counting = problem.counting
    ends = []
    for share in _NOISES:  # a channel's own, which tells how far its zero is from the edge of a step
        own = replace(counting, dither=share * counting.dither)
        ends += [own.unread(middle - reach), own.unread(middle + reach)]
    return np.ptp(ends, axis=0) / 2
