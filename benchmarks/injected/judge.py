"""Judge: criteria of success, fixed before the engine was run on any effect (`Outcome.warned`: after seed 1)."""

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

HALF = 0.5  # share of the injected change that the model must reproduce for the place to be right
LAG = r"lags simulated by (-?[\d.]+) s"
SHIFT = 0.15  # s, tolerance of the reported clock shift

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
"""Causes of each kind."""
CAUSES: Mapping[str, str] = {
    "dead_taxel": "dead_taxels",
    "dies_halfway": "dead_taxels",
    "swapped_taxels": "layout",
    "reversed_columns": "layout",
    "axis_sign": "layout",
}
"""Cause of each kind of effect whose cause has another name."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case.

    Attributes:
        name: Name of the case, as in `Case`.
        group: Group of the case.
        kind: Kind of the case.
        words: Description of the case.
        signal: Signal of the case.
        shift: Clock shift of the case (s).
        verdict: Verdict of the diagnosis; ``refused`` or ``crashed`` if there is none.
        named: Named causes.
        rivals: Rivals of each named cause.
        confidence: Confidence of each named cause.
        explained: Explained share of the explainable error on held-out data, by the diagnosis' own noise floor.
        match: Share of the injected change that the model reproduces in the simulation; 1 if it is reproduced exactly.
        said: Warnings and left-over structure; the message if the recording was refused.
        seconds: Duration of the diagnosis.
        memory: Peak memory of the process (GB).
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
        """The named causes; a separate cause for swapped taxels counts as ``layout``."""
        return frozenset("layout" if "swap" in name else name for name in self.named)

    @property
    def exact(self) -> bool:
        """Whether exactly the injected causes were named."""
        return self.verdict not in ("refused", "crashed", "unrelated") and self.causes == set(self.true)

    @property
    def kind_and_place(self) -> bool:
        """Whether all named causes are of the right kind, and the model reproduces over half of the injected change."""
        right = {kind_of(name) for name in self.causes} == {kind_of(name) for name in self.true}
        return right and self.match is not None and self.match > HALF

    @property
    def false_and_explained(self) -> bool:
        """Whether the verdict is ``explained`` but a named cause is of another kind."""
        kinds = {kind_of(name) for name in self.true}
        return self.verdict == "explained" and any(kind_of(name) not in kinds for name in self.causes)

    @property
    def told(self) -> bool:
        """Whether streams that do not correspond are recognised as such; see `injected.broken`."""
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
        """Whether the problem is reported, whatever else is named."""
        said = " ".join(self.said).lower()
        if self.kind.startswith("shifted"):
            found = re.search(LAG, said)
            return found is not None and abs(float(found[1]) - self.shift) <= SHIFT
        words = "newtons" if "newtons" in self.kind or "microtesla" in self.kind else "same motion"
        return self.told or words in said

    @property
    def right(self) -> bool:
        """Whether the outcome meets the criterion of its group."""
        return {"injected": self.exact, "null": self.exact, "broken": self.told}[self.group]


def kind_of(cause: str) -> str:
    """Return the kind of a cause; its own name if it belongs to none."""
    return next((kind for kind, causes in CLASSES.items() if cause in causes), cause)


def write(case: Case, folder: Path) -> Path:
    """Write a case to files that any version of the engine can read, and return the path of its description."""
    path = folder / (case.name.replace(":", "-") + ".json")
    case.recording.save(path.with_suffix(".npz"))
    if case.ideal is not None:
        np.save(path.with_suffix(".npy"), case.ideal.astype(np.float32))
    about = {key: getattr(case, key) for key in ("name", "group", "kind", "words", "signal", "shift")}
    path.write_text(json.dumps(about))
    return path


def solve(path: Path) -> Outcome:
    """Diagnose a case written by `write`; a crash counts as an outcome."""
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
    """Return the share of the effect's change of the simulation that the model reproduces."""
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
    """Return an outcome as a line of JSON."""
    return json.dumps({"engine": engine, **asdict(outcome)}) + "\n"


def from_line(line: str, engine: str) -> Outcome:
    """Read an outcome from a line written by `as_line`.

    Raises:
        SystemExit: The outcome is from another version of the engine.
    """
    row = json.loads(line)
    if row.pop("engine") != engine:
        raise SystemExit("the file holds outcomes of another version of the engine: pass a different file to --json")
    for key in ("named", "said"):
        row[key] = tuple(row[key])
    return Outcome(**{**row, "rivals": {name: tuple(others) for name, others in row["rivals"].items()}})
