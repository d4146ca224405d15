"""Kinds: the kinds of pictures that can show a cause, selected by `Cause.picture`."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from paxisim.diagnose.report.background import covariate, zero, zero_in_time
from paxisim.diagnose.report.channels import channel_curves
from paxisim.diagnose.report.counts import steps
from paxisim.diagnose.report.curves import curves, gains, small_forces
from paxisim.diagnose.report.effect import Effect
from paxisim.diagnose.report.inside import closing, height_map, mount, slip
from paxisim.diagnose.report.kernel import kernel
from paxisim.diagnose.report.loops import loops
from paxisim.diagnose.report.mixing import axes_mixed
from paxisim.diagnose.report.plain import plain
from paxisim.diagnose.report.style import Picture
from paxisim.diagnose.report.taxels import mapping, silent_map, taxel_map
from paxisim.diagnose.report.timing import edges, holds, shift

PICTURES: Mapping[str, Callable[[Effect], list[Picture]]] = {
    "axes": axes_mixed,
    "closing": closing,
    "channel_curves": channel_curves,
    "covariate": covariate,
    "curves": curves,
    "edges": edges,
    "gains": gains,
    "height_map": height_map,
    "holds": holds,
    "kernel": kernel,
    "loops": loops,
    "mapping": mapping,
    "mount": mount,
    "plain": plain,
    "shift": shift,
    "silent_map": silent_map,
    "slip": slip,
    "small_forces": small_forces,
    "steps": steps,
    "taxel_map": taxel_map,
    "zero": zero,
    "zero_in_time": zero_in_time,
}
"""The function that draws the pictures of an effect, by kind."""


def evidence(effect: Effect) -> list[Picture]:
    """Return the pictures of a cause, of the kind that it declares; plain ones if it is no longer registered."""
    return PICTURES[effect.about.picture if effect.about else "plain"](effect)
