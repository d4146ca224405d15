"""Judge: criteria of success, fixed before the engine was run on any effect (`warned`: after seed 1)."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from harness import NAMELESS, Outcome, diagnosed

import paxisim
from injected.cases import Case

HALF = 0.5  # share of the injected change that the model must reproduce for the place to be right
LAG = r"lags simulated by (-?[\d.]+) s"
SHIFT = 0.15  # s, tolerance of the reported clock shift
STILL = r"constant|frozen|froze|stuck|never change|stopped|does not change|no signal"

CLASSES: Mapping[str, tuple[str, ...]] = {
    "gain": ("axis_gain", "taxel_gain"),
    "curve": ("stiffening", "saturation", "dead_band", "channel_curve"),
    "zero": ("offset", "drift"),
    "field": ("interference",),
    "memory": ("creep", "hysteresis"),
    "time": ("latency", "low_pass"),
    "axes": ("axis_coupling", "rotation"),
    "neighbours": ("crosstalk", "poisson", "shear along shear", "normal from shear"),
    "order": ("layout",),
    "dead": ("dead_taxels",),
    "rounding": ("quantisation",),
}
"""Causes of each kind."""
CAUSES = {"dies_halfway": "dead_taxels", "swapped_taxels": "layout"}
"""Cause of each kind of effect whose cause has another name."""


def solve(case: Case) -> Outcome:
    """Diagnose a case."""
    true = (CAUSES.get(case.kind, case.kind),) if case.group == "injected" else ()
    outcome, found = diagnosed(case.name, case.kind, true, case.recording)
    match = None if found is None or case.ideal is None else _match(case.recording, found.model, case.ideal)
    outcome.about.update(group=case.group, words=case.words, signal=case.signal, shift=case.shift, match=match)
    return outcome


def _match(recording: paxisim.Recording, model: paxisim.Chain, ideal: np.ndarray) -> float | None:
    """Return the share of the effect's change of the simulation that the model reproduces."""
    x = np.asarray(recording.simulated, dtype=float)
    change = float(np.sum((ideal - x) ** 2))
    made = model.run(x, recording.time, dict(recording.covariates))
    return 1 - float(np.sum((made - ideal) ** 2)) / change if change else None


def causes(o: Outcome) -> set[str]:
    """Return the named causes; swapped taxels count as ``layout``."""
    return {"layout" if "swap" in name else name for name in o.named}


def kinds_of(names: set[str]) -> set[str]:
    """Return the kinds of causes; its own name for one that belongs to none."""
    return {next((kind for kind, own in CLASSES.items() if name in own), name) for name in names}


def exact(o: Outcome) -> bool:
    """Whether exactly the injected causes were named."""
    return o.verdict not in NAMELESS and causes(o) == set(o.true)


def kind_and_place(o: Outcome) -> bool:
    """Whether all named causes are of the right kind, and the model reproduces over half of the injected change."""
    match = o.about["match"]
    return kinds_of(causes(o)) == kinds_of(set(o.true)) and match is not None and match > HALF


def false_and_explained(o: Outcome) -> bool:
    """Whether the verdict is ``explained`` but a named cause is of another kind."""
    return o.verdict == "explained" and not kinds_of(causes(o)) <= kinds_of(set(o.true))


def noticed(o: Outcome) -> bool:
    """Whether streams that do not correspond are recognised as such; see `injected.broken`."""
    said, refused = " ".join(o.said).lower(), o.verdict == "refused"
    if o.kind.startswith("shifted"):
        return warned(o) and not o.named
    if "newtons" in o.kind or "microtesla" in o.kind:
        return refused and ("newtons" if "newtons" in o.kind else "paxisim calibrate") in said
    if o.kind == "swapped pads":
        return causes(o) == {"layout"}
    if "frozen" in o.kind and re.search(STILL, said) and causes(o) <= {"dead_taxels"}:
        return True
    return refused or o.verdict == "unrelated"


def warned(o: Outcome) -> bool:
    """Whether the problem is reported, whatever else is named."""
    said = " ".join(o.said).lower()
    if o.kind.startswith("shifted"):
        found = re.search(LAG, said)
        return found is not None and abs(float(found[1]) - o.about["shift"]) <= SHIFT
    return noticed(o) or ("newtons" if "newtons" in o.kind or "microtesla" in o.kind else "same motion") in said


def right(o: Outcome) -> bool:
    """Whether the outcome meets the criterion of its group."""
    return noticed(o) if o.about["group"] == "broken" else exact(o)
