"""Causes read off the data without a search: a layout with weak shear, and taxels that do not respond."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from paxisim import augment
from paxisim.diagnose.causes.detected import read_off
from paxisim.diagnose.causes.vocabulary import cause
from paxisim.diagnose.data.noise import Noise
from paxisim.diagnose.data.problem import Problem
from paxisim.errors import InvalidValueError

EPISODES, FRAMES, NOISE = 8, 60, 0.02
SIZE = (2, 3, 3, 2)
AMPLITUDE = 0.03 * np.where(np.random.default_rng(9).random(SIZE) < 0.5, -1, 1)


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
    noise = Noise(np.full_like(force, NOISE), 0.0, NOISE)
    return Problem(measured, force, time, {}, spans, noise, alive, float(force.max()))


def read_layout(given):
    return cause("layout").read(given)


def read_taxels(given, simulated, measured):
    """Return the places of dead and of stuck taxels."""
    reading = cause("dead_taxels").read(replace(given, simulated=simulated, measured=measured))
    return [
        [tuple(place) for place in np.argwhere(reading.values[kind])] if reading else [] for kind in ("dead", "stuck")
    ]


def noise(given, seed=2):
    return NOISE * np.random.default_rng(seed).standard_normal((len(given.time), 3))


@pytest.fixture
def pressed():
    return problem(lambda force, time: force)


@pytest.fixture
def streams(pressed):
    """Return copies of both streams of `pressed`, to be changed."""
    return pressed.simulated.copy(), pressed.measured.copy()


@pytest.mark.parametrize("axis", [0, 1])
def test_a_sign_is_told_where_shear_is_small_beside_normal_force(axis):
    signs = np.where(np.arange(3) == axis, -1, 1)
    reading = read_layout(problem(lambda force, time: force * signs[:, None, None], axes=(0.15, 0.4, 6.0)))
    assert reading.transform.axis_signs == tuple(signs)
    assert read_layout(problem(lambda force, time: force, axes=(0.15, 0.4, 6.0))) is None


@pytest.mark.parametrize("flipped", [False, True])
def test_a_normal_force_whose_sign_is_reversed_is_no_turned_pad(flipped):
    shape = np.random.default_rng(5).random((2, 1, 3, 2))  # a symmetric press would not reveal a turned pad
    upright = problem(lambda force, time: force, axes=(0.15, 0.4, 6.0))
    simulated = upright.simulated * shape
    for signs in ((1, 1, -1), (-1, -1, -1)):
        fault = augment.LayoutFault(flip_rows=flipped, axis_signs=signs)
        measured = fault(simulated) + upright.measured - upright.simulated
        assert str(read_layout(replace(upright, simulated=simulated, measured=measured)).transform) == str(fault)


def test_a_sensor_that_reads_the_normal_force_as_shear_is_not_turned():
    mixing = np.array([[1, 0, -0.3], [0, 1, 0.3], [0, 0, 1]])
    # a press whose shear is proportional to its normal force
    alike = np.array([[1, 0, 0.05], [0, 1, -0.05], [0, 0, 1]])
    made = problem(lambda force, time: force, axes=(0.02, 0.02, 3.0))
    simulated = np.einsum("ij,tpjrc->tpirc", alike, made.simulated)
    measured = made.measured - made.simulated + np.einsum("ij,tpjrc->tpirc", mixing, simulated)
    assert np.corrcoef(simulated[:, 0, 0, 0, 0], measured[:, 0, 0, 0, 0])[0, 1] < -0.9
    assert read_layout(replace(made, simulated=simulated, measured=measured)) is None


@pytest.mark.parametrize("answers", [True, False])
def test_a_taxel_that_only_taps_touched_is_dead_if_it_does_not_answer_late_either(pressed, streams, answers):
    simulated, measured = streams
    tap = np.where(np.isin(np.arange(len(pressed.time)) // 2, (40, 100, 130, 160)), 2.0, 0.0)  # four taps of 0.1 s
    kept = np.exp(-0.05 / 0.6)
    late = lfilter([1 - kept], [1, -kept], tap)
    simulated[:, 0, :, 0, 0] = tap[:, None] * [0.0, 0.0, 1.0]
    measured[:, 0, :, 0, 0] = noise(pressed, 1) + answers * late[:, None] * [0.0, 0.0, 1.0]
    assert read_taxels(pressed, simulated, measured) == [[] if answers else [(0, 0, 0)], []]


@pytest.mark.parametrize("shared", [True, False])
def test_a_taxel_whose_slow_noise_looks_like_a_shear_is_dead_unless_all_episodes_show_it(pressed, streams, shared):
    simulated, measured = streams
    answer = np.full(EPISODES, 0.16) if shared else 0.16 + 0.6 * np.resize([1.0, -1.0], EPISODES)
    shear = np.repeat(answer, FRAMES)[:, None] * simulated[:, 1, :, 0, 1] * [1.0, 0, 0]
    measured[:, 1, :, 0, 1] = noise(pressed, 5) + shear
    assert read_taxels(pressed, simulated, measured) == [[] if shared else [(1, 0, 1)], []]


@pytest.mark.parametrize(("level", "answers", "stuck"), [(0.4, 0.0, True), (0.4, 1.0, False), (0.0, 0.0, False)])
def test_a_taxel_that_is_hardly_pressed_is_stuck_if_it_reads_something_and_stays_there(
    pressed, streams, level, answers, stuck
):
    simulated, measured = streams
    measured[:, 1, :, 2, 0] += level - simulated[:, 1, :, 2, 0]
    simulated[:, 1, :, 2, 0] *= 0.05  # 50 mN at most
    measured[:, 1, :, 2, 0] += answers * simulated[:, 1, :, 2, 0]
    assert read_taxels(pressed, simulated, measured) == [[], [(1, 2, 0)] if stuck else []]


@pytest.mark.parametrize("steep", [False, True])
def test_a_taxel_that_only_the_edge_of_one_contact_may_have_touched_is_not_dead(pressed, streams, steep):
    simulated, measured = streams
    simulated[:, 0, :, 1, 1] *= (np.arange(len(pressed.time)) < FRAMES)[:, None]
    measured[:, 0, :, 1, 1] = noise(pressed)
    sigma = pressed.noise.sigma.copy()
    sigma[:, 0, 2, 1, 1] += steep * 0.12 * simulated[:, 0, 2, 1, 1]  # where the contact force falls off steeply
    found = read_taxels(replace(pressed, noise=replace(pressed.noise, sigma=sigma)), simulated, measured)
    assert found == [[] if steep else [(0, 1, 1)], []]


@pytest.mark.parametrize("drifts", [True, False])
def test_a_taxel_that_is_hardly_pressed_is_dead_if_it_does_not_drift_with_the_others(drifts):
    made = problem(lambda force, time: force - np.expm1(-time / 150)[:, None, None, None, None] * 8 * AMPLITUDE)
    simulated, measured = made.simulated.copy(), made.measured.copy()
    measured[:, 1, :, 2, 0] = noise(made) + drifts * (measured - simulated)[:, 1, :, 2, 0]
    simulated[:, 1, :, 2, 0] *= 0.05
    assert read_taxels(made, simulated, measured) == [[] if drifts else [(1, 2, 0)], []]


def test_what_was_read_off_is_left_out_of_what_is_left_to_explain(pressed, streams):
    _, measured = streams
    measured[:, 1, :, 2, 0] = noise(pressed)
    off = read_off(replace(pressed, measured=measured), [cause(name) for name in ("layout", "dead_taxels")])
    assert list(off.readings) == ["dead_taxels"]
    gone = np.zeros(SIZE, dtype=bool)
    gone[1, :, 2, 0] = True
    np.testing.assert_array_equal(off.problem.alive, ~gone)
    assert off.judged.alive.all(), "the missing reading of a dead taxel should still count as an error"
    with pytest.raises(InvalidValueError, match="no taxel responds"):
        read_off(problem(lambda force, time: 0 * force), [cause("dead_taxels")])
