"""Causes read off the data without a search: a layout with weak shear, and taxels that do not respond."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from paxisim import augment
from paxisim.diagnose.problem import Problem
from paxisim.diagnose.reading import read_off
from paxisim.diagnose.vocabulary import cause
from paxisim.errors import InvalidValueError

EPISODES, FRAMES, NOISE = 8, 60, 0.02
SIZE = (2, 3, 3, 2)


def problem(measured_of, axes=(0.3, -0.2, 1.0), seed=4):
    """Return eight presses, 30 s apart, that differ in x, y and z, measured as ``measured_of(force, time)``."""
    rng = np.random.default_rng(seed)
    time = np.concatenate([30.0 * k + 0.05 * np.arange(FRAMES) for k in range(EPISODES)])
    phase = np.linspace(-1, 1, FRAMES)
    push = np.maximum(np.cos(np.pi * phase), 0)
    shapes = np.stack([push * np.sin(3 * phase), push * phase, push], axis=1)  # at rest half the time
    force = np.tile(shapes, (EPISODES, 1))[:, None, :, None, None] * np.ones((1, *SIZE)) * np.reshape(axes, (3, 1, 1))
    measured = measured_of(force, time) + NOISE * rng.standard_normal(force.shape)
    spans = tuple(slice(k * FRAMES, (k + 1) * FRAMES) for k in range(EPISODES))
    alive = np.ones(SIZE, dtype=bool)
    return Problem(measured, force, time, {}, spans, np.full_like(force, NOISE), float(force.max()), alive, 0.0, NOISE)


def read_layout(given):
    return cause("layout").read(given)


def read_taxels(given):
    return cause("dead_taxels").read(given)


AMPLITUDE = 0.03 * np.where(np.random.default_rng(9).random(SIZE) < 0.5, -1, 1)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_sign_is_told_where_shear_is_small_beside_normal_force(axis):
    signs = np.where(np.arange(3) == axis, -1, 1)
    made = problem(lambda force, time: force * signs[:, None, None], axes=(0.15, 0.4, 6.0))
    reading = read_layout(made)
    assert reading is not None
    assert reading.transform.axis_signs == tuple(signs)
    assert read_layout(problem(lambda force, time: force, axes=(0.15, 0.4, 6.0))) is None


@pytest.mark.parametrize("signs", [(1, 1, -1), (-1, -1, -1)])
@pytest.mark.parametrize("flipped", [False, True])
def test_a_normal_force_whose_sign_is_reversed_is_no_turned_pad(signs, flipped):
    shape = np.random.default_rng(5).random((2, 1, 3, 2))  # a symmetric press would not reveal a turned pad
    fault = augment.LayoutFault(flip_rows=flipped, axis_signs=signs)
    upright = problem(lambda force, time: force, axes=(0.15, 0.4, 6.0))
    simulated = upright.simulated * shape
    turned = replace(upright, simulated=simulated, measured=fault(simulated) + upright.measured - upright.simulated)
    reading = read_layout(turned)
    assert reading is not None
    assert str(reading.transform) == str(fault)


def test_a_sensor_that_reads_the_normal_force_as_shear_is_not_turned():
    mixing = np.array([[1, 0, -0.3], [0, 1, 0.3], [0, 0, 1]])
    # a press whose shear is proportional to its normal force
    alike = np.array([[1, 0, 0.05], [0, 1, -0.05], [0, 0, 1]])
    made = problem(lambda force, time: force, axes=(0.02, 0.02, 3.0))
    simulated = np.einsum("ij,tpjrc->tpirc", alike, made.simulated)
    measured = made.measured - made.simulated + np.einsum("ij,tpjrc->tpirc", mixing, simulated)
    coupled = replace(made, simulated=simulated, measured=measured)
    assert np.corrcoef(simulated[:, 0, 0, 0, 0], measured[:, 0, 0, 0, 0])[0, 1] < -0.9
    assert read_layout(coupled) is None


@pytest.mark.parametrize("answers", [True, False])
def test_a_taxel_that_only_taps_touched_is_dead_if_it_does_not_answer_late_either(answers):
    made = problem(lambda force, time: force)
    simulated, measured = made.simulated.copy(), made.measured.copy()
    tap = np.where(np.isin(np.arange(len(made.time)) // 2, (40, 100, 130, 160)), 2.0, 0.0)  # four taps of 0.1 s
    kept = np.exp(-0.05 / 0.6)
    late = lfilter([1 - kept], [1, -kept], tap)
    simulated[:, 0, :, 0, 0] = tap[:, None] * [0.0, 0.0, 1.0]
    noise = NOISE * np.random.default_rng(1).standard_normal((len(tap), 3))
    measured[:, 0, :, 0, 0] = noise + answers * late[:, None] * [0.0, 0.0, 1.0]
    reading = read_taxels(replace(made, simulated=simulated, measured=measured))
    if answers:
        assert reading is None
    else:
        assert reading is not None
        np.testing.assert_array_equal(np.argwhere(reading.values["dead"]), [[0, 0, 0]])


@pytest.mark.parametrize("shared", [True, False])
def test_a_taxel_whose_slow_noise_looks_like_a_shear_is_dead_unless_all_episodes_show_it(shared):
    made = problem(lambda force, time: force)
    measured = made.measured.copy()
    answer = np.full(EPISODES, 0.16) if shared else 0.16 + 0.6 * np.resize([1.0, -1.0], EPISODES)
    noise = NOISE * np.random.default_rng(5).standard_normal((len(made.time), 3))
    measured[:, 1, :, 0, 1] = noise + np.repeat(answer, FRAMES)[:, None] * made.simulated[:, 1, :, 0, 1] * [1.0, 0, 0]
    reading = read_taxels(replace(made, measured=measured))
    assert (reading is None) is shared
    if reading is not None:
        np.testing.assert_array_equal(np.argwhere(reading.values["dead"]), [[1, 0, 1]])


@pytest.mark.parametrize(("level", "answers", "stuck"), [(0.4, 0.0, True), (0.4, 1.0, False), (0.0, 0.0, False)])
def test_a_taxel_that_is_hardly_pressed_is_stuck_if_it_reads_something_and_stays_there(level, answers, stuck):
    made = problem(lambda force, time: force)
    simulated, measured = made.simulated.copy(), made.measured.copy()
    measured[:, 1, :, 2, 0] += level - simulated[:, 1, :, 2, 0]
    simulated[:, 1, :, 2, 0] *= 0.05  # 50 mN at most
    measured[:, 1, :, 2, 0] += answers * simulated[:, 1, :, 2, 0]
    reading = read_taxels(replace(made, simulated=simulated, measured=measured))
    assert (reading is not None) is stuck
    if reading is not None:
        np.testing.assert_array_equal(np.argwhere(reading.values["stuck"]), [[1, 2, 0]])
        np.testing.assert_allclose(reading.values["value"][1, :, 2, 0], level, atol=NOISE)


def test_a_taxel_that_only_the_edge_of_one_contact_may_have_touched_is_not_dead():
    made = problem(lambda force, time: force)
    simulated, measured, sigma = made.simulated.copy(), made.measured.copy(), made.sigma.copy()
    simulated[:, 0, :, 1, 1] *= (np.arange(len(made.time)) < FRAMES)[:, None]
    measured[:, 0, :, 1, 1] = NOISE * np.random.default_rng(2).standard_normal((len(made.time), 3))
    missed = replace(made, simulated=simulated, measured=measured)
    reading = read_taxels(missed)
    assert reading is not None
    np.testing.assert_array_equal(np.argwhere(reading.values["dead"]), [[0, 1, 1]])
    sigma[:, 0, 2, 1, 1] += 0.12 * simulated[:, 0, 2, 1, 1]  # the contact force falls off steeply there
    assert read_taxels(replace(missed, sigma=sigma)) is None


@pytest.mark.parametrize("drifts", [True, False])
def test_a_taxel_that_is_hardly_pressed_is_dead_if_it_does_not_drift_with_the_others(drifts):
    made = problem(lambda force, time: force - np.expm1(-time / 150)[:, None, None, None, None] * 8 * AMPLITUDE)
    simulated, measured = made.simulated.copy(), made.measured.copy()
    noise = NOISE * np.random.default_rng(2).standard_normal((len(made.time), 3))
    measured[:, 1, :, 2, 0] = noise + drifts * (measured - simulated)[:, 1, :, 2, 0]
    simulated[:, 1, :, 2, 0] *= 0.05
    reading = read_taxels(replace(made, simulated=simulated, measured=measured))
    assert (reading is None) is drifts
    if reading is not None:
        np.testing.assert_array_equal(np.argwhere(reading.values["dead"]), [[1, 2, 0]])


def test_what_was_read_off_is_left_out_of_what_is_left_to_explain():
    made = problem(lambda force, time: force)
    measured = made.measured.copy()
    measured[:, 1, :, 2, 0] = NOISE * np.random.default_rng(2).standard_normal((len(made.time), 3))
    causes = [cause(name) for name in ("layout", "dead_taxels", "quantisation")]
    off = read_off(replace(made, measured=measured), causes)
    assert list(off.readings) == ["dead_taxels"]
    gone = np.zeros(SIZE, dtype=bool)
    gone[1, :, 2, 0] = True
    np.testing.assert_array_equal(off.problem.alive, ~gone)
    assert off.judged.alive.all(), "the missing reading of a dead taxel should still count as an error"


def test_a_sensor_that_does_not_answer_at_all_is_refused():
    made = problem(lambda force, time: 0 * force)
    with pytest.raises(InvalidValueError, match="no taxel responds"):
        read_off(made, [cause("dead_taxels")])
