"""The paper's methods: what the policy sees of the pads, and what is randomised while it learns."""

from __future__ import annotations

from dataclasses import dataclass

import paxisim
from paxisim import augment

from .tasks import Task

LARGEST_OFFSET = 0.5
"""Newtons: 5 counts of a PaXini pad, the most that is taken for the field of the fingers over a gripper's travel."""


@dataclass(frozen=True)
class Method:
    """One column of the paper's comparison, or of its ablation.

    Attributes:
        name: The paper's name.
        encoding: paxisim's name of the encoding.
        gcs: What is drawn for each episode, None for the simulator's readings as they are on flat pads.
        k: Frames of history; None for the encoding's own, which are the paper's.
    """

    name: str
    encoding: str
    gcs: paxisim.GCS | None = None
    k: int | None = None

    def history(self, task: Task, layout: paxisim.TaxelLayout) -> paxisim.History:
        """The history that a policy of this method sees on a task, with the paper's k for both."""
        k = self.k
        if k is None and self.encoding == "GCS" and task.name == "SY-2mm":
            k = 10  # appendix: works better there than 20
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
"""The paper's methods and its ablations by name; CoP, which others have found to do well; GCS with offsets."""


def find_method(name: str) -> Method:
    """The method of that name.

    Raises:
        UnknownNameError: There is no such method.
    """
    if name not in METHODS:
        raise paxisim.UnknownNameError("method", name, METHODS)
    return METHODS[name]
