"""Held-out predictions come from fits that never saw the data; gains are fractions of the explainable error."""

from dataclasses import replace

import numpy as np
import pytest
from recorded import diagnosed, plain

from paxisim import augment
from paxisim.diagnose.causes.vocabulary import cause
from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.explain.explanation import heldout_of
from paxisim.diagnose.explain.heldout import SquaredErrors, explained_share, gain_of, survives
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.scorer.scorer import Scorer

EPISODES = 8
CREEP = augment.Creep((0.2,), (1.0,))


@pytest.fixture(scope="module")
def problem():
    return problem_of(plain(lambda force, time: 1.1 * CREEP.run(force, time) + 0.1, seed=4))


def odd(problem, number):
    """Return the problem with the measurements of one episode made unlike those of all others."""
    measured, span = problem.measured.copy(), problem.episodes[number]
    measured[span] = 0.4 * measured[span][::-1] + 0.5
    return replace(problem, measured=measured)


def heldout(problem, names):
    causes = [cause(name) for name in names]
    scorer = Scorer(problem, causes, Rules(lone=2.0))  # whole episodes
    assert not scorer.folds.split
    return heldout_of(problem, scorer.folds, scorer.exact(scorer.fit(names)))


@pytest.mark.parametrize(
    "names",
    [("creep",), ("axis_gain", "latency"), ("taxel_gain",), ("offset", "drift"), ("stiffening", "offset")],
    ids=" + ".join,
)
def test_a_held_out_episode_says_nothing_of_its_own_prediction(problem, names):
    """The prediction from the other episodes does not depend on the measurements of the held-out episode."""
    number = int(np.argmax([problem.simulated[span].max() for span in problem.episodes]))
    change = (heldout(odd(problem, number), names) - heldout(problem, names)) / problem.noise.sigma
    own = np.zeros(len(change), dtype=bool)
    own[problem.episodes[number]] = True
    assert np.sqrt(np.mean(change[own] ** 2)) < 0.02, "the held-out prediction changed by more than 2% of the noise"
    assert np.sqrt(np.mean(change[~own] ** 2)) > 0.02, "the changed episode should affect the predictions of the others"


def squared(before, after=1.0, floor=1.0, without=None):
    each = np.ones(EPISODES)
    return SquaredErrors(before * each, after * each, without or {}, floor * each, 9 * each, "", (), ())


def test_a_gain_is_a_share_of_what_can_be_explained():
    each = np.ones(EPISODES)
    for before, after, floor, gain in (
        (2.0, 1.2, 1.0, 0.8),  # fraction of the error above the floor
        (2.0, 1.2, 1.5, 1.0),  # at most 1, where the floor includes error that was explained
        (2.0, 1.2, 2.1, 0.4),  # fraction of the whole error, with nothing above the floor
        (2.0, 2.2, 1.9999, -0.1),
    ):
        squares = squared(before, after, floor, {"creep": before * each})
        assert gain_of(squares, squares.without["creep"], 0).value == pytest.approx(gain)
    assert explained_share(squared(1.0), each, 0) is None, "nothing is above the floor"
    # some bootstrap samples of a few episodes with little noise have no explainable error: no warning
    share = explained_share(squared(np.array([5.0, *[0.9] * (EPISODES - 1)])), each, 0)
    assert share is not None
    assert np.isfinite([share.low, share.high]).all()


def test_confidence_is_how_often_a_gain_is_enough_when_episodes_are_drawn_again():
    assert survives(np.ones(EPISODES), 4.0, 0) == 1.0
    assert survives(np.ones(EPISODES), 9.0, 0) == 0.0
    lone = np.array([8.0, *[0.0] * (EPISODES - 1)])
    assert 0.5 < survives(lone, 4.0, 0) < 0.8, "share of bootstrap samples that contain the episode"


def test_rounding_that_is_a_cause_is_no_noise():
    recording = plain(seed=4, noise=0.1)
    recording.measured[:] = np.round(recording.measured * 2) / 2
    found = diagnosed(recording, ("quantisation", "dead_band"))
    assert found.causes[0].rivals == (), "what is read off the data has no rivals"
    told = found.heldout
    assert told.noise_floor <= 1.02 * told.nrmse_after
    assert told.noise_floor > 0.8 * told.nrmse_after
    assert told.nrmse_after < told.nrmse_before
