"""Transfer: the sensors of ``evaluate --transfer``, stand-ins for a real one that no training has seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import paxisim

from .surrogate import draw, uneven, unit

SURROGATES, UNITS = range(1, 11), range(1, 6)
"""Seeds of the surrogates, each zeroed once in the grasp and once before it; unit numbers of the magnetic pad."""


@dataclass(frozen=True, eq=False)
class StandIn:
    """A stand-in for a real sensor.

    Attributes:
        kind: Type of the sensor, or how it was zeroed.
        chain: Chain applied to the simulator's readings.
        surface: ``(pads, rows, cols)`` heights of the taxels (m).
    """

    kind: str
    chain: paxisim.Chain
    surface: NDArray[np.floating]


def sensors(layout: paxisim.TaxelLayout) -> list[StandIn]:
    """Return 25 sensors for pads of a layout, with alternating kinds."""
    turns = []
    for number in UNITS:
        for seed in SURROGATES[2 * number - 2 : 2 * number]:
            surface = uneven(seed, layout)
            turns.append(StandIn("zeroed in the grasp", draw(seed, field=False), surface))
            turns.append(StandIn("zeroed while open", draw(seed), surface))
        surface = uneven(SURROGATES[-1] + number, layout)
        turns.append(StandIn("magnetic pad", unit(f"unit:{number}", layout), surface))
    return turns
