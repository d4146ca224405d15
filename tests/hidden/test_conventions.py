"""A sensor with an effect reads correctly where it was calibrated."""

import numpy as np
import pytest

from hidden.cases import make
from hidden.effects import EFFECTS, FORMS, Episode

PAD = make((), seed=3, rows=4, cols=3, duration=5.0).sensor.pad


def drawn(name, form, count=40, strength=0.8):
    """Yield draws of an effect: a function `read` of (T,) normal forces on one taxel, and the truth."""
    for seed in range(count):
        apply, truth = EFFECTS[name](np.random.default_rng(seed), PAD, strength, form)

        def read(forces, apply=apply):
            f = np.zeros((len(forces), 1, 3, 1))
            f[:, 0, 2, 0] = forces
            return apply(f, None)[:, 0, 2, 0]

        yield read, truth


@pytest.mark.parametrize("form", FORMS["hysteresis"])
def test_a_loop_has_its_width_and_is_right_where_it_is_calibrated(form):
    way = np.linspace(0, 1, 501)
    forces = PAD.peak * np.r_[way, way[-2::-1], way[1:], way[-2::-1]]
    seen = set()
    for read, truth in drawn("hysteresis", form, 10):
        y = read(forces) / PAD.peak
        assert y[1750] - y[1250] == pytest.approx(truth["width"])
        right = {"small": y[1] * 500, "full": y[1500], "middle": y[1250] + y[1750]}
        assert right[truth["right_at"]] == pytest.approx(1)
        seen.add(truth["right_at"])
    assert seen == {"small", "full", "middle"}


@pytest.mark.parametrize("form", FORMS["creep"])
def test_creep_is_right_at_once_or_under_held_loads_or_between(form):
    seen = set()
    for read, truth in drawn("creep", form, 20):
        y = read(np.ones(150_000))
        assert y[-1] == pytest.approx(1 + truth["amount"] * (1 - truth["held"]), abs=1e-2)
        assert y[0] == pytest.approx(1 - truth["amount"] * truth["held"], abs=0.02)
        seen.add(truth["held"] if truth["held"] in (0.0, 1.0) else "between")
    assert seen == {0.0, 1.0, "between"}


@pytest.mark.parametrize("form", FORMS["stiffening"])
def test_a_stiffening_is_right_at_its_force_and_reads_more_of_a_larger_one(form):
    for read, truth in drawn("stiffening", form, strength=1.0):
        at = truth["right_at"] * PAD.peak
        assert read(np.array([at]))[0] == pytest.approx(at)
        assert (np.diff(read(np.linspace(0, PAD.peak, 200))) > 0).all()


@pytest.mark.parametrize("form", FORMS["saturation"])
def test_a_saturation_is_right_at_small_forces_or_at_the_peak(form):
    seen = set()
    for read, truth in drawn("saturation", form):
        at = {"small": 0.1, "peak": 1.0}[truth["right_at"]] * PAD.peak
        assert read(np.array([at]))[0] == pytest.approx(at, rel=0.03 if form == "langevin" else 5e-3)
        assert read(np.array([3 * PAD.peak]))[0] < (1.2 if form == "langevin" else 1.1) * PAD.peak
        seen.add(truth["right_at"])
    assert seen == {"small", "peak"}


@pytest.mark.parametrize("form", FORMS["dead_band"])
def test_a_dead_band_is_right_above_it_or_at_the_peak_or_shrinks(form):
    seen = set()
    for read, truth in drawn("dead_band", form):
        gone = truth["width"] if truth["right_at"] == "edge" else 0.0
        assert read(np.array([PAD.peak]))[0] == pytest.approx(PAD.peak - gone, rel=1e-3)
        assert read(np.array([0.5 * truth["width"]]))[0] < (0.15 if form == "gradual" else 0.05) * truth["width"]
        seen.add(truth["right_at"])
    assert seen == ({"edge", "peak"} if form in ("shrink", "gradual") else {"above"})


@pytest.mark.parametrize("form", FORMS["interference"])
def test_a_field_is_zeroed_at_an_opening_within_the_travel(form):
    for seed in range(4):
        apply, truth = EFFECTS["interference"](np.random.default_rng(seed), PAD, 0.8, form)
        opening = np.array([truth["zeroed_at"], 0.0, 0.01, 0.02, 0.03, 0.04])
        field = apply(np.zeros((6, PAD.pads, 3, len(PAD.where))), Episode(0.0, opening, 25 + 0 * opening))
        assert np.abs(field[0]).max() < 1e-12
        assert 0.5 * truth["size"] < np.abs(field).mean(axis=(1, 3)).max() <= 1.1 * truth["size"]


@pytest.mark.parametrize("form", FORMS["drift"])
def test_a_drift_is_zeroed_when_the_recording_begins_or_before(form):
    seen = set()
    for seed in range(10):
        apply, truth = EFFECTS["drift"](np.random.default_rng(seed), PAD, 0.8, form)
        rest, nothing = np.zeros((1, PAD.pads, 3, len(PAD.where))), np.zeros(1)
        first, last = (np.abs(apply(rest, Episode(start, nothing, nothing))).max() for start in (0.0, 600.0))
        assert (first > 0.02 * last) == (truth["zeroed_before"] > 0)
        seen.add(truth["zeroed_before"] > 0)
    assert seen == {False, True}


@pytest.mark.parametrize("form", FORMS["crosstalk"])
def test_a_taxel_loses_what_its_neighbours_get_or_does_not(form):
    seen = set()
    for seed in range(8):
        apply, truth = EFFECTS["crosstalk"](np.random.default_rng(seed), PAD, 0.8, form)
        load = np.zeros((1, 1, 3, len(PAD.where)))
        load[..., 4] = 1.0
        read = apply(load, None)
        got = truth["kernel"][:, :, 4].sum(axis=-1)
        np.testing.assert_allclose(read.sum(axis=-1)[0, 0], 1.0 if truth["loses"] else 1 + got)
        assert (truth["kernel"] < 0).any() == (form in ("mixed_signs", "dipoles")) or form == "neighbours"
        seen.add(truth["loses"])
    assert seen == {False, True}
