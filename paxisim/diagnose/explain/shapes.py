"""Shapes: regressors that a residual may correlate with, and the held-out energy that each of them explains.

The residual is regressed on about thirty shapes, one at a time, with one coefficient per axis. Tolerated errors of each
channel (a constant per episode, a gain, a displacement) are first projected out of both, which is more sensitive than
adding them to the noise. Only sums over episodes are kept, so that memory does not grow with the recording.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from paxisim.diagnose.data.noise import differences, rate
from paxisim.diagnose.data.problem import FloatArray, Problem

MAX_GROUPS = 16  # most groups of episodes that are held out together
MAX_FRAMES = 2000  # most frames per episode; longer episodes are thinned
RIDGE = 1e-3  # relative to the energy of a shape

_MOVING = 0.0015  # s, tolerated error of a time stamp
_TOLERATED = 3  # shapes of tolerated errors besides a constant: gain, two displacements


@dataclass(frozen=True, eq=False)
class Shapes:
    """Sums over groups of episodes, in units of the noise, with tolerated errors projected out.

    Attributes:
        names: Description of each shape.
        products: ``(groups, 3, shapes)`` inner product of each shape with itself, by axis.
        projections: ``(groups, 3, shapes)`` inner product of each shape with the residual.
        explained: Energy of the model's change to the simulation, with tolerated errors projected out.
        load: Energy of the force, without constants.
        samples: Number of values compared.
    """

    names: tuple[str, ...]
    products: FloatArray
    projections: FloatArray
    explained: float
    load: float
    samples: int

    def gains(self) -> FloatArray:
        """``(shapes, groups)`` energy that each shape explains in each group when fitted on the other groups."""
        products, projections = np.moveaxis(self.products, -1, 0), np.moveaxis(self.projections, -1, 0)
        factor = others(projections, 1) / (others(products, 1) + RIDGE * products.sum(axis=1, keepdims=True) + 1e-9)
        return np.sum(2 * factor * projections - factor**2 * products, axis=2)


def others(sums: FloatArray, axis: int) -> FloatArray:
    """The sum over all other groups; a single group is its own sum."""
    return sums.sum(axis=axis, keepdims=True) - sums if sums.shape[axis] > 1 else sums


def shapes_of(problem: Problem, prediction: FloatArray) -> Shapes:
    """The sums for the residual of a prediction.

    Args:
        problem: The recording.
        prediction: ``(T, pads, 3, rows, cols)`` newtons, the output of the model.
    """
    noise, scales = problem.noise.sigma.min(axis=0), _scales(problem, prediction)
    largest = np.zeros((prediction.shape[1], *prediction.shape[3:]))
    names: list[str] = []
    grams: list[FloatArray] = []
    samples = 0
    for number, span in enumerate(problem.episodes):
        x, simulated = prediction[span], problem.simulated[span]
        thin = slice(None, None, -(-len(x) // MAX_FRAMES))
        jitter = _MOVING * rate(simulated, problem.time[span])
        weight = (problem.alive / np.sqrt(noise**2 + jitter**2))[thin]
        residual = problem.measured[span] - problem.read(x)
        shapes = dict(_shapes_at(problem, span, x, largest, scales))
        names = list(shapes)
        columns = [np.ones_like(x), x, *differences(x, beyond="edge"), residual, x - simulated, *shapes.values()]
        rows = np.stack([np.broadcast_to(column[thin], weight.shape) * weight for column in columns])
        rows = np.ascontiguousarray(np.moveaxis(rows.reshape(*rows.shape[:2], -1), 2, 0))
        gram = _without_constant(np.matmul(rows, np.swapaxes(rows, 1, 2)))
        samples += len(weight) * int(problem.alive.sum())
        if len(grams) < MAX_GROUPS:
            grams.append(gram)
        else:
            grams[number % MAX_GROUPS] += gram
        largest = np.maximum(largest, np.abs(x[:, :, 2]).max(axis=0))
    return _freed(problem, tuple(names), np.array(grams), samples)


def _without_constant(gram: FloatArray) -> FloatArray:
    """The Gram matrix without its first row, a constant, after projecting that out of the others."""
    first = gram[:, :1]
    return (gram - np.swapaxes(first, 1, 2) * first / (first[:, :, :1] + 1e-9))[:, 1:, 1:]


def _freed(problem: Problem, names: tuple[str, ...], grams: FloatArray, samples: int) -> Shapes:
    """Project the tolerated errors out of residual and shapes, over the whole recording."""
    own, rest = slice(0, _TOLERATED), slice(_TOLERATED, None)
    total = grams.sum(axis=0)
    ridge = 1e-6 * np.trace(total[:, own, own], axis1=-2, axis2=-1)[:, None, None] + 1e-9
    factors = np.linalg.solve(total[:, own, own] + ridge * np.eye(_TOLERATED), total[:, own, rest])
    mixed = np.swapaxes(factors, 1, 2) @ grams[:, :, own, rest]
    square = np.swapaxes(factors, 1, 2) @ grams[:, :, own, own] @ factors
    free = grams[:, :, rest, rest] - mixed - np.swapaxes(mixed, 2, 3) + square
    pads, _, rows, cols = problem.alive.shape
    by_axis = free.reshape(len(grams), pads, 3, rows * cols, *free.shape[2:]).sum(axis=(1, 3))
    energy = np.einsum("gaii->gai", by_axis)
    explained, load = float(energy[:, :, 1].sum()), float(grams[:, :, 0, 0].sum())
    return Shapes(names, energy[:, :, 2:], by_axis[:, :, 0, 2:], explained, load, samples)


def _scales(problem: Problem, x: FloatArray) -> tuple[float, float, float]:
    """Largest force on a pad (N), its fastest change and that of a channel (N/s), to compare shapes of episodes."""
    total = np.abs(x[:, :, 2]).sum(axis=(2, 3))
    speed, fastest = (
        max(float(np.abs(rate(values[span], problem.time[span])).max()) for span in problem.episodes)
        for values in (total, x)
    )
    return float(total.max()) + 1e-9, speed + 1e-9, fastest + 1e-9


def _shapes_at(
    problem: Problem, span: slice, x: FloatArray, largest: FloatArray, scales: tuple[float, float, float]
) -> Iterator[tuple[str, FloatArray]]:
    """Description of each shape, and its values in this episode.

    `largest` is the largest earlier normal force of each taxel, ``(pads, rows, cols)`` N.
    """
    (most_total, most_speed, most_rate), time = scales, problem.time[span]
    moving = rate(x, time)
    interval = float(np.median(np.diff(time)))
    size = np.linalg.norm(x, axis=2, keepdims=True) / problem.peak
    normal = np.abs(x[:, :, 2:]) / problem.peak
    most = np.maximum(np.maximum.accumulate(normal, axis=0), largest[None, :, None] / problem.peak)
    total = np.abs(x[:, :, 2:]).sum(axis=(3, 4), keepdims=True) / most_total
    speed = np.abs(rate(total, time)) * most_total / most_speed
    sideways = np.linalg.norm(x.sum(axis=(3, 4), keepdims=True)[:, :, :2], axis=2, keepdims=True) / most_total
    friction = sideways / (total + 0.02)
    rows, cols = (np.linspace(-1, 1, count) for count in x.shape[-2:])

    def slow(values: FloatArray, tau: float) -> FloatArray:
        keep = np.exp(-interval / tau)
        return np.asarray(lfilter([1 - keep], [1, -keep], values, axis=0))

    yield "the magnitude of the force", x * size
    yield "the squared magnitude of the force", x * size**2
    yield "the rate of change of the force", moving
    for tau in (0.3, 1.5, 6.0):
        yield f"the force over the last {tau:g} s", slow(x, tau)
    yield "the total force on the pad", x * total
    yield "the squared total force on the pad", x * total**2
    for tau in (0.3, 1.0, 3.0):
        past = slow(total, tau)
        yield f"the total force on the pad over the last {tau:g} s", x * past
        yield f"the squared total force on the pad over the last {tau:g} s", x * past**2
    yield "the loading speed of the taxel", x * np.sqrt(np.abs(moving) / most_rate)
    yield "the loading speed of the pad", x * np.sqrt(speed)
    yield "the present force relative to the largest earlier force", x * normal / (most + 0.01)
    yield "the largest earlier force", x * most
    yield "the largest earlier force, saturating early", x * np.exp(-most / 0.3)
    yield "the row times the rate of change: rows may be scanned one after another", moving * rows[:, None]
    yield "the column times the rate of change: columns may be scanned one after another", moving * cols
    yield "the ratio of shear to normal force", x * friction
    yield "the shear above a fixed share of the normal force", x * np.maximum(friction - 0.15, 0.0)
    yield "time", x * _centred(problem.time, span)
    for name, values in problem.covariates.items():
        if name != "gripper_opening" and np.ptp(values) > 1e-9:
            yield f"{name} times the force", x * _centred(values, span)


def _centred(values: FloatArray, span: slice) -> FloatArray:
    return ((values[span] - values.mean()) / max(float(np.ptp(values)), 1e-12))[:, None, None, None, None]
