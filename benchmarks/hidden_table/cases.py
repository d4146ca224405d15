"""Cases: recordings of the generator of hidden effects (`tests/hidden`), and their outcomes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from harness import Outcome, diagnosed
from hidden.cases import Case, make
from hidden.compare import compare, headroom_share, named
from hidden.effects import EFFECTS
from hidden.outsiders import FURTHER, LEARNT, OUTSIDERS

import paxisim

KINDS = ("single", "pair", "null", "outsider")
HARD: dict[str, tuple[int, dict[str, Any]]] = {
    "triple": (3, {}),
    "uneven": (2, {"strength": (0.95, 0.25)}),
    "reversed": (2, {"reverse": True}),
    "one_pad": (1, {"only_pad": 0}),
    "onset": (1, {"since": 4}),
    "poor": (1, {"family": "poor"}),
}
"""Kinds that are no goals yet: number of effects, and options of the generator.

Three effects, a strong one with a weak one, effects in another order, on one pad only, from the middle of the recording
on, and motions that may not tell.
"""
FAMILIES = {"both": ("development", "final"), **{name: (name,) for name in ("development", "final", "broad")}}
SHAPES = ((6, 5), (4, 4), (1, 15))
"""Rows and columns in the family "broad"."""
NULLS = ({}, {"rho": 0.95}, {"coarse": True})


@dataclass(frozen=True)
class Task:
    """A case to make and diagnose.

    Attributes:
        kind: One of `KINDS` or `HARD`.
        number: Number of the case within its kind.
        true: The hidden effects.
        seed: Random seed of the recording.
        options: Further arguments of the generator, by name.
    """

    kind: str
    number: int
    true: tuple[str, ...]
    seed: int
    options: tuple[tuple[str, Any], ...] = ()

    @property
    def name(self) -> str:
        """Name of the case."""
        return f"{self.kind}:{self.number}"

    def made(self) -> Case:
        """Make the recording."""
        return make(self.true, seed=self.seed, ideal=True, **dict(self.options))


def tasks(counts: Mapping[str, int], seed: int, family: str = "both") -> list[Task]:
    """Return the requested number of cases of each kind; case number n of a kind is the same for any counts.

    Singles and outsiders cycle through the effects; pairs are drawn at random.
    """
    families, names = FAMILIES[family], list(EFFECTS)
    foreign = [name for name in (*OUTSIDERS, *(FURTHER if family == "broad" else ())) if name not in LEARNT]
    out = []
    for place, kind in enumerate((*KINDS, *HARD), 1):
        rng = np.random.default_rng([seed, place])
        for number in range(counts.get(kind, 0)):
            true: Sequence[str] = ()
            if kind == "single":
                true = (names[number % len(names)],)
            elif kind == "outsider":
                true = (foreign[number % len(foreign)],)
            elif kind == "pair":
                true = sorted(map(str, rng.choice(names, 2, replace=False)))
            elif kind in HARD:
                true = list(map(str, rng.choice(names, HARD[kind][0], replace=False)))
            # keeps the cycle over the causes out of step with the cycle over the families
            options: dict[str, Any] = {"family": families[(number + number // len(names)) % len(families)]}
            if family == "broad":
                options["rows"], options["cols"] = SHAPES[(number + number // len(names)) % len(SHAPES)]
            if kind in HARD:
                options |= HARD[kind][1]
            if kind == "null":
                options |= NULLS[number % len(NULLS)]
            own_seed = seed * 1_000_000 + place * 10_000 + number
            out.append(Task(kind, number, tuple(true), own_seed, tuple(sorted(options.items()))))
    return out


def recording(case: Case) -> paxisim.Recording:
    """Return the recording of a case, without what only the generator knows."""
    return paxisim.Recording(case.time, case.measured, case.simulated, case.covariates, case.episode)


def solve(task: Task) -> Outcome:
    """Make a case and diagnose it; a crash counts as a miss and does not stop the other cases."""
    case = task.made()
    outcome, found = diagnosed(task.name, task.kind, task.true, recording(case))
    outcome.about.update(signal=case.signal, weakest=min(case.signals.values(), default=case.signal))
    if found is not None:
        outcome.about["share"] = headroom_share(case, found.heldout.nrmse_before, found.heldout.nrmse_after)
        right = {name: cause for name, cause in named(found).items() if name in case.causes and case.ideal is not None}
        outcome.about["errors"] = {name: compare(name, case, found.model[c.name].run) for name, c in right.items()}
    return outcome
