"""Advice can be followed: each sentence stands for a motion, which the generator of test recordings can make."""

import itertools
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.practice.advised import ADVISED
from hidden.practice.cases import make
from recorded import recording_of

from paxisim.diagnose.advice import EXCITES, MOTIONS, TELL_APART, advice, motions_of
from paxisim.diagnose.cause import known_causes
from paxisim.diagnose.run import diagnose


def test_every_motion_can_be_made():
    assert set(MOTIONS) == set(ADVISED)
    assert {*EXCITES.values(), *TELL_APART.values()} <= set(MOTIONS)


def test_every_cause_has_a_motion_that_excites_it():
    assert set(EXCITES) == set(known_causes())


@pytest.mark.parametrize("pair", list(itertools.combinations(sorted(EXCITES), 2)), ids="-".join)
def test_rivals_are_told_apart_by_a_motion(pair):
    lines = advice([(pair[0], (pair[1],))], {}, unexplained=False, episodes=8)
    motions = motions_of(lines)
    known = [motion for names, motion in TELL_APART.items() if set(pair) <= names]
    assert set(motions) == set(known[:1] or [EXCITES[name] for name in pair])


def test_motions_come_in_the_order_of_the_advice():
    lines = advice(
        [("latency", ("low_pass",))], {"interference": "no covariate", "creep": "not asked for"},
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
