"""Transfer: the sensors that stand for the real one in an evaluation ``--transfer``; no training has seen them."""

from __future__ import annotations

import paxisim

from .surrogate import draw, unit

SURROGATES, UNITS = range(1, 11), range(1, 6)
"""Seeds of the surrogates, each once zeroed in the grasp and once before it; numbers of the magnetic pad's units."""


def sensors(layout: paxisim.TaxelLayout) -> list[tuple[str, paxisim.Chain]]:
    """25 sensors for pads of a layout, the kinds taking turns: what kind each is, and its chain."""
    zeroed = [("zeroed in the grasp", draw(seed, field=False)) for seed in SURROGATES]
    open_ = [("zeroed while open", draw(seed)) for seed in SURROGATES]
    units = [("magnetic pad", unit(f"unit:{number}", layout)) for number in UNITS]
    turns = []
    for index, number in enumerate(UNITS):
        turns += [zeroed[2 * index], open_[2 * index], zeroed[number + index], open_[number + index], units[index]]
    return turns
