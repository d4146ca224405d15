"""Held-out predictions come from fits that have not seen what they predict, also where one episode shows it all."""

from dataclasses import replace

import numpy as np
import pytest

from paxisim.augment import Chain
from paxisim.diagnose.diagnosis import Interval
from paxisim.diagnose.engine import Explanation, Named
from paxisim.diagnose.heldout import Squares, figures, gains_of, hold_out
from paxisim.diagnose.problem import Problem
from paxisim.diagnose.run import _evidence, _not_held

EPISODES, FRAMES = 6, 40
SHAPE = (EPISODES * FRAMES, 1, 3, 2, 2)


def explanation(gain, fits):
    """Of a cause that gains `gain` in each episode; each fit predicts its own number, and is kept in `fits`."""
    rng = np.random.default_rng(0)
    force = np.abs(rng.standard_normal(SHAPE))
    spans = tuple(slice(k * FRAMES, (k + 1) * FRAMES) for k in range(EPISODES))
    time = np.arange(len(force)) * 0.05
    alive = np.ones(SHAPE[1:], dtype=bool)
    problem = Problem(force, force, time, {}, spans, np.full(SHAPE, 0.1), 3.0, alive, 0.0, 0.0)

    def refit(part):
        fits.append(part.time)
        return np.full(SHAPE, float(len(fits)))

    named = Named("creep", Chain(), {}, np.asarray(gain, dtype=float), {})
    energy = np.ones(EPISODES)
    return Explanation(problem, (named,), Chain(), force, energy + gain, energy, refit=refit)


@pytest.mark.parametrize(("gain", "lone"), [([1, 1, 1, 1, 1, 1], ()), ([0, 0, 0, 9, 1, 0], (3,))])
def test_nothing_is_predicted_by_a_fit_that_has_seen_it(gain, lone):
    fits = []
    found = explanation(np.array(gain), fits)
    squares = hold_out(found, found.problem.simulated)
    assert squares.lone == lone
    by = squares.prediction[:, 0, 0, 0, 0].astype(int)  # number of the fit that predicted each frame
    for frame, number in enumerate(by):
        assert found.problem.time[frame] not in fits[number - 1]
    for number in lone:
        span = found.problem.episodes[number]
        first, second = by[span][0], by[span][-1]
        assert first != second
        assert found.problem.time[span][-1] in fits[first - 1], "the other half is in the fit"
        assert found.problem.time[span][0] in fits[second - 1]
        assert all(np.all(np.diff(times) > 0) for times in fits)
        assert (
            "Episode 4, which alone shows most, was held out one half after the other."
            in figures(squares, 0, None, "").note
        )


def test_an_episode_that_alone_shows_a_field_is_in_halves_too():
    found = explanation(np.array([1, 8, 1, 1, 1, 1]), [])
    field = replace(found.found[0], name="interference", energy_gain=np.array([0, 0, 0, 0.0, 9, 1]))
    both = replace(found, found=(*found.found, field))
    squares = hold_out(both, found.problem.simulated)
    assert squares.lone == (1, 4)
    note = figures(squares, 0, None, "").note
    assert "Episodes 2 and 5, which alone show most of a cause, were held out one half after the other." in note


@pytest.mark.parametrize(
    ("before", "after", "floor", "gain"),
    [
        (2.0, 1.2, 1.0, 0.8),  # of what is above the floor
        (2.0, 1.2, 1.5, 1.0),  # no more than all, where the floor counts what was explained
        (2.0, 1.2, 2.1, 0.4),  # of the whole, with nothing above the floor
        (2.0, 2.2, 1.9999, -0.1),
    ],
)
def test_a_gain_is_a_share_of_what_can_be_explained(before, after, floor, gain):
    found = explanation(np.ones(EPISODES), [])
    each = np.ones(EPISODES)
    squares = Squares(before * each, after * each, floor * each, 9 * each, found.problem.simulated, "")
    assert gains_of(found, squares, 0)["creep"].value == pytest.approx(gain)


@pytest.mark.parametrize(("gain", "held"), [(0.2, True), (0.0, False), (-3.0, False)])
def test_a_cause_that_gains_nothing_where_it_was_not_fitted_is_not_relied_on(gain, held):
    found = explanation(np.ones(EPISODES), [])
    told = _not_held(found, {"creep": Interval(gain)})
    assert [item.what.split()[0] for item in told] == ([] if held else ["creep"])
    assert ("gains nothing on episodes" in _evidence(np.ones(EPISODES), Interval(gain))) is not held


@pytest.mark.parametrize("noise", [0.02, 0.2])
def test_rounding_that_is_a_cause_is_no_noise(noise):
    found = explanation(np.ones(EPISODES), [])
    rng, force = np.random.default_rng(1), found.problem.simulated
    measured = np.round(force + noise * rng.standard_normal(force.shape))
    problem = replace(found.problem, measured=measured, step=1.0, dither=max(noise, 0.15))
    named = (replace(found.found[0], name="quantisation"),)
    coarse = replace(found, problem=problem, found=named, refit=lambda part: force)
    squares = hold_out(coarse, force)
    told = figures(squares, 0, None, "")
    assert told.noise_floor <= 1.02 * told.nrmse_after
    assert told.noise_floor > 0.8 * told.nrmse_after
    assert told.nrmse_after < told.nrmse_before
