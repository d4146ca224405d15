"""Checks of the examination by physics of its own; none of them runs a diagnosis.

python -m pytest benchmarks/exam -n 2
"""

from dataclasses import replace

import numpy as np
import pytest

from .bench import from_then, only_there
from .cases import Numbers, all_cases, make
from .effects import FORMS, form_called, forms_of
from .motion import draw_plan
from .outsiders import OUTSIDERS
from .pairs import Draw, signals_of
from .presses import FINE
from .sensor import Effect, draw_sensor

SENSOR = draw_sensor(np.random.default_rng(2), draw_plan(np.random.default_rng(2), pads=1), rounds=False)
BENCH = SENSOR.bench
PLAN = BENCH.plan
NEVER_AT_REST = ("offset", "drift", "interference", "dead_taxels")
BY_NAME = {f"{form.cause}-{form.name}": form for form in (*FORMS, *OUTSIDERS)}


def at_frames_or_fine(form, fine):
    return SENSOR.at_frames(fine) if form.digital else fine


def drawn(cause, name, size, seed=1):
    return form_called(cause, name).make(np.random.default_rng(seed), BENCH, size)


def column(forces):
    """Return ``(T,)`` normal forces as the same load on all channels of a pad."""
    return np.broadcast_to(np.asarray(forces, float)[:, None, None, None, None], (len(forces), 1, 3, *BENCH.shape[1:]))


def test_a_pad_rests_outside_the_episodes_and_obeys_coulomb():
    assert not BENCH.force[~BENCH.moving].any()
    for e in PLAN.episodes:
        first = round(e.start * FINE)
        assert not BENCH.force[first : first + FINE // 3].any()
        assert not BENCH.force[first + len(e.force) - FINE // 3 : first + len(e.force)].any()
    assert BENCH.force[:, :, 2].min() >= 0
    assert BENCH.force[:, :, 2].max() == pytest.approx(PLAN.peak)
    shear = np.linalg.norm(BENCH.force[:, :, :2], axis=2)
    assert np.all(shear <= PLAN.friction[0] * BENCH.force[:, :, 2] + 1e-9)
    assert shear.max() > 0.1 * PLAN.peak
    assert 6 <= len(PLAN.episodes) <= 10
    assert all(5 <= len(e.force) / FINE <= 9.01 for e in PLAN.episodes)


def test_the_opening_also_changes_without_contact():
    still = np.abs(BENCH.force).max(axis=(1, 2, 3, 4)) == 0
    assert np.ptp(PLAN.opening[still & BENCH.moving]) > 0.01


@pytest.mark.parametrize("name", BY_NAME)
def test_every_effect_is_finite_repeatable_and_visible_at_its_largest(name):
    form = BY_NAME[name]
    x = at_frames_or_fine(form, SENSOR.force)
    y = form.make(np.random.default_rng(3), BENCH, 0.9)(x)
    assert y.shape == x.shape
    assert np.isfinite(y).all()
    assert np.array_equal(y, form.make(np.random.default_rng(3), BENCH, 0.9)(x))
    weak, strong = (SENSOR.signal([Draw(form, 3).at(size, SENSOR)]) for size in (0.0, 1.0))
    assert strong > 0.5
    if form.sized:
        assert weak < 0.7 * strong


@pytest.mark.parametrize("name", BY_NAME)
def test_rest_stays_rest(name):
    form = BY_NAME[name]
    x = at_frames_or_fine(form, np.zeros_like(SENSOR.force))
    y = form.make(np.random.default_rng(4), BENCH, 0.8)(x)
    if form.cause in NEVER_AT_REST or form.name in ("hum", "bursts"):
        assert form.name == "silent" or y.any()
    else:
        assert np.abs(y).max() < 1e-9


@pytest.mark.parametrize("name", ["power", "logarithm", "stretched", "eyring"])
def test_a_held_load_creeps_upwards_by_2_to_25_percent_and_is_forgotten(name):
    load = np.zeros(len(PLAN.time))
    load[FINE : 11 * FINE] = 0.5 * BENCH.reach[2]
    run = drawn("creep", name, 1.0)
    z = run(column(load))[:, 0, 2, 0, 0] / load[FINE]
    held = z[FINE + 2 : 11 * FINE : 50]
    assert np.all(np.diff(held) > -1e-9)
    assert 0.05 < held[-1] / held[0] - 1 < 0.36
    after = z[11 * FINE + 2 :]
    assert np.all(np.diff(after[::50]) < 1e-9)
    assert after[-1] < 0.6 * after[0]


@pytest.mark.parametrize("name", ["preisach", "duhem", "bouc_wen"])
@pytest.mark.parametrize("size", [0.0, 1.0])
def test_a_loop_has_its_width_at_any_speed(name, size):
    run = drawn("hysteresis", name, size)
    widths = []
    for steps in (1001, 4001):
        way = np.linspace(0, 1, steps)
        z = run(column(BENCH.reach[2] * np.r_[way, way[-2::-1], way[1:], way[-2::-1]]))[:, 0, 2, 0, 0] / BENCH.reach[2]
        up, down = z[2 * steps - 2 : 3 * steps - 2], z[4 * steps - 4 : 3 * steps - 4 : -1]
        widths.append(np.abs(down[: len(up)] - up[: len(down)]).max())
    assert widths[0] == pytest.approx(0.02 * 7.5**size, rel=0.08)
    assert widths[1] == pytest.approx(widths[0], rel=0.03)


@pytest.mark.parametrize("form", forms_of("low_pass"), ids=lambda form: form.name)
@pytest.mark.parametrize("size", [0.0, 1.0])
def test_a_filter_passes_a_still_load_and_little_above_its_corner(form, size):
    run, corner, t = form.make(np.random.default_rng(5), BENCH, size), 15 ** (1 - size), np.arange(20 * FINE) / FINE
    assert run(column(np.ones(len(t))))[-1, 0, 2, 0, 0] == pytest.approx(1, abs=1e-3)
    low, at, high = (
        np.ptp(run(column(np.sin(2 * np.pi * f * corner * t)))[10 * FINE :, 0, 2, 0, 0]) / 2 for f in (0.1, 1, 6)
    )
    assert low == pytest.approx(1, abs=0.02)
    assert (0.5 if form.name == "resonant" else 0.68) < at < (1.02 if form.name == "resonant" else 0.73)
    assert high < 0.2


@pytest.mark.parametrize("form", forms_of("latency"), ids=lambda form: form.name)
def test_a_delay_is_5_to_120_ms(form):
    for size, delay in ((0.0, 0.005), (1.0, 0.12)):
        late = PLAN.time - form.make(np.random.default_rng(6), BENCH, size)(column(PLAN.time))[:, 0, 2, 0, 0]
        assert late[FINE:].mean() == pytest.approx(delay, rel=0.05)


def test_the_soft_layer_acts_on_neighbours_only_and_is_symmetric_where_its_source_is():
    rows, cols = BENCH.shape[1:]
    probe = np.zeros((1, *BENCH.shape[:1], 3, rows, cols))
    probe[0, 0, 2, rows // 2, 0] = 1
    for form in forms_of("gel_operator"):
        y = form.make(np.random.default_rng(7), BENCH, 0.5)(probe) - probe
        assert not y[0, 0, :, rows // 2, 0].any(), "the taxel itself is not changed"
        assert 0.001 < np.abs(y).max() < 0.5
    push = drawn("gel_operator", "boussinesq", 0.5)(probe) - probe
    assert push[0, 0, 0, rows // 2, 1] > 0, "shear points away from the load"
    assert push[0, 0, 1, rows // 2 + 1, 0] > 0
    assert push[0, 0, 1, rows // 2 - 1, 0] < 0


@pytest.mark.parametrize("form", [*forms_of("rotation"), *forms_of("layout"), *forms_of("swapped_taxels")])
def test_turned_and_exchanged_forces_keep_their_energy(form):
    y = form.make(np.random.default_rng(8), BENCH, 1.0)(SENSOR.force)
    assert np.sum(y**2) == pytest.approx(np.sum(SENSOR.force**2), rel=1e-6)
    if form.cause == "layout":
        assert np.array_equal(form.make(np.random.default_rng(8), BENCH, 1.0)(y), SENSOR.force)


def test_a_field_needs_a_moving_gripper():
    still = replace(BENCH, plan=replace(PLAN, opening=np.r_[0.01, np.full(len(PLAN.time) - 1, 0.03)]))
    for form in forms_of("interference"):
        y = form.make(np.random.default_rng(9), still, 1.0)(np.zeros_like(BENCH.force))
        assert np.ptp(y[1:], axis=0).max() < 1e-9
        assert np.ptp(y, axis=0).max() == pytest.approx(5 * BENCH.count, rel=1e-6)


def test_rails_counts_and_dead_taxels():
    rail = drawn("saturation", "hard_rail", 1.0)(SENSOR.force)
    assert np.abs(rail).max() < 0.45 * BENCH.reach[2]
    step = 3 * BENCH.count
    for name in ("coarse", "reluctant"):
        z = drawn("quantisation", name, 1.0)(SENSOR.at_frames(SENSOR.force))[:, :, 2] / step
        assert np.allclose(z, np.round(z))
    for name in ("silent", "stuck", "chip"):
        y = SENSOR.read([Draw(form_called("dead_taxels", name), 1).at(1.0, SENSOR)])
        constant = (np.ptp(y[len(y) * 2 // 3 :], axis=0) == 0).all(axis=1)
        assert 1 <= constant.sum() <= 4


def test_a_signal_is_the_change_of_the_reading_over_the_noise():
    effects = [Draw(form_called(*name), 1).at(0.7, SENSOR) for name in (("creep", "power"), ("rotation", "rigid"))]
    sensor = replace(SENSOR, clips=False)
    difference = sensor.read(effects, noise=False) - sensor.read(effects[1:], noise=False)
    noise = sensor.read() - sensor.read(noise=False)
    expected = np.sqrt(np.mean(difference**2) / np.mean(noise**2))
    assert signals_of(sensor, effects)[0] == pytest.approx(expected, rel=1e-6)


def test_a_local_and_a_late_effect_leave_the_rest_alone():
    form = form_called("axis_gain", "uneven")
    run, mask = form.make(np.random.default_rng(1), BENCH, 1.0), np.zeros((1, 1, *BENCH.shape[1:]), bool)
    mask[:, :, 0] = True
    there, late = only_there(run, mask)(SENSOR.force), from_then(run, 0.5)(SENSOR.force)
    assert np.array_equal(there[:, :, :, 1:], SENSOR.force[:, :, :, 1:])
    half = len(SENSOR.force) // 2
    assert np.array_equal(late[:half], SENSOR.force[:half])
    assert np.array_equal(late[half:], run(SENSOR.force)[half:])
    effect = Effect.of(form, 1.0, only_there(run, mask))
    assert 0 < SENSOR.signal([effect]) < SENSOR.signal([Effect.of(form, 1.0, run)])


def test_cases_have_names_of_their_own_and_are_made_of_the_seed_alone():
    cases = all_cases(0)
    assert len({case.name for case in cases}) == len(cases)
    assert {case.about.split(":")[0] for case in cases if case.kind == "single"} == {form.cause for form in FORMS}
    assert len(all_cases(0, Numbers(single=1, pair=1))) < len(cases)
    null = next(case for case in cases if case.kind == "null")
    one, two, other = make(null), make(null), make(replace(null, seed=1))
    assert np.array_equal(one.recording.tensor, two.recording.tensor)
    assert one.recording.tensor.shape != other.recording.tensor.shape or one.about != other.about


@pytest.mark.parametrize("kind", ["null", "hardnull"])
def test_a_null_differs_by_noise_and_nuisance_only(kind):
    made = make(next(case for case in all_cases(0) if case.kind == kind))
    assert made.true == ()
    assert made.effects == ()
    recording = made.recording
    assert recording.measured is not None
    assert recording.simulated is not None
    error = np.sqrt(np.mean((recording.measured.astype(float) - recording.simulated) ** 2))
    assert error == pytest.approx(np.hypot(made.about["noise"], made.about["nuisance"]), rel=0.15)
    assert made.about["nuisance"] < 0.02 * made.about["peak"]


@pytest.mark.parametrize("kind", ["single", "pair", "order", "part", "onset", "outsider", "poor", "broken"])
def test_every_kind_can_be_made(kind):
    made = make(next(case for case in all_cases(0) if case.kind == kind))
    assert len(made.true) == {"pair": 2, "order": 2, "outsider": 0, "broken": 0}.get(kind, 1)
    assert all(effect["signal"] > 0 for effect in made.effects)
    assert set(made.recording.covariates) == {"gripper_opening", "temperature"}
    assert np.isfinite(made.recording.tensor).all()
