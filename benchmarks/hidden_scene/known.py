"""What is known of a magnetic pad beforehand: its product's operator, or a calibration of the same unit."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

import paxisim
from hidden_scene import bench
from hidden_scene.cases import COUNT
from paxisim.protocols.ready import press
from paxisim.scene import ready

RATE = 25.0  # Hz


@cache
def known_sensor(unit: int, known: str) -> paxisim.augment.Transform | None:
    """Return the sensor to give to a diagnosis; None for nothing.

    Args:
        unit: Number of the unit.
        known: ``"product"`` for the nominal operator, ``"unit"`` for the model from a press of this unit on a flat
            bench, or empty.
    """
    if not known:
        return None
    if known == "product":
        return paxisim.nominal_operator(bench.LAYOUT)
    scene = ready.indenter(bench.LAYOUT)
    felt = scene.simulate(press(stop_force=60.0).unrecorded(scene)).resample(RATE).select(known=True)
    assert felt.simulated is not None
    pad = paxisim.MagneticPad.unit(bench.LAYOUT, unit)
    reading = pad.measure(felt.simulated[:, 0].astype(np.float64), np.random.default_rng([unit, 5]))
    measured = (COUNT * np.rint(reading / COUNT)).astype(np.float32)[:, None]
    return paxisim.diagnose(replace(felt, measured=measured)).model
