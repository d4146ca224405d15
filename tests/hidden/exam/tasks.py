"""The questions of the exam, in a fixed order."""

from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from hidden.exam.effects import EFFECTS
from hidden.exam.outsiders import OUTSIDERS

UNFAIR = (
    {"stiffening", "saturation"},  # two nonlinear curves
    {"axis_coupling", "rotation"},  # two matrices that mix axes
    {"dead_band", "quantisation"},  # the coarse step hides the band
)
"""Pairs of causes with nearly the same effect."""

NULLS = ({}, {"rho": 0.95}, {"coarse": True})


@dataclass(frozen=True)
class Task:
    """One question: `make(task.causes, seed=task.seed, **task.options)`."""

    kind: str
    number: int
    causes: tuple
    seed: int
    options: dict = field(default_factory=dict, hash=False)


def tasks(singles, pairs, nulls, outsiders, seed):
    """Return the given number of questions of each kind; the same arguments give the same questions.

    Seeds differ between questions, and a question's seed does not depend on the number of other questions.
    """
    fair = [pair for pair in combinations(EFFECTS, 2) if set(pair) not in UNFAIR]
    rng = np.random.default_rng([seed, 0])
    chosen = [fair[i] for _ in range(-(-pairs // len(fair))) for i in rng.permutation(len(fair))][:pairs]
    causes = {
        "single": [(list(EFFECTS)[i % len(EFFECTS)],) for i in range(singles)],
        "pair": chosen,
        "null": [()] * nulls,
        "outsider": [(list(OUTSIDERS)[i % len(OUTSIDERS)],) for i in range(outsiders)],
    }
    out = []
    for place, (kind, each) in enumerate(causes.items(), start=1):
        for number, names in enumerate(each):
            own = int(np.random.SeedSequence([seed, place, number]).generate_state(1)[0])
            options = dict(NULLS[number % len(NULLS)]) if kind == "null" else {}
            out.append(Task(kind, number, tuple(names), own, options))
    return out
