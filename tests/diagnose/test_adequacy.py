"""Adequacy: structure is seen, noise and tolerances are not."""

import sys
from pathlib import Path

import numpy as np
import pytest

from paxisim.diagnose.adequacy import left_over
from paxisim.diagnose.engine import Tolerance
from paxisim.diagnose.problem import problem_of
from paxisim.recording import Recording

sys.path.insert(0, str(Path(__file__).parents[1]))
from hidden.cases import make


def problem(causes=(), seed=1, **options):
    case = make(causes, seed=seed, **options)
    recording = Recording(case.time, case.measured, case.simulated, case.covariates, case.episode)
    return problem_of(recording, Tolerance())


def said(given):
    return [item.what for item in left_over(given, given.simulated)]


@pytest.mark.parametrize(
    "options", [{}, {"coarse": True}, {"rho": 0.95}, {"strong_noise": True}, {"family": "final"}], ids=str
)
def test_noise_and_tolerances_have_no_structure(options):
    assert said(problem(seed=12, rows=4, cols=3, **options)) == []


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("hum", "together"),
        ("bursts", "bursts"),
        ("row_scan", "the rate"),
        ("swapped_neighbours", "neighbour"),
        ("loose_wire", "under load"),
        ("gain_control", "total force"),
        ("rate_gain", "speed"),
        ("shear_softening", "shear"),
        ("mullins", "largest force"),
    ],
)
def test_what_no_cause_describes_is_seen(name, words):
    what = said(problem((name,), seed=5, strength=0.9))
    assert any(words in text for text in what), what


def test_a_line_is_seen_where_taxels_have_phases_of_their_own():
    given = problem(seed=2, rows=4, cols=3)
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, given.alive.shape)
    hum = 0.5 * np.sin(2 * np.pi * 3.1 * given.time[:, None, None, None, None] + phase)
    given.measured[:] += hum
    assert any("a line at 3." in text for text in said(given))


def test_repeated_frames_are_seen():
    given = problem(seed=2, rows=4, cols=3)
    for span in given.episodes:
        held = given.measured[span]
        held[1::2] = held[: len(held) - len(held) % 2 : 2][: len(held[1::2])]
    assert any("repeated" in text for text in said(given))
