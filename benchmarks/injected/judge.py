"""Judge: what counts as right, written down before the engine was run on any effect (`Outcome.warned` after seed 1)."""

from __future__ import annotations

import json
import re
import resource
import time
import traceback
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from hidden_table.patience import patience

import paxisim
from injected.cases import Case
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

HALF = 0.5  # of the injected change that the model must make, for its place to be right
LAG = r"lags simulated by (-?[\d.]+) s"
SHIFT = 0.15  # s, by which the shift of a clock may be off

CLASSES: Mapping[str, tuple[str, ...]] = {
    "gain": ("axis_gain", "taxel_gain"),
    "curve": ("stiffening", "saturation", "dead_band", "channel_curve"),
    "zero": ("offset", "drift"),
    "field": ("interference",),
    "memory": ("creep", "hysteresis"),
    "time": ("latency", "low_pass"),
    "axes": ("axis_coupling", "rotation"),
    "neighbours": ("crosstalk", "poisson"),
    "order": ("layout",),
    "dead": ("dead_taxels",),
    "rounding": ("quantisation",),
}
"""Causes that are of one kind."""
CAUSES: Mapping[str, str] = {
    "dead_taxel": "dead_taxels",
    "dies_halfway": "dead_taxels",
    "swapped_taxels": "layout",
    "reversed_columns": "layout",
    "axis_sign": "layout",
}
"""By kind of effect its cause, where that has another name."""


@dataclass(frozen=True)
class Outcome:
    """What came of a case.

    Attributes:
        name: Of the case. group: of it. kind: of it. words: of it. signal: of it. shift: of it.
        verdict: Of the diagnosis; ``refused`` or ``crashed`` if there is none.
        named: Causes. rivals: of each. confidence: of each.
        explained: Held-out share of the explainable error, by the diagnosis' own noise floor.
        match: Share of the injected change of the simulation that the model makes, 1 if it makes just that one.
        said: Warnings and what is left over; the message if it was refused.
        seconds: That it took.
    """

    name: str
    group: str
    kind: str
    words: str
    signal: float
    shift: float
    verdict: str
    named: tuple[str, ...]
    rivals: Mapping[str, tuple[str, ...]]
    confidence: Mapping[str, float]
    explained: float | None
    match: float | None
    said: tuple[str, ...]
    seconds: float
    memory: float

    @property
    def true(self) -> tuple[str, ...]:
        """The injected causes."""
        return (CAUSES.get(self.kind, self.kind),) if self.group == "injected" else ()

    @property
    def causes(self) -> frozenset[str]:
        """The named causes; a cause of its own for swapped taxels is one of layout."""
        return frozenset("layout" if "swap" in name else name for name in self.named)

    @property
    def exact(self) -> bool:
        """Whether what was injected was named, and nothing else."""
        return self.verdict not in ("refused", "crashed", "unrelated") and self.causes == set(self.true)

    @property
    def kind_and_place(self) -> bool:
        """Whether all names are of the right kind, and the model does half of what was injected to each channel."""
        right = {kind_of(name) for name in self.causes} == {kind_of(name) for name in self.true}
        return right and self.match is not None and self.match > HALF

    @property
    def false_and_explained(self) -> bool:
        """Whether it was said to be explained, by a name of another kind."""
        kinds = {kind_of(name) for name in self.true}
        return self.verdict == "explained" and any(kind_of(name) not in kinds for name in self.causes)

    @property
    def told(self) -> bool:
        """Whether streams that do not correspond are told for what they are; see `injected.broken`."""
        said = " ".join(self.said).lower()
        refused = self.verdict == "refused"
        if self.kind.startswith("shifted"):
            return self.warned and not self.named
        if "newtons" in self.kind:
            return refused and "newtons" in said
        if "microtesla" in self.kind:
            return refused and "paxisim calibrate" in said
        if self.kind == "swapped pads":
            return self.causes == {"layout"}
        if "frozen" in self.kind:
            still = re.search(r"constant|frozen|froze|stuck|never change|stopped|does not change|no signal", said)
            return refused or self.verdict == "unrelated" or (bool(still) and self.causes <= {"dead_taxels"})
        return refused or self.verdict == "unrelated"

    @property
    def warned(self) -> bool:
        """Whether the words are there, whatever is named beside them."""
        said = " ".join(self.said).lower()
        if self.kind.startswith("shifted"):
            found = re.search(LAG, said)
            return found is not None and abs(float(found[1]) - self.shift) <= SHIFT
        words = "newtons" if "newtons" in self.kind or "microtesla" in self.kind else "same motion"
        return self.told or words in said

    @property
    def right(self) -> bool:
        """Whether this is what is asked for."""
        return {"injected": self.exact, "null": self.exact, "broken": self.told}[self.group]


def kind_of(cause: str) -> str:
    """The class of a cause; its own name if it has none."""
    return next((kind for kind, causes in CLASSES.items() if cause in causes), cause)


def write(case: Case, folder: Path) -> Path:
    """A case as files, which any version of the engine can read; the path of its description."""
    path = folder / (case.name.replace(":", "-") + ".json")
    case.recording.save(path.with_suffix(".npz"))
    if case.ideal is not None:
        np.save(path.with_suffix(".npy"), case.ideal.astype(np.float32))
    about = {key: getattr(case, key) for key in ("name", "group", "kind", "words", "signal", "shift")}
    path.write_text(json.dumps(about))
    return path


def solve(path: Path) -> Outcome:
    """Diagnose a case that `write` wrote; a crash is an outcome, too."""
    about = json.loads(path.read_text())
    recording = Recording.load(path.with_suffix(".npz"))
    begin = time.perf_counter()
    try:
        with patience():
            found = paxisim.diagnose(recording)
    except InvalidValueError as error:
        return _without(about, "refused", f"{error}", time.perf_counter() - begin)
    except Exception:
        return _without(about, "crashed", traceback.format_exc(limit=-3), time.perf_counter() - begin)
    return Outcome(
        **about,
        verdict=found.verdict,
        named=tuple(cause.name for cause in found.causes),
        rivals={cause.name: cause.rivals for cause in found.causes},
        confidence=dict(found.confidence),
        explained=found.heldout.explained.value if found.heldout.explained else None,
        match=_match(recording, found.model, path.with_suffix(".npy")),
        said=(*found.symptoms.warnings, *(item.what for item in found.symptoms.left_over)),
        seconds=time.perf_counter() - begin,
        memory=_memory(),
    )


def _without(about: Mapping[str, object], verdict: str, said: str, seconds: float) -> Outcome:
    return Outcome(
        **about, verdict=verdict, named=(), rivals={}, confidence={}, explained=None, match=None, said=(said,),
        seconds=seconds, memory=_memory(),
    )  # type: ignore[arg-type]  # fmt: skip


def _match(recording: Recording, model: paxisim.augment.Chain, ideal: Path) -> float | None:
    """How much of what the effect does to the simulation the model does, too."""
    if not ideal.exists():
        return None
    x, wanted = np.asarray(recording.simulated, dtype=float), np.load(ideal).astype(float)
    change = float(np.sum((wanted - x) ** 2))
    if not change:
        return None
    made = model.run(x, recording.time, dict(recording.covariates))
    return 1 - float(np.sum((made - wanted) ** 2)) / change


def _memory() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6


def as_line(outcome: Outcome, engine: str) -> str:
    """An outcome as a line of JSON."""
    return json.dumps({"engine": engine, **asdict(outcome)}) + "\n"


def from_line(line: str, engine: str) -> Outcome:
    """What `as_line` gave.

    Raises:
        SystemExit: It is of another engine.
    """
    row = json.loads(line)
    if row.pop("engine") != engine:
        raise SystemExit("the file holds outcomes of another version of the engine: give another file to --json")
    for key in ("named", "said"):
        row[key] = tuple(row[key])
    return Outcome(**{**row, "rivals": {name: tuple(others) for name, others in row["rivals"].items()}})
