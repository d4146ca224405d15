"""Unrelated: messages about streams that are not of the same motion, or whose clocks are far apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from paxisim.diagnose.correspondence import MIN_CORRELATION, Correspondence
from paxisim.diagnose.diagnosis import Diagnosis, HeldOut, LeftOver, Symptoms
from paxisim.recording import Recording

CLOCKS = (
    "the clocks of the two streams differ: measured lags simulated by {:.2f} s. The streams were aligned first, so a "
    "delay of the sensor itself cannot be determined; check the clocks"
)
CHECKS = (
    "check that both streams were recorded during the same motion, that their clocks agree, that both are in newtons, "
    "and that pads and episodes are in the same order"
)


def unrelated(recording: Recording, warnings: Sequence[str], match: Correspondence) -> Diagnosis:
    """Return the diagnosis of streams that are not of the same motion, in which nothing is fitted.

    Args:
        recording: Recording with both streams.
        warnings: Other warnings about the recording.
        match: How well the streams correspond.
    """
    assert recording.measured is not None
    assert recording.simulated is not None
    measured = recording.measured.astype(np.float64)
    error = float(np.sqrt(np.sum((measured - recording.simulated) ** 2) / max(float(np.sum(measured**2)), 1e-300)))
    return Diagnosis(
        verdict="unrelated",
        causes=(),
        heldout=HeldOut(error, error, 0.0, "", None, ()),
        confidence={},
        not_testable={},
        symptoms=Symptoms(tuple(warnings), (LeftOver(match.why, match.alike, MIN_CORRELATION),)),
        advice=(CHECKS,),
    )
