"""Adequacy: structure in the residual is detected, noise and tolerances are not."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

from paxisim.diagnose.adequacy import SHAPE, left_over
from paxisim.diagnose.explanation import predicted
from paxisim.diagnose.fitting import Fitter
from paxisim.diagnose.folds import folds_of
from paxisim.diagnose.problem import problem_of
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.shapes import MAX_FRAMES, MAX_GROUPS, shapes_of
from paxisim.diagnose.vocabulary import cause

sys.path.insert(0, str(Path(__file__).parents[1]))
from hidden.cases import make
from recorded import recording_of


def problem(causes=(), seed=1, **options):
    case = make(causes, seed=seed, **options)
    return problem_of(recording_of(case))


def fitted(given, name):
    """Return the prediction of a cause fitted to a recording."""
    folds = folds_of(given, [cause(name)], Rules())
    fit = Fitter(given, folds).fit([cause(name)])
    return predicted(given, fit.causes, fit.whole, fit.constant)


def said(given, prediction=None):
    return [item.what for item in left_over(given, given.simulated if prediction is None else prediction)]


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
        ("mullins", "largest earlier force"),
    ],
)
def test_what_no_cause_describes_is_seen(name, words):
    what = said(problem((name,), seed=5, strength=0.9))
    assert any(words in text for text in what), what


def test_a_taxel_that_reads_its_neighbour_is_named_by_its_pad():
    own = recording_of(make(("swapped_neighbours",), seed=5, strength=0.9))
    pads = tuple(f"pad{i + 2}" for i in range(len(own.pads)))
    what = said(problem_of(dataclasses.replace(own, pads=pads)))
    assert any(text.startswith(pads) and "neighbour" in text for text in what), what


def test_a_line_is_seen_where_taxels_have_phases_of_their_own():
    given = problem(seed=2, rows=4, cols=3)
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, given.alive.shape)
    hum = 0.5 * np.sin(2 * np.pi * 3.1 * given.time[:, None, None, None, None] + phase)
    given.measured[:] += hum
    assert any("a spectral line at 3." in text for text in said(given))


def test_repeated_frames_are_seen():
    given = problem(seed=2, rows=4, cols=3)
    for span in given.episodes:
        held = given.measured[span]
        held[1::2] = held[: len(held) - len(held) % 2 : 2][: len(held[1::2])]
    assert any("repeat" in text for text in said(given))


@pytest.mark.parametrize(
    ("name", "strength"), [("hysteresis", 0.8), ("creep", 0.8), ("low_pass", 0.6), ("saturation", 0.6)]
)
def test_a_true_cause_may_have_a_form_that_is_not_quite_the_sensors(name, strength):
    given = problem((name,), seed=6, rows=4, cols=3, strength=strength)
    assert said(given)
    assert said(given, fitted(given, name)) == []


@pytest.mark.parametrize("name", ["stiffening", "creep", "axis_gain"])
def test_gain_control_is_not_explained_away_by_a_neighbour(name):
    given = problem(("gain_control",), seed=5, rows=4, cols=3, strength=0.5)
    assert any("total force" in text for text in said(given, fitted(given, name)))


def test_shapes_do_not_see_what_channels_may_be_off_by():
    given = problem(seed=12, rows=4, cols=3)
    rng = np.random.default_rng(0)
    for span in given.episodes:
        given.measured[span] += rng.uniform(-0.1, 0.1, given.alive.shape)
    given.measured[:] += 0.05 * rng.standard_normal(given.alive.shape) * given.simulated
    given = dataclasses.replace(given, step=0.0, clips=False)
    shapes = shapes_of(given, given.simulated)
    assert shapes.gains().sum(axis=1).max() < SHAPE * shapes.samples


def test_a_shape_is_found_by_its_name_and_with_its_energy():
    given = problem(seed=12, rows=4, cols=3)
    total = given.simulated[:, :, 2:].sum(axis=(3, 4), keepdims=True)
    effect = 0.2 * given.simulated * total / total.max()
    given = dataclasses.replace(given, measured=given.simulated + effect, step=0.0, clips=False)
    shapes = shapes_of(given, given.simulated)
    gains = shapes.gains().sum(axis=1)
    assert shapes.names[int(gains.argmax())] == "the total force on the pad"
    assert gains.max() > 0.8 * shapes_of(given, given.measured).explained


def test_many_episodes_are_judged_in_groups():
    given = problem(seed=12, rows=4, cols=3)
    half = [slice(s.start + i * (s.stop - s.start) // 3, s.start + (i + 1) * (s.stop - s.start) // 3)
            for s in given.episodes for i in range(3)]  # fmt: skip
    shapes = shapes_of(dataclasses.replace(given, episodes=tuple(half)), given.simulated)
    assert len(half) == 24
    assert shapes.gains().shape == (len(shapes.names), MAX_GROUPS)
    assert np.isfinite(shapes.gains()).all()


def test_long_episodes_are_thinned_and_one_judges_itself():
    given = problem(("rate_gain",), seed=5, strength=0.9, rows=2, cols=2, pads=1, duration=60.0)
    assert len(given.time) > 2 * MAX_FRAMES
    given = dataclasses.replace(given, episodes=(slice(0, len(given.time)),))
    shapes = shapes_of(given, given.simulated)
    assert shapes.samples <= MAX_FRAMES * given.alive.sum()
    assert any("speed" in text for text in said(given))
