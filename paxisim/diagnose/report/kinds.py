"""Kinds: which pictures convince of which cause."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from paxisim.diagnose.report.background import field, zero
from paxisim.diagnose.report.counts import counts
from paxisim.diagnose.report.curves import curves, gain_curves
from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.loops import loops
from paxisim.diagnose.report.mixing import axes_mixed, neighbours
from paxisim.diagnose.report.plain import plain
from paxisim.diagnose.report.style import Picture
from paxisim.diagnose.report.taxels import dead, layout, taxel_gains
from paxisim.diagnose.report.timing import edges, holds

KINDS: Mapping[str, Callable[[Effect], list[Picture]]] = {
    "axis_coupling": axes_mixed,
    "axis_gain": gain_curves,
    "channel_curve": curves,
    "creep": holds,
    "crosstalk": neighbours,
    "dead_band": curves,
    "dead_taxels": dead,
    "drift": zero,
    "hysteresis": loops,
    "interference": field,
    "latency": edges,
    "layout": layout,
    "low_pass": edges,
    "offset": zero,
    "poisson": neighbours,
    "quantisation": counts,
    "rotation": axes_mixed,
    "saturation": curves,
    "stiffening": curves,
    "taxel_gain": taxel_gains,
}
"""By name of a cause; of any other `plain` is drawn."""

WORDS: Mapping[str, str] = {
    "axis_coupling": "A force on one axis is read on another as well.",
    "axis_gain": "Each axis reads too much or too little by a factor of its own.",
    "channel_curve": "Each channel answers to the load along a curve of its own.",
    "creep": "Under a steady load the reading goes on growing, and it comes back slowly.",
    "crosstalk": "A taxel also reads a part of what its neighbours feel.",
    "dead_band": "Small forces are not read.",
    "dead_taxels": "Some taxels do not answer.",
    "drift": "The zero wanders over minutes.",
    "hysteresis": "The reading depends on whether the force was rising or falling.",
    "interference": "A field from outside is read as a force, and it changes as the gripper moves.",
    "latency": "One of the two streams is late.",
    "layout": "Taxels, axes or pads are mixed up on the way.",
    "low_pass": "Quick changes are smoothed away.",
    "offset": "The reading is not zero where nothing presses.",
    "poisson": "A pressed gel bulges sideways, and drags its neighbours outwards.",
    "quantisation": "Readings are rounded to coarse steps.",
    "rotation": "The sensor's axes are turned against those of the simulation.",
    "saturation": "Large forces are cut off.",
    "stiffening": "The reading is not proportional to the force.",
    "taxel_gain": "Each taxel has a gain of its own.",
}
"""What each cause is, for who has not met its name."""


def evidence(effect: Effect) -> list[Picture]:
    """The pictures that convince of a cause."""
    return KINDS.get(effect.cause.name, plain)(effect)
