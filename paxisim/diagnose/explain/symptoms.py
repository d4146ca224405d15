"""Symptoms: the error by pad, taxel, axis, phase, frequency and covariate, before and after the correction."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from paxisim.diagnose.data.noise import rate
from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.result import Place, Symptoms

WORST = 10  # taxels listed
EDGES = (0.0, 0.2, 1.0, 3.0, 10.0)  # Hz, lower edge of each frequency band
PHASES = ("free", "loading", "holding", "unloading", "sliding")
_STILL = 0.05  # peaks per second; a force that changes more slowly counts as held


def symptoms(problem: Problem, simulated: FloatArray, prediction: FloatArray, pads: tuple[str, ...]) -> Symptoms:
    """Locate the error.

    Args:
        problem: The recording.
        simulated: ``(T, pads, 3, rows, cols)`` newtons, simulation as recorded.
        prediction: Prediction of the extended model, of the same shape.
        pads: Names of the pads.
    """
    residuals = [(problem.measured - problem.read(force)) * problem.weight for force in (simulated, prediction)]
    squares = [residual**2 for residual in residuals]
    whole = max(float(squares[0].sum()), 1e-12)

    def places(names: Sequence[str], energy: Callable[[FloatArray], FloatArray], of: Sequence[FloatArray] = squares):
        shares = [np.asarray(energy(own)) / whole for own in of]
        return tuple(Place(name, float(a), float(b)) for name, a, b in zip(names, *shares, strict=True))

    taxels = squares[0].sum(axis=(0, 2))
    worst = np.argsort(taxels.ravel())[::-1][:WORST]
    at = zip(*np.unravel_index(worst, taxels.shape), strict=True)
    phase = phases_of(problem)
    bands = [*(f"{low:g} to {high:g} Hz" for low, high in itertools.pairwise(EDGES)), f"above {EDGES[-1]:g} Hz"]
    frequencies = places(bands, lambda residual: _bands(problem, residual), residuals)
    return Symptoms(
        pads=places(pads, lambda square: square.sum(axis=(0, 2, 3, 4))),
        axes=places("xyz", lambda square: square.sum(axis=(0, 1, 3, 4))),
        taxels=places([f"{pads[p]} ({r}, {c})" for p, r, c in at], lambda s: s.sum(axis=(0, 2)).ravel()[worst]),
        phases=places(PHASES, lambda square: np.array([square[phase == name].sum() for name in PHASES])),
        frequencies=tuple(band for band in frequencies if band.before or band.after),
        covariates=_covariates(problem, residuals),
    )


def phases_of(problem: Problem) -> np.ndarray:
    """``(T, pads)`` phase of the motion, one of `PHASES`.

    A contact slides if its centre of pressure moves, or its shear changes faster than the normal force. The axes of
    calibrated channels are not those of a force, so they never count as sliding.
    """
    x = problem.simulated
    normal = np.abs(x).sum(axis=(2, 3, 4)) if problem.calibrated else x[:, :, 2].sum(axis=(2, 3))
    shear = x[:, :, :2].sum(axis=(3, 4))
    rows, cols = np.indices(x.shape[-2:])
    weight = np.abs(x[:, :, 2]) / np.maximum(np.abs(x[:, :, 2]).sum(axis=(2, 3), keepdims=True), 1e-9)
    middle = np.stack([(weight * rows).sum(axis=(2, 3)), (weight * cols).sum(axis=(2, 3))], axis=-1)

    def changing(values: FloatArray) -> FloatArray:
        return np.concatenate([rate(values[span], problem.time[span]) for span in problem.episodes])

    largest = max(float(np.abs(normal).max()), 1e-9)
    pressed = np.abs(normal) > 0.01 * largest
    force, sideways = changing(normal) / largest, np.linalg.norm(changing(shear), axis=-1) / largest
    moving = np.linalg.norm(changing(middle), axis=-1) > 0.5  # taxels per second
    phase = np.full(normal.shape, "holding", dtype=object)
    phase[force > _STILL] = "loading"
    phase[force < -_STILL] = "unloading"
    slides = (moving | (sideways > _STILL)) & (np.maximum(sideways, _STILL) > np.abs(force))
    phase[slides & (not problem.calibrated)] = "sliding"
    phase[~pressed] = "free"
    return phase


def _bands(problem: Problem, residual: FloatArray) -> FloatArray:
    """``(bands,)`` energy of a residual in each frequency band."""
    power = np.zeros(len(EDGES))
    for span in problem.episodes:
        values = residual[span].reshape(span.stop - span.start, -1)
        interval = max(float(np.median(np.diff(problem.time[span]))), 1e-6)
        spectrum = np.sum(np.abs(np.fft.rfft(values, axis=0)) ** 2, axis=1) / len(values)
        spectrum[1:] *= 2
        band = np.digitize(np.fft.rfftfreq(len(values), interval), EDGES) - 1
        power += np.bincount(band, spectrum, len(EDGES))
    return power


def _covariates(problem: Problem, residuals: Sequence[FloatArray]) -> tuple[Place, ...]:
    """Largest squared correlation of a pad's mean residual on an axis with each covariate and with time, at rest."""
    rest = problem.at_rest if problem.at_rest.sum() >= 20 else np.ones(len(problem.time), dtype=bool)
    found = []
    for name, values in {"time": problem.time, **problem.covariates}.items():
        value = values[rest] - values[rest].mean()
        if np.ptp(value) < 1e-9:
            continue
        shares = []
        for residual in residuals:
            mean = residual[rest].mean(axis=(3, 4)).reshape(rest.sum(), -1)
            mean = mean - mean.mean(axis=0)
            energy = np.sum(value**2) * np.sum(mean**2, axis=0)
            shares.append(float(np.max((value @ mean) ** 2 / np.maximum(energy, 1e-12))))
        found.append(Place(f"{name}, at rest", *shares))
    return tuple(found)
