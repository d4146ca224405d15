"""Fixed cases of test_hidden.py.

Case number i has the seed ``START + i``. Seeds, names and strengths were fixed before any case was diagnosed, and
missed cases stay in the suite: the tests require counts that a poor build hardly ever reaches.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from recorded import EFFECTS, LEARNT, OUTSIDERS, SMALL, diagnosed, make, names, recording_of
from scipy.stats import binom

START = 7_000_000
MORE = {"interference": ("gripper", "gripper", "gripper")}
"""Additional episodes by effect, where the family has only one that shows it."""
QUIET = ({}, {"rho": 0.95}, {"coarse": True}, {"family": "final"}, {"rho": 0.95, "family": "final"})
CHANCE = 0.01
"""Probability that a poor build reaches a bound."""


@dataclass(frozen=True)
class Hidden:
    """A case: the effects hidden in it and the options of its recording."""

    number: int
    names: tuple
    options: tuple = ()

    @cache  # noqa: B019
    def recorded(self):
        """Make the case; it is the same on every call."""
        rng = np.random.default_rng([START, self.number])
        options = {"strength": rng.uniform(0.5, 1.0), "family": ("development", "final")[rng.integers(2)]}
        more = sum((MORE.get(name, ()) for name in self.names), ())
        options = {**SMALL, **options, "more": more, **dict(self.options)}
        return make(self.names, seed=START + self.number, ideal=True, **options)

    @cache  # noqa: B019
    def diagnosis(self):
        """Diagnose the case."""
        return diagnosed(recording_of(self.recorded()))

    @property
    def named(self):
        """Named causes in alphabetical order."""
        return tuple(sorted(names(self.diagnosis())))

    @property
    def exact(self):
        """Whether exactly the hidden effects are named."""
        return self.named == tuple(sorted(self.names))

    def __str__(self):
        hidden, named = (" + ".join(names) or "nothing" for names in (self.names, self.named))
        return f"{self.number}: {hidden}, said {self.diagnosis().verdict}, {named}"


def _pairs(count):
    rng = np.random.default_rng(START)
    return [tuple(map(str, rng.choice(sorted(EFFECTS), 2, replace=False))) for _ in range(count)]


SINGLES = [Hidden(i, (name,)) for i, name in enumerate(sorted(EFFECTS))]
PAIRS = [Hidden(100 + i, names) for i, names in enumerate(_pairs(12))]
NULLS = [Hidden(200 + i, (), tuple({"family": "development", **QUIET[i % len(QUIET)]}.items())) for i in range(10)]
_OTHERS = [Hidden(300 + i, (name,)) for i, name in enumerate(sorted(OUTSIDERS) * 2)]
FOREIGN = [case for case in _OTHERS if case.names[0] not in LEARNT]
SINCE_LEARNT = [case for case in _OTHERS if case.names[0] in LEARNT]


def bound(count, rate):
    """Return the smallest count that a build with success rate `rate` reaches with a probability below `CHANCE`."""
    return int(binom.isf(CHANCE, count, rate)) + 1


def assert_right(cases, right, rate):
    """Assert that more cases are right than a build with success rate `rate` would reach."""
    missed = [case for case in cases if not right(case)]
    least = bound(len(cases), rate)
    said = "\n".join(map(str, missed))
    assert len(cases) - len(missed) >= least, (
        f"{len(missed)} of {len(cases)} missed, at most {len(cases) - least}:\n{said}"
    )
