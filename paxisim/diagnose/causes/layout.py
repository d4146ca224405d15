"""Layout: taxels, axes or pads are swapped or reversed; read off the correlations of the streams."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product

import numpy as np

from paxisim import augment
from paxisim.diagnose.causes.channel_curve import mixes_alike
from paxisim.diagnose.causes.channels import Response, response_of
from paxisim.diagnose.causes.kinds import DetectedCause, Reading
from paxisim.diagnose.data.problem import FloatArray, Problem, with_noise
from paxisim.diagnose.rules import CHECKS


def _read(problem: Problem) -> Reading | None:
    """Return the layout under which the streams correlate clearly better than under the given one, if there is one.

    The order of taxels and pads is found from the normal force regardless of its sign, that of the axes from all three
    forces.
    """
    pads, _, rows, cols = problem.alive.shape
    orders = [None, *list(permutations(range(pads)))[1:]] if pads <= 3 else [None]
    either = (False, True)
    moves = product(orders, either, either, either if rows == cols else (False,))
    faults = [augment.LayoutFault(down, across, turned, order) for order, down, across, turned in moves]
    responses = [_responses(problem, fault(problem.simulated), 2, 2) for fault in faults]
    alike = np.stack([_correlations(each) for each in responses])
    alike *= np.sign(alike.mean(axis=1, keepdims=True))  # the sign of the normal force may be reversed
    best = int(np.argmax(np.round(alike.mean(axis=1), 9)))
    clear = (alike[best] - alike[0]).mean() > CHECKS.better
    if not clear or not _fits_all(responses[0].total, responses[best].total):
        best = 0
    signs, order = _axes(problem, faults[best](problem.simulated))
    if not best and signs == (1, 1, 1) and order == (0, 1, 2):
        return None
    fault = replace(faults[best], axis_signs=signs, axis_order=order)
    return Reading(fault, {}, with_noise(replace(problem, simulated=fault(problem.simulated))))


def _responses(problem: Problem, simulated: FloatArray, axis: int, simulated_axis: int) -> Response:
    """Response of one axis to the simulated force of one axis, in the episodes with a load; the first one if none."""
    force = simulated[:, :, simulated_axis]
    least = max(CHECKS.load * np.abs(force).max(), problem.noise.step)
    spans = [span for span in problem.episodes if np.abs(force[span]).max() > least] or problem.episodes[:1]
    return response_of(spans, force, problem.measured[:, :, axis])


def _correlations(response: Response) -> FloatArray:
    """``(episodes,)`` correlations over all taxels."""
    force, both, reading = (v.sum(axis=(1, 2, 3)) for v in (response.force, response.product, response.reading))
    return both / np.sqrt(force * reading + 1e-12)


def _fits_all(given: Response, moved: Response) -> bool:
    """Whether most moved taxels correlate as well at their new place, not only the few that carry most of the load."""
    before, after = (np.abs(v.product) / np.sqrt(v.force * v.reading + 1e-12) for v in (given, moved))
    load = np.sqrt(np.maximum(given.force, moved.force))
    loaded = (load > CHECKS.load * load.max()) & (given.force != moved.force)
    return float(np.mean((after > before - CHECKS.equal)[loaded])) > CHECKS.moved


def _axes(problem: Problem, simulated: FloatArray) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
    """Signs and order of the axes, from their correlations with the simulated axes."""

    def alike(axis: int, other: int) -> float:
        return float(_correlations(_responses(problem, simulated, axis, other)).mean())

    straight, crossed = (abs(alike(0, i)) + abs(alike(1, 1 - i)) for i in range(2))
    order = (1, 0, 2) if crossed > straight + 0.8 else (0, 1, 2)  # 0.4 for each axis; coupling raises `crossed` too
    signs = [1, 1, 1]
    for axis, other in enumerate(order):
        if alike(axis, other) < -0.4 and (axis == 2 or _turned(problem, simulated, axis, other)):
            signs[axis] = -1
    return (signs[0], signs[1], signs[2]), order


def _turned(problem: Problem, simulated: FloatArray, axis: int, other: int) -> bool:
    """Whether a shear reading has the opposite sign of the simulated shear, with the normal force regressed out.

    Leakage of the normal force into the shear reading may exceed the small shear of a press.
    """
    force = np.stack([simulated[:, :, other].ravel(), simulated[:, :, 2].ravel()])
    measured = problem.measured[:, :, axis] - np.median(problem.measured[:, :, axis], axis=0)
    return bool(np.linalg.lstsq(force @ force.T, force @ measured.ravel(), rcond=None)[0][0] < 0)


LAYOUT = DetectedCause(
    name="layout",
    order=0,
    excites="corners",
    read=_read,
    barred=mixes_alike,
    words="Taxels, axes or pads are swapped or reversed.",
    picture="mapping",
)
