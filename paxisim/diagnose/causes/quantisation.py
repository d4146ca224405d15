"""Quantisation: readings are rounded to steps coarser than the device's own; read off the recording."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.causes.kinds import DetectedCause, Reading
from paxisim.diagnose.data.problem import Problem

DEVICE_STEP = 0.1  # N per count of a PaXini sensor
COARSER = 1.2  # in units of that step; coarser rounding is a cause


def _read(problem: Problem) -> Reading | None:
    if problem.noise.step < COARSER * DEVICE_STEP:
        return None
    return Reading(augment.Quantisation((problem.noise.step,) * 3), {"step": problem.noise.step}, problem, rounds=True)


QUANTISATION = DetectedCause(
    name="quantisation",
    order=90,
    excites="light",
    read=_read,
    words="Readings are rounded to coarse steps.",
    picture="steps",
)
