"""Tasks: the cases to make, and their outcomes."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

GENERATORS = ("practice", "exam")
KINDS = {"single": 1, "pair": 2, "null": 3, "outsider": 4, "triple": 5, "poor": 6}
IN_EXAM = ("single", "pair", "null", "outsider")
NULLS = ({}, {"rho": 0.95}, {"coarse": True})
BASELINES = ("BIC", "Wald")
STRONG = 0.1  # share of the noise energy; an effect above it must be named


@dataclass(frozen=True)
class Task:
    """A case to make and diagnose.

    Attributes:
        kind: One of `KINDS`.
        number: Number of the case within its kind.
        true: The hidden effects.
        seed: Random seed of the recording.
        options: Further arguments of the generator, by name.
        generator: One of `GENERATORS`.
    """

    kind: str
    number: int
    true: tuple[str, ...]
    seed: int
    options: tuple[tuple[str, Any], ...] = ()
    generator: str = "practice"

    @property
    def name(self) -> str:
        """Name of the case, as used by ``--case``."""
        return f"{self.kind}:{self.number}"


@dataclass(frozen=True)
class Answer:
    """The answer of a diagnosis.

    Attributes:
        verdict: The verdict, as in `paxisim.Diagnosis`.
        named: Named causes.
        rivals: Rivals of each named cause.
        explained: Held-out share of the headroom, given the diagnosis' own noise floor.
        ceiling: The same for the black box.
        not_testable: Causes that are not testable.
        left_over: Structure found in the residual.
        advice: What to record next.
        seconds: Duration of the diagnosis (s).
    """

    verdict: str
    named: tuple[str, ...]
    rivals: Mapping[str, tuple[str, ...]]
    explained: float | None
    ceiling: float | None
    not_testable: tuple[str, ...]
    left_over: tuple[str, ...]
    advice: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class Outcome:
    """The outcome of a case.

    Attributes:
        task: The case.
        signal: Energy of the effect relative to the noise energy.
        weakest: The same for the weakest of several hidden effects, by what it changes in addition to the others.
        answer: Answer of the diagnosis; None if it crashed.
        share: Held-out share of the headroom above the residual that the hidden effect itself leaves if applied to the
            same simulation.
        nested: The same on two episodes that the diagnosis never saw; None if not evaluated.
        compared: For each cause that was hidden and named: error, number of intervals that contain the true value,
            number of intervals.
        baselines: Causes that each baseline named.
        baseline_shares: Held-out share of the headroom of each baseline.
        motions: Motions recorded next, for poor motions.
        after: Answer of the diagnosis after these motions.
        memory: Peak memory of the process so far (GB).
        error: Traceback of a crash.
    """

    task: Task
    signal: float
    weakest: float
    answer: Answer | None
    share: float | None = None
    nested: float | None = None
    compared: Mapping[str, tuple[float, int, int]] = field(default_factory=dict)
    baselines: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    baseline_shares: Mapping[str, float | None] = field(default_factory=dict)
    motions: tuple[str, ...] = ()
    after: Answer | None = None
    memory: float = 0.0
    error: str = ""

    @property
    def named(self) -> tuple[str, ...]:
        """The named causes; empty after a crash."""
        return self.answer.named if self.answer else ()

    @property
    def exact(self) -> bool:
        """Whether exactly the hidden effects were named."""
        return is_exact(self.task, self.answer)

    @property
    def contained(self) -> bool:
        """Whether all hidden effects were named, possibly among others."""
        return self.answer is not None and set(self.task.true) <= set(self.named)

    @property
    def flagged(self) -> bool:
        """Whether the verdict states that no cause explains part of the error."""
        return self.answer is not None and self.answer.verdict in ("partly_explained", "unexplained")

    def as_row(self) -> dict[str, Any]:
        """Return the outcome as a dictionary for JSON."""
        return asdict(self)


def is_exact(task: Task, answer: Answer | None) -> bool:
    """Whether exactly the hidden effects were named."""
    return answer is not None and set(answer.named) == set(task.true)


def by_rivals(task: Task, answer: Answer | None) -> bool:
    """Whether the named set is wrong, but right if causes are replaced by rivals named for them."""
    if answer is None or is_exact(task, answer) or len(answer.named) != len(task.true):
        return False
    choices = [(name, *answer.rivals[name]) for name in answer.named]
    return any(set(choice) == set(task.true) for choice in itertools.product(*choices))


def is_confidently_wrong(task: Task, answer: Answer | None) -> bool:
    """Whether the wrong causes were named with the verdict ``explained``."""
    return answer is not None and answer.verdict == "explained" and not is_exact(task, answer)


def read_outcome(row: Mapping[str, Any]) -> Outcome:
    """Return the outcome stored by `Outcome.as_row`."""

    def answer(of: Mapping[str, Any] | None) -> Answer | None:
        if of is None:
            return None
        lists = {key: tuple(of[key]) for key in ("named", "not_testable", "left_over", "advice")}
        rivals = {name: tuple(others) for name, others in of["rivals"].items()}
        return Answer(**{**of, **lists, "rivals": rivals})

    options = tuple((name, value) for name, value in row["task"]["options"])
    task = Task(**{**row["task"], "true": tuple(row["task"]["true"]), "options": options})
    return Outcome(
        **{
            **row,
            "task": task,
            "answer": answer(row["answer"]),
            "after": answer(row["after"]),
            "motions": tuple(row["motions"]),
            "compared": {name: tuple(values) for name, values in row["compared"].items()},
            "baselines": {name: tuple(values) for name, values in row["baselines"].items()},
        }
    )


def tasks(generator: str, counts: Mapping[str, int], seed: int, family: str = "both") -> list[Task]:
    """Return all requested cases."""
    return exam(counts, seed) if generator == "exam" else practice(counts, seed, family)


def exam(counts: Mapping[str, int], seed: int) -> list[Task]:
    """Return the cases of the exam, in its own order."""
    from hidden.exam import tasks as questions  # imported only if requested

    asked = questions.tasks(*(counts.get(kind, 0) for kind in IN_EXAM), seed)
    return [Task(t.kind, t.number, tuple(t.causes), t.seed, tuple(sorted(t.options.items())), "exam") for t in asked]


def practice(counts: Mapping[str, int], seed: int, family: str) -> list[Task]:
    """Return practice cases; case number n of a kind is the same for any counts.

    Singles, poor motions and outsiders cycle through the effects; pairs and triples are drawn at random.
    """
    from hidden.effects import EFFECTS
    from hidden.outsiders import LEARNT, OUTSIDERS

    families = ["development", "final"] if family == "both" else [family]
    names, foreign = list(EFFECTS), [name for name in OUTSIDERS if name not in LEARNT]
    out = []
    for kind, place in KINDS.items():
        rng = np.random.default_rng([seed, place])
        for number in range(counts.get(kind, 0)):
            if kind in ("single", "poor"):
                true: Sequence[str] = (names[number % len(names)],)
            elif kind == "outsider":
                true = (foreign[number % len(foreign)],)
            else:
                size = {"pair": 2, "triple": 3, "null": 0}[kind]
                true = sorted(map(str, rng.choice(names, size, replace=False)))
            # keeps the cycle over the causes out of step with the cycle over the families
            own = families[(number + number // len(names)) % len(families)] if kind != "poor" else "poor"
            options = {"family": own, **(NULLS[number % len(NULLS)] if kind == "null" else {})}
            own_seed = seed * 1_000_000 + place * 10_000 + number
            out.append(Task(kind, number, tuple(true), own_seed, tuple(sorted(options.items()))))
    return out


def version(generator: str) -> str:
    """Return a digest of the code that a result depends on; results of different versions must not be mixed."""
    root = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for folder in ("paxisim/diagnose", "paxisim/augment", f"tests/hidden/{generator}"):
        for path in sorted((root / folder).rglob("*.py")):
            if not path.name.startswith("test_"):
                digest.update(str(path.relative_to(root)).encode() + path.read_bytes())
    return digest.hexdigest()[:12]
