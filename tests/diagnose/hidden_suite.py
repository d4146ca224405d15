"""The fixed cases of test_hidden_singles.py, test_hidden_pairs_and_nulls.py and test_hidden_outsiders.py.

Case number i has the seed ``START + i``. Seeds, names and strengths were written down before any of them was diagnosed,
and a case that is missed stays: the tests ask for counts that a poor build hardly ever reaches.
"""

import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

import paxisim

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.practice.cases import make
from hidden.practice.effects import EFFECTS
from hidden.practice.outsiders import LEARNT, OUTSIDERS
from recorded import recording_of

START = 7_000_000
SMALL = {"rows": 4, "cols": 3, "duration": 6.0, "rate": 20}
MORE = {"interference": ("gripper", "gripper", "gripper")}
"""Episodes besides those of the family, which has but one that shows the effect."""
QUIET = ({}, {"rho": 0.95}, {"coarse": True}, {"family": "final"}, {"rho": 0.95, "family": "final"})
CHANCE = 0.01
"""With which a poor build reaches a bound."""


@dataclass(frozen=True)
class Hidden:
    """A case: what is hidden in it, and how it is recorded."""

    number: int
    names: tuple
    options: tuple = ()

    @cache  # noqa: B019
    def recorded(self):
        """The case, the same each time."""
        rng = np.random.default_rng([START, self.number])
        options = {"strength": rng.uniform(0.5, 1.0), "family": ("development", "final")[rng.integers(2)]}
        more = sum((MORE.get(name, ()) for name in self.names), ())
        options = {**SMALL, **options, "more": more, **dict(self.options)}
        return make(self.names, seed=START + self.number, ideal=True, **options)

    @cache  # noqa: B019
    def diagnosis(self):
        """What is said of it without scikit-learn: the black box, which takes most time, names nothing."""
        with pytest.MonkeyPatch.context() as patch:
            for name in ("sklearn", "sklearn.ensemble"):
                patch.setitem(sys.modules, name, None)
            return paxisim.diagnose(recording_of(self.recorded()))

    @property
    def named(self):
        """The causes that are named, in the order of the alphabet."""
        return tuple(sorted(cause.name for cause in self.diagnosis().causes))

    @property
    def exact(self):
        """Whether what is hidden is named, and nothing else."""
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
    """The least of `count` cases that a build which is right at `rate` reaches with less than `CHANCE`."""
    return int(binom.isf(CHANCE, count, rate)) + 1


def assert_right(cases, right, rate):
    """That more of the cases are right than a build at `rate` would reach."""
    missed = [case for case in cases if not right(case)]
    least = bound(len(cases), rate)
    said = "\n".join(map(str, missed))
    assert len(cases) - len(missed) >= least, (
        f"{len(missed)} of {len(cases)} missed, at most {len(cases) - least}:\n{said}"
    )
