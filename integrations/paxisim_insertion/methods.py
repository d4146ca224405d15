"""The paper's methods: tactile encodings and randomisation during training."""

from __future__ import annotations

from dataclasses import dataclass

import paxisim
from paxisim import augment

from .tasks import Task

LARGEST_OFFSET = 0.5
"""Largest offset (N): 5 counts of a PaXini pad, an upper bound for the field of the fingers over a gripper's travel."""

NOTHING_DRAWN = paxisim.GCS(geometry=False, convolution=False, scaling=False)
"""Flat pads and unmodified readings, for a method that does not randomise."""


@dataclass(frozen=True)
class Method:
    """One method of the paper's comparison or of its ablation.

    Attributes:
        name: Name of the method in the paper.
        encoding: Name of the encoding in paxisim.
        gcs: Randomisation drawn for each episode; None for unmodified readings of flat pads.
        k: Number of frames in the history; None for the encoding's default, which is the paper's.
    """

    name: str
    encoding: str
    gcs: paxisim.GCS | None = None
    k: int | None = None

    def history(self, task: Task, layout: paxisim.TaxelLayout) -> paxisim.History:
        """Return the history that a policy of this method sees on a task, with the paper's k for both."""
        k = self.k
        if k is None and self.encoding == "GCS" and task.name == "SY-2mm":
            k = 10  # appendix: better than 20 on this task
        return paxisim.History(paxisim.encoding(self.encoding, layout), k)


METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method("NT", "NT"),
        Method("TF", "TF"),
        Method("TB", "TB"),
        Method("TD", "TD"),
        Method("DT", "DT"),
        Method("GCS", "GCS", paxisim.GCS()),
        Method("GCS w/o G", "GCS", paxisim.GCS(geometry=False)),
        Method("GCS w/o S", "GCS", paxisim.GCS(scaling=False)),
        Method("GCS w/o C", "GCS", paxisim.GCS(convolution=False)),
        Method("CoP", "CoP", k=10),
        Method("GCS+O", "GCS", paxisim.GCS(augment.Ranges(offset=LARGEST_OFFSET))),
    )
}
"""By name: the paper's methods and ablations, CoP, which others found to work well, and GCS with offsets."""


def find_method(name: str) -> Method:
    """Return a method by name.

    Raises:
        UnknownNameError: There is no such method.
    """
    if name not in METHODS:
        raise paxisim.UnknownNameError("method", name, METHODS)
    return METHODS[name]
