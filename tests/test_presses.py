"""Presses in noisy load signals and the cuts between them."""

import itertools
import os
from pathlib import Path

import numpy as np
import pytest

import paxisim
from paxisim.errors import InvalidValueError

EFLESH = Path(os.environ.get("PAXISIM_EFLESH") or Path(paxisim.__file__).parents[2] / "shared" / "data" / "eflesh")


def pressed(seed, noise=0.1, rest=0.7, hold=False, pause=(1.0, 3.0), drift=0.0, rate=50):
    """Return times, a load signal with eight presses of 10 to 34 N, and the samples of each press."""
    rng = np.random.default_rng(seed)
    parts, spans, at = [], [], 0
    for _ in range(8):
        still, count = (int(rate * rng.uniform(*span)) for span in (pause, (2.0, 8.0)))
        shape = np.sin(np.pi * np.arange(count) / count) ** 2
        parts += [np.zeros(still), rng.uniform(10, 34) * (np.clip(3 * shape, 0, 1) if hold else shape)]
        spans.append((at + still, at + still + count))
        at += still + count
    load = np.concatenate([*parts, np.zeros(rate)])
    time = np.arange(len(load)) / rate
    return time, load + rest + noise * rng.normal(size=len(load)) + drift * time / time[-1], spans


@pytest.mark.parametrize(
    "how",
    [
        {"noise": 0.0},
        {},  # defaults: rest at 2 % of the peak, 0.1 N of noise
        {"noise": 1.0},
        {"hold": True},
        {"rest": -3.0},
        {"pause": (0.5, 0.8)},
        {"drift": 0.5},
        {"rate": 300},
    ],
    ids=str,
)
def test_each_press_is_found_and_the_cuts_lie_between(how):
    for seed in range(5):
        time, load, spans = pressed(seed, **how)
        found = paxisim.find_presses(time, load)
        assert len(found.spans) == len(spans)
        assert len(found.cuts) == len(spans) - 1
        for own, (start, stop) in zip(found.spans, spans, strict=True):
            assert start - 3 <= own.start < own.stop <= stop + 3  # noise does not start a press
            assert own.stop - own.start > 0.5 * (stop - start)
        for cut, (before, after) in zip(found.cuts, itertools.pairwise(spans), strict=True):
            assert before[1] - 3 <= cut <= after[0] + 3


def test_sign_and_zero_of_the_load_cell_do_not_matter():
    time, load, spans = pressed(0, rest=0.0)
    cuts = paxisim.find_presses(time, load).cuts
    for sign, zero in itertools.product((1, -1), (-25.0, 0.0, 25.0)):
        found = paxisim.find_presses(time, sign * load + zero)
        assert len(found.spans) == len(spans)
        assert found.rest == pytest.approx(sign * zero, abs=0.1)
        assert (found.load - found.rest).max() == pytest.approx(load.max(), abs=0.1)
    assert paxisim.find_presses(time, -load).cuts == cuts


def test_several_components_count_by_their_distance_from_rest():
    time, load, spans = pressed(1, noise=0.0, rest=0.0)
    noise = 0.1 * np.random.default_rng(0).normal(size=(len(time), 3))
    turned = load[:, None] * np.array([0.6, -0.8, 0.0]) + np.array([2.0, -1.0, 5.0]) + noise
    found = paxisim.find_presses(time, turned)
    assert len(found.spans) == len(spans)
    assert found.load.max() == pytest.approx(load.max(), rel=0.02)


def test_rest_and_noise_are_those_of_the_signal_and_a_still_one_has_no_press():
    found = [paxisim.find_presses(*pressed(seed)[:2]) for seed in range(10)]
    assert np.mean([item.rest for item in found]) == pytest.approx(0.7, abs=0.03)
    assert np.mean([item.noise for item in found]) == pytest.approx(0.1, rel=0.25)
    assert all(item.low < item.high for item in found)
    assert np.unique(found[0].episode).tolist() == list(range(8))
    assert np.all(np.diff(found[0].episode) >= 0)
    assert repr(found[0]).startswith("8 presses in 8 episodes: rest 0.7")
    time = found[0].time
    assert paxisim.find_presses(time, 0.1 * np.random.default_rng(0).normal(size=len(time))).cuts == ()
    assert paxisim.find_presses(time, np.zeros(len(time))).spans == ()


def test_unknown_samples_belong_to_no_press():
    time, load, spans = pressed(2)
    load[spans[3][1] + 5 : spans[4][0] - 5] = np.nan
    found = paxisim.find_presses(time, load)
    assert len(found.spans) == len(spans)
    assert not any(np.isnan(load[span]).any() for span in found.spans)


def test_bad_input():
    for time, load, words in [
        ([], [], "at least 8 known samples, got 0"),
        (np.arange(5), np.zeros(5), "at least 8 known samples, got 5"),
        (np.arange(9), np.zeros(10), "load must be"),
        (np.arange(9)[::-1], np.zeros(9), "run back"),
    ]:
        with pytest.raises(InvalidValueError, match=words):
            paxisim.find_presses(time, load)


@pytest.mark.skipif(not (EFLESH / "press_1.sensor.csv").exists(), reason="needs the eFlesh recordings")
def test_a_real_load_cell_is_cut_into_its_ten_presses():
    for number, (rest, noise) in itertools.product((1, 2), ((0.0, 0.0), (0.68, 0.1), (0.68, 0.5))):
        recording = paxisim.Recording.load(EFLESH / f"press_{number}.sensor.csv")
        load = recording.covariates["load"] + rest + noise * np.random.default_rng(0).normal(size=len(recording))
        found = paxisim.find_presses(recording.time, load)
        assert len(found.spans) == 10
        gaps = np.diff(recording.time[list(found.cuts)])
        assert len(gaps) == 8
        np.testing.assert_allclose(gaps, 38, atol=2)
