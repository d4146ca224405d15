"""Diagnosis of magnetic pads from first principles: ``python benchmarks/reference_diagnosis.py``.

The indenter scene follows the protocol ``press``. The measured stream comes from a manufactured unit of
`paxisim.MagneticPad`, with the noise of its Hall sensors and counts of 0.1 N; the simulated stream holds the forces on
the pad. Half of the episodes are diagnosed, and the others are held out. The script prints the causes and the error on
held-out motion (N, root mean square per taxel and axis) of the simulation, of the extended model, and of the model of
the previous unit, which is another unit of the same type.

With ``--model-of 2`` only that unit is diagnosed. The script then prints the errors of its model on all units: without
changes, with an offset per taxel and axis fitted to the diagnosed half of the episodes, and with a gain as well. The
differences show what has to be calibrated for each unit.
"""

from __future__ import annotations

import os
import warnings
from dataclasses import replace

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


def main(units: int = 6, jobs: int = 1, model_of: int | None = None, uneven: bool = False) -> None:
    """Print a row for each unit.

    Args:
        units: Number of units, from number 0 on.
        jobs: Number of processes per diagnosis.
        model_of: Diagnose only this unit, and apply its model to all units.
        uneven: Whether the units have their uneven surfaces, which the simulation does not; those behind the published
            figures were flat.
    """
    warnings.simplefilter("ignore")
    felt = motion()
    assert felt.simulated is not None
    even = felt.episode % 2 == 0

    def halves(unit: int) -> tuple[paxisim.Recording, paxisim.Recording]:
        real = motion(MagneticPad.unit(LAYOUT, unit).heights) if uneven else felt
        recording = replace(felt, measured=measured(unit, real.simulated))
        return recording[even], recording[~even]

    if model_of is not None:
        transfer(paxisim.diagnose(halves(model_of)[0], jobs=jobs).model, [halves(unit) for unit in range(units)])
        return
    before = None
    for unit in range(units):
        seen, held = halves(unit)
        found = paxisim.diagnose(seen, jobs=jobs)
        errors = [rms(held.measured - said(model, held)) for model in (paxisim.Chain(), found.model)]
        other = "" if before is None else f", model of unit {unit - 1} {rms(held.measured - said(before, held)):.4f}"
        before = found.model
        names = ", ".join(cause.name for cause in found.causes)
        print(f"unit {unit}: {errors[0]:.4f} -> {errors[1]:.4f} N{other}; {found.verdict}: {names}", flush=True)


def transfer(model: paxisim.Chain, units: list[tuple[paxisim.Recording, paxisim.Recording]]) -> None:
    """Print the errors of a model on several units."""
    print(f"model: {', '.join(model.names)}")
    for unit, (seen, held) in enumerate(units):
        first, second = said(model, seen), said(model, held)
        offset = (seen.measured - first).mean(axis=0)
        centred = first - first.mean(axis=0)
        gain = ((seen.measured - seen.measured.mean(axis=0)) * centred).sum(axis=0) / (centred**2).sum(axis=0)
        scaled = seen.measured.mean(axis=0) + gain * (second - first.mean(axis=0))
        errors = [rms(held.measured - guess) for guess in (held.simulated, second, second + offset, scaled)]
        print(
            "unit {}: simulation {:.4f} N, model {:.4f}, with own offsets {:.4f}, with own gains too {:.4f}".format(
                unit, *errors
            )
        )


if __name__ == "__main__":
    tyro.cli(main)
