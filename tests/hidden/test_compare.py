"""Comparison with the truth: the hidden effect itself has no error, a sensor without it has all of it."""

import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

from hidden.advised import ADVISED
from hidden.cases import again, joined, make
from hidden.compare import EXPERIMENTS, TRUE_PARAMETERS, compare, headroom_share
from hidden.effects import EFFECTS, FORMS, Episode

SMALL = {"rows": 4, "cols": 3, "duration": 5.0}
WITHOUT = {("saturation", "slow"), ("dead_band", "shrink"), ("drift", "linear"), ("drift", "temperature")}
"""Forms without a true parameter."""
SMALL_SIGNALS = 26  # a seed whose saturation is calibrated at small forces


FORMED = [(name, form) for name, forms in FORMS.items() for form in forms]


@cache
def hidden(*names, form=None, seed=21, **options):
    forms = tuple((name, form) for name in names if form)
    return make(names, seed=seed, strength=0.8, forms=forms, **SMALL, **options)


def test_every_effect_can_be_compared():
    assert set(EXPERIMENTS) == set(EFFECTS)


@pytest.mark.parametrize("seed", [21, 22])  # different calibration conventions
@pytest.mark.parametrize(
    ("name", "form"), [of for of in FORMED if of[0] not in ("quantisation", "latency", "low_pass", "drift")]
)
def test_the_effect_itself_has_no_error_and_none_has_all(name, form, seed):
    case = hidden(name, form=form, seed=seed)

    def run(x, time, covariates):
        episode = Episode(time[0], covariates["gripper_opening"], covariates["temperature"])
        return case.sensor.effects[name](x.reshape(*x.shape[:3], -1), episode).reshape(x.shape)

    assert compare(name, case, run, {}).error < 1e-9
    assert compare(name, case, lambda x, time, covariates: x, {}).error > 0.5


@pytest.mark.parametrize(("name", "form"), [of for of in FORMED if of[0] in ("latency", "low_pass")])
def test_a_delay_is_read_off_a_ramp(name, form):
    case = hidden(name, form=form)
    (lag,) = {case.truth[name].get(key) for key in ("delay", "lag")} - {None}
    assert compare(name, case, lambda x, time, covariates: x - lag, {}).error < 0.02


def test_a_step_is_read_off_a_ramp():
    step = hidden("quantisation").truth["quantisation"]["step"]
    compared = compare("quantisation", hidden("quantisation"), lambda x, time, cov: np.round(x / step) * step, {})
    assert compared.error < 0.01


def test_a_sensor_calibrated_elsewhere_has_no_error():
    """The gain due to a calibration convention does not count as an error."""
    for name in ("creep", "hysteresis", "stiffening", "saturation"):
        case = hidden(name)

        def run(x, time, covariates, case=case, name=name):
            episode = Episode(time[0], covariates["gripper_opening"], covariates["temperature"])
            return 1.3 * case.sensor.effects[name](x.reshape(*x.shape[:3], -1), episode).reshape(x.shape)

        assert compare(name, case, run, {}).error < 1e-9


@pytest.mark.parametrize(("name", "form"), [of for of in FORMED if of[0] in TRUE_PARAMETERS and of not in WITHOUT])
def test_an_interval_counts_where_it_holds_the_truth(name, form):
    case = hidden(name, form=form, seed=SMALL_SIGNALS if name == "saturation" else 21)
    fitted = {"tau": (300.0, None, None)}
    known = TRUE_PARAMETERS[name](case, fitted)
    assert known
    right = {key: (value, value - 1e-6, value + 1e-6) for key, value in known.items()}
    wrong = {key: (value, value + 1e-6, value + 1.0) for key, value in known.items()}
    none = {key: (value, None, None) for key, value in known.items()}

    def neutral(x, time, covariates):
        return x

    given = (right, wrong, none, {"else": (0.0, -1.0, 1.0)})
    counts = [compare(name, case, neutral, {**fitted, **parameters}) for parameters in given]
    assert [(c.inside, c.intervals) for c in counts] == [(len(known), len(known)), (0, len(known)), (0, 0), (0, 0)]


def test_the_effect_itself_takes_all_of_the_headroom():
    case = hidden("creep", "axis_gain", ideal=True)
    force = np.sum(case.measured.astype(float) ** 2)
    before, best = (
        np.sqrt(np.sum((case.measured - s.astype(float)) ** 2) / force) for s in (case.simulated, case.ideal)
    )
    assert headroom_share(case, before, best) == pytest.approx(1, abs=1e-6)
    assert headroom_share(case, before, before) == 0
    assert headroom_share(hidden("creep", "axis_gain"), before, best) is None


@pytest.mark.parametrize("kind", ["taps", "slides", "probe", "gripper"])
def test_the_same_sensor_is_recorded_again(kind):
    case = hidden("axis_gain")
    second = again(case, [kind], seed=5)
    both = joined(case, second)
    assert second.truth is case.truth
    assert np.all(np.diff(both.time) > 0)
    assert len(both.time) == len(case.time) + len(second.time) == len(both.measured)
    assert len(np.unique(both.episode)) == 8 + len(ADVISED[kind](np.random.default_rng(), (0.02, 0.02), 2))
    if kind != "gripper":
        gain = case.truth["axis_gain"]["gain"]
        z = second.simulated[:, :, 2].astype(float)
        assert np.sum(z * second.measured[:, :, 2]) / np.sum(z * z) == pytest.approx(gain[2], rel=0.02)
