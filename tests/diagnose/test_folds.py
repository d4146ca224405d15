"""Units held out together: episodes, or blocks with gaps where a single episode excites a cause."""

from dataclasses import replace

import numpy as np
import pytest
from recorded import diagnosed, plain

from paxisim.diagnose.causes.vocabulary import cause
from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.scorer.scorer import Scorer

RULES = Rules()


@pytest.fixture(scope="module")
def recording():
    return plain(seed=3)


def folds(recording, *names):
    return Scorer(problem_of(recording), [cause(name) for name in names], RULES).folds


def test_each_episode_is_a_unit_and_a_fold(recording):
    found = folds(recording, "axis_gain", "creep")
    np.testing.assert_array_equal(found.unit, recording.episode)
    np.testing.assert_array_equal(found.fold, np.arange(8))
    np.testing.assert_array_equal(found.episode, np.arange(8))
    assert (found.count, found.split) == (8, ())


def test_many_episodes_share_folds(recording):
    halves = 2 * recording.episode + (np.arange(len(recording.time)) % 120 >= 60)
    found = folds(replace(recording, episode=halves), "axis_gain")
    assert (len(found.fold), found.count) == (16, RULES.folds)
    assert (np.bincount(found.fold) == 2).all()


def test_the_first_press_of_an_unbroken_recording_is_never_held_out(recording):
    unbroken = replace(recording, time=0.05 * np.arange(len(recording)))
    found = folds(unbroken, "axis_gain")
    np.testing.assert_array_equal(found.fold, [-1, *range(7)])
    assert found.never_held_out == (0,)
    assert (found.of_sample[recording.episode == 0] == -1).all()
    told = diagnosed(unbroken, ("axis_gain", "creep")).heldout.note
    assert "Episode 1 was not held out" in told
    assert "not held out" not in diagnosed(recording, ("axis_gain", "creep")).heldout.note


def test_an_episode_that_alone_excites_a_cause_is_split_in_two_blocks_with_a_gap(recording):
    opening = np.where(recording.episode == 5, 0.02 + 0.02 * np.sin(recording.time), 0.02)
    lone = replace(recording, covariates={"gripper_opening": opening})
    found = folds(lone, "axis_gain", "interference")
    assert found.split == (5,)
    np.testing.assert_array_equal(found.episode, [0, 1, 2, 3, 4, 5, 5, 6, 7])
    first, second = found.fold[found.episode == 5]
    assert first != second
    inside = found.unit[recording.episode == 5]
    gap = inside == -1
    assert gap.sum() / 20 == pytest.approx(RULES.gap, abs=0.06)
    assert list(dict.fromkeys(inside)) == [5, -1, 6]
    assert (found.unit[recording.episode != 5] >= 0).all()
    assert folds(lone, "axis_gain").split == ()
    # the blocks of an episode speak with one voice
    np.testing.assert_array_equal(found.independent(np.arange(9.0)), [0, 1, 2, 3, 4, 5 + 6, 7, 8])


def test_each_block_of_an_episode_has_half_of_the_effect(recording):
    since = recording.time - recording.time[recording.episode == 5][0]
    late = (recording.episode == 5) & (since > 4.0)  # of 6 s
    opening = np.where(late, 0.02 + 0.02 * np.sin(8 * since), 0.02)
    found = folds(replace(recording, covariates={"gripper_opening": opening}), "axis_gain", "interference")
    assert found.split == (5,)
    away = np.abs(opening - opening[recording.episode == 5].mean()) ** 2
    first, second = (away[found.unit == unit].sum() for unit in (5, 6))
    assert 0.4 < first / second < 2.5


def test_a_recording_of_one_episode_is_split_into_blocks(recording):
    found = folds(next(recording.episodes()), "axis_gain")
    assert found.count == RULES.few_episodes
    assert set(found.episode) == {0}
    assert found.split == (0,)
    changes = found.unit[np.flatnonzero(np.diff(found.unit, prepend=-2))]
    np.testing.assert_array_equal(changes, [0, -1, 1, -1, 2, -1, 3])
    np.testing.assert_array_equal(found.independent(np.arange(4.0)), np.arange(4.0))
    assert set(found.of_sample) == set(range(found.count)), "every sample is left out by one fold"
    known = found.unit >= 0
    np.testing.assert_array_equal(found.of_sample[known], found.fold[found.unit[known]])
