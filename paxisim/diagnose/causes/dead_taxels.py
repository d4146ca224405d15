"""Dead taxels: taxels that never respond, stop responding or are stuck at a level; read off the streams."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from paxisim import augment
from paxisim.diagnose.causes.failures import failures_of
from paxisim.diagnose.causes.kinds import DetectedCause, Reading
from paxisim.diagnose.data.channels import loaded_taxels, response_of, rest_noise
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.rules import CHECKS


def _read(problem: Problem) -> Reading | None:
    """Return the taxels that do not respond on any axis although they are pressed in the simulation."""
    level, noise = np.median(problem.measured, axis=0), rest_noise(problem)
    floor = max(CHECKS.count * problem.noise.step, 0.03)
    dead = _never_respond(problem, noise) | _still(problem, level, noise, floor)
    gone = np.broadcast_to(dead[:, None], problem.alive.shape)
    since = np.where(gone, 0.0, np.inf)
    failures = failures_of(problem)
    if failures is not None:  # a taxel that failed early may seem to have been dead all along
        gone = np.where(failures.failed.any(axis=1, keepdims=True), failures.failed, gone)
        since = np.where(gone, np.where(failures.failed, failures.since, 0.0), np.inf)
        level = np.where(failures.failed, failures.level, level)
    if not gone.any():
        return None
    dead = gone.any(axis=1)
    stuck = dead & (np.abs(level * gone).max(axis=1) > floor)
    fault = augment.DeadTaxels((dead & ~stuck).astype(float), stuck.astype(float), level * stuck[:, None])
    values = {"dead": fault.dead, "stuck": fault.stuck, "value": fault.value}
    if failures is not None:
        fault = augment.FailingTaxels(fault.dead, fault.stuck, fault.value, np.where(dead[:, None], since, 0.0))
        values["since"] = np.where(dead, since.min(axis=1), 0.0)
    return Reading(fault, values, replace(problem, alive=problem.alive & ~gone))


def _never_respond(problem: Problem, noise: FloatArray) -> NDArray[np.bool_]:
    """``(pads, rows, cols)`` taxels that are pressed, and do not respond on any axis, not even late."""
    each = response_of(problem.episodes, problem.simulated, problem.measured)
    missing = each.total.is_missing(noise)
    # slow noise may resemble a faint shear, but not consistently in all episodes
    shared = np.abs(each.total.product) > CHECKS.consistent * np.sqrt(np.sum(each.product**2, axis=0))
    missing[:, :2] |= ~(shared | (np.abs(each.total.slope) > CHECKS.responds))[:, :2]
    dead = missing.all(axis=1) & (each.total.score(noise, 1.0) < -CHECKS.certain)[:, 2]
    # a late response is no multiple of the force, but it is no noise either
    return dead & each.total.is_quiet(noise)[:, 2] & (loaded_taxels(problem).sum(axis=0) >= CHECKS.samples)


def _still(problem: Problem, level: FloatArray, noise: FloatArray, floor: float) -> NDArray[np.bool_]:
    """``(pads, rows, cols)`` taxels that are stuck at an unusual level on all axes while pressed, however lightly.

    Light presses suffice if the force spans a count, because no dead band suppresses a non-zero reading.
    """
    usual = np.median(np.abs(level), axis=(2, 3), keepdims=True)
    far = (np.abs(level) > CHECKS.unusual * (usual + floor)).any(axis=1) | _unmoved(problem, floor)
    if not far.any():
        return far
    total = response_of(problem.episodes, problem.simulated, problem.measured).total
    energy, product = np.sum(total.force / noise**2, axis=1), np.sum(total.product / noise**2, axis=1)
    missing = (energy - product) / np.sqrt(np.maximum(energy, 1e-12))  # z-score of the missing response
    still = total.is_quiet(noise).all(axis=1)
    reached = np.abs(problem.simulated).max(axis=(0, 2)) > problem.noise.step
    return far & still & reached & (product < CHECKS.responds * energy) & (missing > CHECKS.certain)


def _unmoved(problem: Problem, floor: float) -> NDArray[np.bool_]:
    """``(pads, rows, cols)`` taxels whose reading before contact stays constant while that of the others drifts."""
    spans = [span for span in problem.episodes if problem.untouched[span].any()]
    if not spans:
        return np.zeros_like(problem.alive[:, 0])
    moved = np.std([np.mean(problem.measured[span][problem.untouched[span]], axis=0) for span in spans], axis=0)
    usual = np.median(moved, axis=(2, 3), keepdims=True)
    drifting = usual > floor
    return drifting.any() & (~drifting | (moved < CHECKS.unmoved * usual)).all(axis=1)


DEAD_TAXELS = DetectedCause(
    name="dead_taxels",
    order=95,
    excites="places",
    read=_read,
    words="Some taxels do not respond to force, or stop responding.",
    picture="silent_map",
)
