"""Faults: short descriptions of causes without numeric parameters: layout faults, swapped taxels and dead taxels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from paxisim.augment.chain import Chain
from paxisim.augment.dead_taxels import DeadTaxels
from paxisim.augment.failing_taxels import FailingTaxels
from paxisim.augment.layout_faults import LayoutFault
from paxisim.augment.swapped_taxels import SwappedTaxels
from paxisim.diagnose.result import pad_in_words

if TYPE_CHECKING:
    from paxisim.diagnose.result import Result

MAX_LISTED = 8  # taxels or pairs listed per pad
_AXES = "xyz"


def fault_in_words(diagnosis: Result, name: str) -> str:
    """Describe a layout fault, swapped taxels or dead taxels; empty for other causes.

    Args:
        diagnosis: Result with the model and the names of the pads.
        name: Name of the cause.
    """
    if name not in diagnosis.model.names:
        return ""
    member = diagnosis.model[name]
    if isinstance(member, Chain) and len(member) == 1:  # a transform placed later than its stage is wrapped in a chain
        member = member[0]
    pads = [place.where for place in diagnosis.symptoms.pads]
    if isinstance(member, LayoutFault):
        return "; ".join(_layout(member, pads))
    if isinstance(member, SwappedTaxels):
        return "; ".join(_swapped(member, pads))
    if isinstance(member, DeadTaxels):
        return "; ".join(_taxels(member, pads))
    return ""


def _layout(fault: LayoutFault, pads: Sequence[str]) -> list[str]:
    words = ["rows and columns swapped"] if fault.transpose else []
    flipped = [name for name, flip in (("rows", fault.flip_rows), ("columns", fault.flip_cols)) if flip]
    words += [f"{' and '.join(flipped)} reversed"] if flipped else []
    words += _moved(fault.axis_order, _AXES)
    signs = [_AXES[axis] for axis, sign in enumerate(fault.axis_signs) if sign < 0]
    words += [f"sign of {' and '.join(signs)} reversed"] if signs else []
    order = fault.pad_order or ()
    return words + _moved(order, [_pad(pads, number) for number in range(len(order))])


def _moved(order: Sequence[int], names: Sequence[str]) -> list[str]:
    moved = [(names[came], names[place]) for place, came in enumerate(order) if came != place]
    if len(moved) == 2:
        return [f"{moved[1][0]} and {moved[0][0]} swapped"]
    return [", ".join(f"{came} read as {place}" for came, place in moved)] if moved else []


def _swapped(fault: SwappedTaxels, pads: Sequence[str]) -> list[str]:
    words = []
    for pad in sorted({pair[0] for pair in fault.pairs}):
        own = [f"({r}, {c}) and ({s}, {d})" for p, r, c, s, d in fault.pairs if p == pad]
        words.append(f"{_pad(pads, pad)} {_listed(own)} swapped")
    return words


def _taxels(fault: DeadTaxels, pads: Sequence[str]) -> list[str]:
    words = []
    for which, what in ((fault.dead, "no response"), (fault.stuck, "stuck")):
        places = np.argwhere(np.asarray(which) > 0)
        named = []
        for pad in np.unique(places[:, 0]):
            own = [f"({row}, {col}){_since(fault, (p, row, col))}" for p, row, col in places if p == pad]
            named.append(f"{_pad(pads, int(pad))} {_listed(own)}")
        words += [f"{what}: {', '.join(named)}"] if named else []
    return words


def _since(fault: DeadTaxels, taxel: tuple[int, int, int]) -> str:
    """Say which axes of a taxel have failed and since when; empty for all axes from the start."""
    if not isinstance(fault, FailingTaxels):
        return ""
    pad, row, col = taxel
    grid = np.broadcast_shapes(np.shape(fault.dead), np.shape(fault.stuck))
    since = np.broadcast_to(np.asarray(fault.since, dtype=float), (grid[0], 3, *grid[1:]))[pad, :, row, col]
    words = ""
    for moment in np.unique(since[np.isfinite(since)]):
        axes = [axis for axis, own in zip(_AXES, since, strict=True) if own == moment]
        words += f" {' and '.join(axes)}" if len(axes) < len(_AXES) else ""
        words += f" since {moment:.1f} s" if moment > 0 else ""
    return words


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MAX_LISTED} more" if len(names) > MAX_LISTED else ""
    return f"{', '.join(names[:MAX_LISTED])}{more}"


def _pad(pads: Sequence[str], number: int) -> str:
    return pad_in_words(pads[number] if number < len(pads) else str(number))
