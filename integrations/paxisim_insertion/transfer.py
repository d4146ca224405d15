"""Transfer: the sensors that stand for the real one in an evaluation ``--transfer``; no training has seen them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import paxisim

from .surrogate import draw, uneven, unit

SURROGATES, UNITS = range(1, 11), range(1, 6)
"""Seeds of the surrogates, each once zeroed in the grasp and once before it; numbers of the magnetic pad's units."""


@dataclass(frozen=True, eq=False)
class StandIn:
    """A sensor that stands for a real one.

    Attributes:
        kind: What it is, and how it was zeroed.
        chain: What the simulator's readings pass through.
        surface: ``(pads, rows, cols)`` heights of the taxels (m).
    """

    kind: str
    chain: paxisim.Chain
    surface: NDArray[np.floating]


def sensors(layout: paxisim.TaxelLayout) -> list[StandIn]:
    """25 sensors for pads of a layout, the kinds taking turns."""
    turns = []
    for number in UNITS:
        for seed in SURROGATES[2 * number - 2 : 2 * number]:
            surface = uneven(seed, layout)
            turns.append(StandIn("zeroed in the grasp", draw(seed, field=False), surface))
            turns.append(StandIn("zeroed while open", draw(seed), surface))
        surface = uneven(SURROGATES[-1] + number, layout)
        turns.append(StandIn("magnetic pad", unit(f"unit:{number}", layout), surface))
    return turns
