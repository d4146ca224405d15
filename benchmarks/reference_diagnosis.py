"""What a diagnosis says of magnetic pads from first principles: ``python benchmarks/reference_diagnosis.py``.

The indenter scene follows the protocol ``press``. A manufactured unit of `paxisim.MagneticPad`, with the noise of its
Hall sensors and counts of 0.1 N, is the measured stream, and the forces on the pad are the simulated one. Half of the
episodes are diagnosed, the others are held out. Printed are the causes and the error (N, root of the mean square of a
taxel and axis) on held-out motion: of the simulation, of the extended model, and of the model of the unit before, which
is another unit of the same type.
"""

from __future__ import annotations

import os
import warnings
from dataclasses import replace

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy

import numpy as np
import tyro

import paxisim
from paxisim.protocols.ready import press
from paxisim.reference.pad import MagneticPad
from paxisim.scene import ready

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
RATE = 25.0  # Hz
COUNT = 0.1  # N


def motion() -> paxisim.Recording:
    """The protocol as the simulation feels it."""
    scene = ready.indenter(LAYOUT)
    return scene.simulate(press(stop_force=60.0).unrecorded(scene)).resample(RATE).select(known=True)


def measured(unit: int, force: np.ndarray) -> np.ndarray:
    """What a unit's board reports, in its counts."""
    pad = MagneticPad.unit(LAYOUT, unit)
    readings = pad.measure(force[:, 0].astype(np.float64), np.random.default_rng(unit))
    return (COUNT * np.rint(readings / COUNT)).astype(np.float32)[:, None]


def main(units: int = 6, jobs: int = 1) -> None:
    """Print a row for each unit.

    Args:
        units: How many, from number 0 on.
        jobs: Processes of a diagnosis.
    """
    warnings.simplefilter("ignore")
    felt = motion()
    assert felt.simulated is not None
    even = felt.episode % 2 == 0
    before = None
    for unit in range(units):
        recording = replace(felt, measured=measured(unit, felt.simulated))
        found = paxisim.diagnose(recording[even], jobs=jobs)
        held = recording[~even]

        def error(model: paxisim.Chain, held: paxisim.Recording = held) -> float:
            said = np.concatenate([model.run(part.simulated.astype(np.float64), part.time) for part in held.episodes()])
            return float(np.sqrt(np.mean((held.measured - said) ** 2)))

        errors = [error(paxisim.Chain()), error(found.model)]
        other = "" if before is None else f", by the model of unit {unit - 1} {error(before):.4f}"
        before = found.model
        names = ", ".join(cause.name for cause in found.causes)
        print(f"unit {unit}: {errors[0]:.4f} -> {errors[1]:.4f} N{other}; {found.verdict}: {names}", flush=True)


if __name__ == "__main__":
    tyro.cli(main)
