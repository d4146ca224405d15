"""Comparison with the truth: the hidden effect itself has no error, a sensor without it has all of it."""

from functools import cache

import numpy as np
import pytest

from hidden.cases import make
from hidden.compare import EXPERIMENTS, compare, headroom_share
from hidden.effects import EFFECTS, FORMS, Episode

SMALL = {"rows": 3, "cols": 3, "duration": 3.0}


@cache
def hidden(*names, form=None, seed=21, **options):
    forms = tuple((name, form) for name in names if form)
    return make(names, seed=seed, strength=0.8, forms=forms, **SMALL, **options)


def itself(case, name, gain=1.0):
    """Return the hidden effect in the form of a fitted one, calibrated with another gain."""

    def run(x, time, covariates):
        episode = Episode(time[0], covariates["gripper_opening"], covariates["temperature"])
        return gain * case.sensor.effects[name](x.reshape(*x.shape[:3], -1), episode).reshape(x.shape)

    return run


@pytest.mark.parametrize("name", sorted(set(EFFECTS) - {"quantisation", "latency", "low_pass", "drift"}))
def test_the_effect_itself_has_no_error_and_none_has_all(name):
    for form in FORMS[name]:
        for seed in (21, 22):  # different calibration conventions
            case = hidden(name, form=form, seed=seed)
            assert compare(name, case, itself(case, name)) < 1e-9, form
            assert compare(name, case, lambda x, time, covariates: x) > 0.5, form


def test_a_delay_and_a_step_are_read_off_a_ramp():
    assert set(EXPERIMENTS) == set(EFFECTS)
    for name, key in (("latency", "delay"), ("low_pass", "lag")):
        for form in FORMS[name]:
            case = hidden(name, form=form)
            lag = case.truth[name][key]
            assert compare(name, case, lambda x, time, covariates, lag=lag: x - lag) < 0.02, form
    step = hidden("quantisation").truth["quantisation"]["step"]
    assert compare("quantisation", hidden("quantisation"), lambda x, time, cov: np.round(x / step) * step) < 0.01


def test_a_sensor_calibrated_elsewhere_has_no_error():
    """The gain due to a calibration convention does not count as an error."""
    for name in ("creep", "hysteresis", "stiffening", "saturation"):
        assert compare(name, hidden(name), itself(hidden(name), name, gain=1.3)) < 1e-9, name


def test_the_effect_itself_takes_all_of_the_headroom():
    case = hidden("creep", "axis_gain", ideal=True)
    force = np.sum(case.measured.astype(float) ** 2)
    before, best = (
        np.sqrt(np.sum((case.measured - s.astype(float)) ** 2) / force) for s in (case.simulated, case.ideal)
    )
    assert headroom_share(case, before, best) == pytest.approx(1, abs=1e-6)
    assert headroom_share(case, before, before) == 0
    assert headroom_share(hidden("creep", "axis_gain"), before, best) is None
