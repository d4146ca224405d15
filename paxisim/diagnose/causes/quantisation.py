"""Quantisation: readings are rounded to a step that is coarser than the device's own; read off the readings."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.cause import Cause, Reading
from paxisim.diagnose.causes.read_only import not_made
from paxisim.diagnose.problem import Problem

DEVICE_STEP = 0.1  # N a count, of a PaXini sensor that is in order
COARSER = 1.2  # times that step, from which on rounding is a cause


def _read(problem: Problem) -> Reading | None:
    if problem.step < COARSER * DEVICE_STEP:
        return None
    return Reading(augment.Quantisation((problem.step,) * 3), {"step": problem.step}, problem, rounds=True)


QUANTISATION = Cause("quantisation", 90, not_made("quantisation"), "light", read=_read)
