"""Advice names the motions that excite a cause or separate rivals."""

import itertools
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.cases import make
from recorded import recording_of

from paxisim.diagnose.advice import MOTIONS, advice, motions_of
from paxisim.diagnose.causes import CAUSES
from paxisim.diagnose.run import diagnose

EXCITES = {item.name: item.excites for item in CAUSES}


def test_every_motion_that_excites_a_cause_has_a_sentence():
    assert set(EXCITES.values()) <= set(MOTIONS)


@pytest.mark.parametrize("pair", list(itertools.combinations(sorted(EXCITES), 2)), ids="-".join)
def test_rivals_are_separated_by_the_motions_that_excite_either(pair):
    lines = advice([(pair[0], (pair[1],))], {}, EXCITES, unexplained=False, episodes=8)
    assert set(motions_of(lines)) == {EXCITES[name] for name in pair}


def test_a_cause_that_is_not_known_asks_for_varied_motions():
    lines = advice([("creep", ("mine",))], {"mine": "it is not excited"}, EXCITES, unexplained=False, episodes=8)
    assert motions_of(lines) == ("holds", "varied")


def test_motions_come_in_the_order_of_the_advice():
    lines = advice(
        [("latency", ("low_pass",))], {"interference": "no covariate", "creep": "not asked for"}, EXCITES,
        unexplained=True, episodes=2,
    )  # fmt: skip
    assert motions_of(lines) == ("taps", "repeats", "varied", "gripper")
    assert motions_of(()) == ()


def test_a_sentence_stands_for_one_motion():
    assert all(motions_of((text,)) == (name,) for name, text in MOTIONS.items())


def test_no_neighbours_are_asked_for_of_a_pad_of_one_taxel():
    case = make((), seed=3, rows=1, cols=1, duration=5.0)
    found = diagnose(recording_of(case), ("crosstalk", "poisson", "axis_gain"))
    why = "a pad of a single taxel has no neighbours"
    assert {found.not_testable[name] for name in ("crosstalk", "poisson")} == {why}
    assert not any("fine tip" in line for line in found.advice)
