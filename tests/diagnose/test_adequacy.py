"""Adequacy: structure in the residual is detected, noise and tolerances are not."""

import dataclasses

import numpy as np
import pytest
from recorded import diagnosed, make, recording_of, small

from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.explain.adequacy import left_over
from paxisim.diagnose.explain.shapes import MAX_FRAMES, MAX_GROUPS, shapes_of
from paxisim.diagnose.rules import STRUCTURE


def problem(causes=(), seed=1, **options):
    return problem_of(recording_of(make(causes, seed=seed, **options)))


def said(given):
    return [item.what for item in left_over(given, given.simulated)]


@pytest.fixture(scope="module")
def quiet():
    return problem(seed=12, rows=4, cols=3)


@pytest.mark.parametrize("options", [{"coarse": True}, {"rho": 0.95}, {"strong_noise": True}, {"family": "final"}])
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
    given = dataclasses.replace(recording_of(make((name,), seed=5, strength=0.9)), pads=("left", "right"))
    what = said(problem_of(given))
    assert any(words in text for text in what), what
    if name == "swapped_neighbours":
        assert any(text.startswith(("left", "right")) and words in text for text in what), what


def test_a_line_with_a_phase_for_each_taxel_and_repeated_frames_are_seen():
    given = problem(seed=2, rows=4, cols=3)
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, given.alive.shape)
    hum = 0.5 * np.sin(2 * np.pi * 3.1 * given.time[:, None, None, None, None] + phase)
    humming = dataclasses.replace(given, measured=given.measured + hum)
    assert any("a spectral line at 3." in text for text in said(humming))
    for span in given.episodes:
        held = given.measured[span]
        held[1::2] = held[: len(held) - len(held) % 2 : 2][: len(held[1::2])]
    assert any("repeat" in text for text in said(given))


@pytest.mark.parametrize(
    ("name", "strength"), [("creep", 0.8), pytest.param("saturation", 0.6, marks=pytest.mark.slow)]
)
def test_a_true_cause_may_have_a_form_that_is_not_quite_the_sensors(name, strength):
    given = small(name, seed=6, strength=strength)
    assert said(problem_of(given))
    assert not diagnosed(given, (name,)).symptoms.left_over


def test_shapes_do_not_see_what_channels_may_be_off_by(quiet):
    rng = np.random.default_rng(0)
    measured = quiet.measured + 0.05 * rng.standard_normal(quiet.alive.shape) * quiet.simulated
    for span in quiet.episodes:
        measured[span] += rng.uniform(-0.1, 0.1, quiet.alive.shape)
    given = dataclasses.replace(quiet, measured=measured, noise=dataclasses.replace(quiet.noise, step=0.0, clips=False))
    shapes = shapes_of(given, given.simulated)
    assert shapes.gains().sum(axis=1).max() < STRUCTURE.shape * shapes.samples


def test_a_shape_is_found_by_its_name_and_with_its_energy_in_groups_of_episodes(quiet):
    total = quiet.simulated[:, :, 2:].sum(axis=(3, 4), keepdims=True)
    effect = 0.2 * quiet.simulated * total / total.max()
    spans = [np.array_split(np.arange(span.start, span.stop), 3) for span in quiet.episodes]
    parts = tuple(slice(own[0], own[-1] + 1) for thirds in spans for own in thirds)
    given = dataclasses.replace(
        quiet,
        measured=quiet.simulated + effect,
        noise=dataclasses.replace(quiet.noise, step=0.0, clips=False),
        episodes=parts,
    )
    shapes = shapes_of(given, given.simulated)
    gains = shapes.gains()
    assert gains.shape == (len(shapes.names), MAX_GROUPS)
    assert shapes.names[int(gains.sum(axis=1).argmax())] == "the total force on the pad"
    assert gains.sum(axis=1).max() > 0.8 * shapes_of(given, given.measured).explained


def test_long_episodes_are_thinned_and_one_judges_itself():
    given = problem(("rate_gain",), seed=5, strength=0.9, rows=2, cols=2, pads=1, duration=60.0)
    assert len(given.time) > 2 * MAX_FRAMES
    given = dataclasses.replace(given, episodes=(slice(0, len(given.time)),))
    shapes = shapes_of(given, given.simulated)
    assert shapes.samples <= MAX_FRAMES * given.alive.sum()
    assert any("speed" in text for text in said(given))
