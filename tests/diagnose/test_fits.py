"""Fits of several causes: which of them has what they have in common, and that more causes never do worse."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.practice.cases import make
from recorded import recording_of

from paxisim import augment
from paxisim.diagnose.cause import cause
from paxisim.diagnose.engine import explain
from paxisim.diagnose.fits import WORSE, Fits
from paxisim.diagnose.fitting import fit
from paxisim.diagnose.intervals import parameters_of
from paxisim.diagnose.noise import Tolerance
from paxisim.diagnose.problem import problem_of


@pytest.fixture(scope="module")
def recording():
    return recording_of(make((), seed=7, rows=4, cols=3, duration=5.0, rho=0.0))


def reads(recording, *transforms):
    """The recording of a sensor that changes what is read so."""
    measured = recording.measured
    for transform in transforms:
        measured = transform(measured)
    return replace(recording, measured=measured)


AXES = (1.2, 0.9, 1.1)


def test_what_all_taxels_have_in_common_is_the_axes_gain(recording):
    gains = np.random.default_rng(3).normal(1.0, 0.1, (2, 4, 3))
    gains /= gains.mean()
    read = reads(recording, augment.AxisGain(AXES), augment.TaxelGain(gains))
    found = fit(problem_of(read, Tolerance()), [cause("axis_gain"), cause("taxel_gain")])
    assert np.mean(found.values["taxel_gain"]) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(found.values["axis_gain"], AXES, atol=0.02)
    alone = fit(problem_of(read, Tolerance()), [cause("taxel_gain")])
    assert np.mean(alone.values["taxel_gain"]) > 1.03, "without gains of axes they hold it"


@pytest.mark.parametrize("order", [("stiffening", "axis_gain"), ("axis_gain", "stiffening")])
def test_beside_the_axes_gain_a_power_law_leaves_one_force_as_it_is(recording, order):
    problem = problem_of(recording, Tolerance())
    scale = 0.6 * problem.peak
    bent = reads(recording, augment.Stiffening(0.8, scale), augment.AxisGain(AXES))
    problem = problem_of(bent, Tolerance())
    causes = [cause(name) for name in order]
    alone = fit(problem, [cause("stiffening")])
    for start in (None, alone.values):
        found = fit(problem, causes, start)
        assert found.values["stiffening"][1] == pytest.approx(scale)
        assert found.values["stiffening"][0] == pytest.approx(0.8, abs=0.02)
        np.testing.assert_allclose(found.values["axis_gain"], AXES, atol=0.02)
    assert alone.values["stiffening"][1] != pytest.approx(scale, rel=0.02), "else it is free"


def test_what_is_held_has_no_interval_and_the_others_have_narrow_ones(recording):
    bent = reads(recording, augment.Stiffening(0.8, 1.0), augment.AxisGain(AXES))
    found = explain(bent, ["stiffening", "axis_gain"])
    fitted = parameters_of(found)
    exponent, scale = fitted["stiffening"]
    assert scale.value.low is None
    for own in (exponent, *fitted["axis_gain"]):
        assert 0 < own.value.high - own.value.low < 0.2


def test_more_causes_are_never_worse_than_fewer():
    """A fit that ended far off is begun again from where fewer of its causes do better."""
    read = recording_of(make(("saturation", "stiffening"), seed=2048020018, family="development"))
    problem = problem_of(read, Tolerance())
    fits = Fits(problem, [cause(name) for name in ("saturation", "stiffening", "axis_gain")])
    bad = fits.of(["saturation", "axis_gain", "stiffening"])
    worse = replace(bad, energy=2 * bad.energy, values={**bad.values, "stiffening": np.array([1.9, 0.1])})
    fits._made[frozenset(bad.values)] = worse
    assert fits.of(list(bad.values)) is worse, "nothing is known of fewer"
    fewer = fits.of(["saturation", "axis_gain"])
    assert worse.energy.sum() > WORSE * fewer.energy.sum()
    again = fits.of(list(bad.values))
    assert again.energy.sum() < fewer.energy.sum()
