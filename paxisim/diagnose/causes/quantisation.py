"""Quantisation: readings are rounded to steps coarser than the device's own; read off the recording."""

from __future__ import annotations

from paxisim import augment
from paxisim.diagnose.causes.kinds import DetectedCause, Reading
from paxisim.diagnose.data.problem import Problem

COARSE = 0.12  # N per count; clearly coarser than the 0.1 N of a PaXini sensor


def _read(problem: Problem) -> Reading | None:
    step = problem.noise.step
    return Reading(augment.Quantisation((step,) * 3), {"step": step}, problem, rounds=True) if step >= COARSE else None


QUANTISATION = DetectedCause(
    name="quantisation",
    order=90,
    excites="light",
    read=_read,
    words="Readings are rounded to coarse steps.",
    picture="steps",
)
