"""A cause includes the effect of the calibration convention: it is named alone, however its sensor was calibrated."""

import numpy as np
import pytest
from recorded import diagnosed, names, plain
from scipy.signal import lfilter

from paxisim.diagnose.causes.kinds import FittedCause
from paxisim.diagnose.causes.parameters import Gauge
from paxisim.diagnose.causes.vocabulary import cause, known_causes
from paxisim.diagnose.data.problem import problem_of
from paxisim.diagnose.rules import Rules
from paxisim.diagnose.scorer.scorer import Scorer

NEAR = ("axis_gain", "creep", "hysteresis", "stiffening", "low_pass", "offset", "interference")
SEED = 5
PEAK = problem_of(plain(seed=SEED)).peak


@pytest.mark.parametrize("held", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
def test_creep_is_creep_whatever_loads_its_sensor_was_calibrated_with(held):
    amount, tau = 0.2, 1.5

    def creeps(force, time):
        kept = np.exp(-np.median(np.diff(time)) / tau)
        relaxed = lfilter([1 - kept], [1, -kept], force, axis=0)
        return (1 - held * amount) * force + amount * relaxed

    found = diagnosed(plain(creeps, seed=SEED), NEAR)
    assert names(found) == ["creep"]
    (share,) = (p.value.value for p in found.causes[0].parameters if p.name == "calibrated_held")
    assert share == pytest.approx(held, abs=0.3)


@pytest.mark.slow
def test_a_gain_that_changes_with_the_square_of_the_force_is_stiffening():
    def stiffens(force, time):
        length = np.linalg.norm(force, axis=2, keepdims=True)
        return force * (1 - 0.15 * (length / PEAK) ** 2)

    assert names(diagnosed(plain(stiffens, seed=SEED), NEAR)) == ["stiffening"]


@pytest.mark.slow
def test_loops_are_hysteresis_whatever_a_small_swing_reads():
    small, width, lag, substeps = 0.85, 0.2 * PEAK, 0.15, 10

    def loops(force, time):
        """Bouc-Wen law; `small` is the gain of small swings."""
        state, last, states = np.zeros_like(force[0]), force[0], np.empty_like(force)
        for frame, now in enumerate(force):
            step = (now - last) / substeps
            for _ in range(substeps):
                state = state + step * (1 - np.where(step * state > 0, np.abs(state) / width, 0.0))
            states[frame], last = state, now
        return (small + lag) * force - lag * states

    assert names(diagnosed(plain(loops, seed=SEED), NEAR)) == ["hysteresis"]


def test_a_field_that_is_not_zero_where_the_recording_begins_is_interference():
    recording = plain(seed=SEED, more=("gripper",) * 3)
    opening = recording.covariates["gripper_opening"]
    size = np.array([[0.4, -0.2, 0.3], [-0.3, 0.5, 0.2]])[:, :, None, None]
    field = (opening - opening.min() - 0.7 * np.ptp(opening)) / np.ptp(opening)
    recording.measured[:] += field[:, None, None, None, None] * size
    assert names(diagnosed(recording, NEAR)) == ["interference"]


def test_a_gain_is_tried_before_the_causes_whose_gauge_is_that_gain():
    problem, rules = problem_of(plain(lambda force, time: 0.8 * force, seed=SEED)), Rules()
    fitted = [item for item in map(cause, known_causes()) if isinstance(item, FittedCause)]
    items = [item for item in fitted if item.name in ("axis_gain", "creep") or item.gauge is not None]
    assert len(items) > rules.contest, "there should be more causes than the contest tries"
    ranked = Scorer(problem, items, rules).ranked(())
    assert ranked[0][1] == "axis_gain"
    assert ranked[-1][0] > 0.95 * ranked[0][0], "all causes should promise nearly as much"


def test_a_gauge_multiplies_what_its_cause_reads():
    problem, time = problem_of(plain(seed=SEED)), np.array([0.0, 0.05])
    force = np.ones((2, 1, 3, 1, 1))
    fitted = [item for item in map(cause, known_causes()) if isinstance(item, FittedCause)]
    gauged = [item for item in fitted if isinstance(item.gauge, Gauge)]
    assert gauged
    for item in gauged:
        start = np.asarray(item.starts(problem)[0], dtype=float)
        numbers = item.gauge.free
        ends = (np.append(start, [end] * len(numbers)) for end in (0.0, 1.0))
        right, other = (item.transform(end, problem).run(force, time) for end in ends)
        gains = np.broadcast_to(item.gauge.gain(start, problem), 3)
        np.testing.assert_allclose(other, right * gains[:, None, None])
        assert item.parameters(problem)[-len(numbers) :] == numbers
