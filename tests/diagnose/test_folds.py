"""Units held out together: episodes, or blocks with gaps where a single episode excites a cause."""

from dataclasses import replace

import numpy as np
import pytest
from recorded import plain

from paxisim.diagnose.folds import effects, energy_by_episode, folds_of
from paxisim.diagnose.problem import problem_of
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.vocabulary import cause

RULES = Rules()


@pytest.fixture(scope="module")
def recording():
    return plain(seed=3)


def folds(recording, *names):
    return folds_of(problem_of(recording), [cause(name) for name in names], RULES)


def test_each_episode_is_a_unit_and_a_fold(recording):
    found = folds(recording, "axis_gain", "creep")
    np.testing.assert_array_equal(found.unit, recording.episode)
    np.testing.assert_array_equal(found.fold, np.arange(8))
    np.testing.assert_array_equal(found.episode, np.arange(8))
    assert (found.count, found.split) == (8, ())


def test_many_episodes_share_folds(recording):
    time = recording.time
    halves = 2 * recording.episode + (np.arange(len(time)) % 120 >= 60)
    found = folds(replace(recording, episode=halves), "axis_gain")
    assert len(found.fold) == 16
    assert found.count == RULES.folds
    assert (np.bincount(found.fold) == 2).all()


def test_an_episode_that_alone_excites_a_cause_is_split_in_two_blocks_with_a_gap(recording):
    opening = np.where(recording.episode == 5, 0.02 + 0.02 * np.sin(recording.time), 0.02)
    lone = replace(recording, covariates={"gripper_opening": opening})
    problem = problem_of(lone)
    field = cause("interference")
    shown = np.sum([energy_by_episode(problem, e) for e in effects(problem, field, problem.simulated)], axis=0)
    assert shown.argmax() == 5
    assert shown[5] > RULES.lone * shown.sum()
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


def test_blocks_of_an_episode_speak_with_one_voice_unless_there_are_few_episodes(recording):
    opening = np.where(recording.episode == 5, 0.02 + 0.02 * np.sin(recording.time), 0.02)
    found = folds(replace(recording, covariates={"gripper_opening": opening}), "axis_gain", "interference")
    np.testing.assert_array_equal(found.independent(np.arange(9.0)), [0, 1, 2, 3, 4, 5 + 6, 7, 8])
    one = folds(next(recording.episodes()), "axis_gain")
    np.testing.assert_array_equal(one.independent(np.arange(4.0)), np.arange(4.0))


def test_a_recording_of_one_episode_is_split_into_blocks(recording):
    found = folds(next(recording.episodes()), "axis_gain")
    assert found.count == RULES.few_episodes
    assert set(found.episode) == {0}
    assert found.split == (0,)
    changes = found.unit[np.flatnonzero(np.diff(found.unit, prepend=-2))]
    np.testing.assert_array_equal(changes, [0, -1, 1, -1, 2, -1, 3])


def test_every_sample_is_left_out_by_one_fold(recording):
    for given in (recording, next(recording.episodes())):
        found = folds(given, "axis_gain")
        assert set(found.of_sample) == set(range(found.count))
        known = found.unit >= 0
        np.testing.assert_array_equal(found.of_sample[known], found.fold[found.unit[known]])
