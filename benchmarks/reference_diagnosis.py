"""Diagnosis of magnetic pads from first principles: ``python benchmarks/reference_diagnosis.py``.

The indenter scene follows the protocol ``press``. The measured stream comes from a manufactured unit of
`paxisim.MagneticPad`, with the noise of its Hall sensors and counts of 0.1 N; the simulated stream holds the forces on
the pad. Half of the episodes are diagnosed, and the others are held out. The script prints the causes and the error on
held-out motion (N, root mean square per taxel and axis) of the simulation, of the extended model, and of the model of
the previous unit, which is another unit of the same type: without changes, and recalibrated with an offset and a gain
for each taxel and axis, fitted to the diagnosed half of the episodes.

With ``--model-of 2`` only that unit is diagnosed. The script then prints the errors of its model on all units, which
show what has to be calibrated for each unit.
"""

from __future__ import annotations

import os
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import numpy as np
import tyro

import paxisim
from paxisim.protocols.ready import press
from paxisim.reference.pad import MagneticPad
from paxisim.scene import ready

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
RATE = 25.0  # Hz
COUNT = 0.1  # N


def motion(heights: np.ndarray | None = None) -> paxisim.Recording:
    """Return the protocol with the forces that the simulation computes on a surface, by default a flat one."""
    scene = ready.indenter(LAYOUT, heights)
    return scene.simulate(press(stop_force=60.0).unrecorded(scene)).resample(RATE).select(known=True)


def measured(unit: int, force: np.ndarray) -> np.ndarray:
    """Return a unit's readings, rounded to its counts."""
    pad = MagneticPad.unit(LAYOUT, unit)
    readings = pad.measure(force[:, 0].astype(np.float64), np.random.default_rng(unit))
    return (COUNT * np.rint(readings / COUNT)).astype(np.float32)[:, None]


def said(model: paxisim.Chain, recording: paxisim.Recording) -> np.ndarray:
    """Return a model's prediction from the simulated stream."""
    parts = [model.run(part.simulated.astype(np.float64), part.time) for part in recording.episodes()]
    return np.concatenate(parts)


def rms(error: np.ndarray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(error**2)))


@cache
def flat() -> paxisim.Recording:
    """Return the motion on a flat surface."""
    return motion()


def halves(unit: int, uneven: bool) -> tuple[paxisim.Recording, paxisim.Recording]:
    """Return the episodes of a unit that are diagnosed, and those that are held out."""
    felt = flat()
    real = motion(MagneticPad.unit(LAYOUT, unit).heights) if uneven else felt
    assert real.simulated is not None
    recording = replace(felt, measured=measured(unit, real.simulated), layout=LAYOUT)
    even = felt.episode % 2 == 0
    return recording[even], recording[~even]


@dataclass(frozen=True)
class Row:
    """What the diagnosis of a unit gave.

    Attributes:
        unit: Number of the unit.
        errors: Errors on held-out motion (N) of the simulation and of the extended model.
        model: The extended model.
        text: Verdict and causes.
        names: Names of the causes.
        seconds: Processor time of the diagnosis.
    """

    unit: int
    errors: tuple[float, float]
    model: paxisim.Chain
    text: str
    names: tuple[str, ...]
    seconds: float


def diagnosed(unit: int, uneven: bool) -> Row:
    """Diagnose one half of a unit's episodes."""
    warnings.simplefilter("ignore")
    seen, held = halves(unit, uneven)
    begun = time.process_time()
    found = paxisim.diagnose(seen)
    seconds = time.process_time() - begun
    errors = [rms(held.measured - said(model, held)) for model in (paxisim.Chain(), found.model)]
    causes = [f"{c.name} ({', '.join(part.name for part in c.parts)})" if c.parts else c.name for c in found.causes]
    names = tuple(cause.name for cause in found.causes)
    return Row(unit, (errors[0], errors[1]), found.model, f"{found.verdict}: {', '.join(causes)}", names, seconds)


def main(units: int = 6, first: int = 0, jobs: int = 1, model_of: int | None = None, uneven: bool = False) -> None:
    """Print a row for each unit.

    Args:
        units: Number of units.
        first: Number of the first unit. Those below 100 were used in development.
        jobs: Number of processes.
        model_of: Diagnose only this unit, and apply its model to all units.
        uneven: Whether the units have their uneven surfaces, which the simulation does not.
    """
    numbers = range(first, first + units)
    if model_of is not None:
        model = diagnosed(model_of, uneven).model
        print(f"model: {', '.join(model.names)}")
        for unit in numbers:
            errors = recalibrated(model, unit, uneven)
            words = "unit {}: simulation {:.4f} N, model {:.4f}, with own offsets {:.4f}, with own gains too {:.4f}"
            print(words.format(unit, *errors))
        return
    halves(first, uneven)  # simulates the motion once, before the processes fork
    rows: list[Row] = []
    others: list[tuple[float, float, float, float]] = []
    with ProcessPoolExecutor(jobs) as pool:
        for row in pool.map(diagnosed, numbers, [uneven] * units):
            before, after = row.errors
            beside = recalibrated(rows[-1].model, row.unit, uneven) if rows else None
            other = f", model of unit {rows[-1].unit} {beside[1]:.4f}, recalibrated {beside[3]:.4f}" if beside else ""
            print(f"unit {row.unit}: {before:.4f} -> {after:.4f} N{other}; {row.text}; {row.seconds:.0f} s", flush=True)
            rows.append(row)
            others += [beside] if beside else []
    errors = np.array([row.errors for row in rows])
    print(
        f"mean: {errors[:, 0].mean():.4f} -> {errors[:, 1].mean():.4f} N; halved on "
        f"{int(np.sum(errors[:, 1] <= errors[:, 0] / 2))} of {units}; offset named on "
        f"{sum('offset' in row.names for row in rows)}; median {np.median([row.seconds for row in rows]):.0f} s"
    )
    if others:
        print("model of another unit: {1:.4f} N, recalibrated {3:.4f} N".format(*np.mean(others, axis=0)))


def recalibrated(model: paxisim.Chain, unit: int, uneven: bool) -> tuple[float, float, float, float]:
    """Return errors on held-out motion (N) of a model that was made for another unit.

    Returns:
        Errors of the simulation, of the model, of the model with an offset for each taxel and axis fitted to the
        diagnosed half of this unit's episodes, and with an offset and a gain.
    """
    seen, held = halves(unit, uneven)
    assert seen.measured is not None
    first, second = said(model, seen), said(model, held)
    offset = (seen.measured - first).mean(axis=0)
    centred = first - first.mean(axis=0)
    power = (centred**2).sum(axis=0)
    # a channel that the model hardly moves says nothing about its gain
    gain = ((seen.measured - seen.measured.mean(axis=0)) * centred).sum(axis=0) / np.maximum(power, 1e-12)
    gain = np.where(power > len(first) * (COUNT / 10) ** 2, gain, 1.0)
    scaled = seen.measured.mean(axis=0) + gain * (second - first.mean(axis=0))
    errors = [rms(held.measured - guess) for guess in (held.simulated, second, second + offset, scaled)]
    return errors[0], errors[1], errors[2], errors[3]


if __name__ == "__main__":
    tyro.cli(main)
