"""Real recordings with known truth, if the data is available; benchmarks/injections.py produces the rates."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

import paxisim
from paxisim.errors import InvalidValueError

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from injected.broken import COUNT, broken
from injected.cases import Source, injected, null
from injected.effects import KINDS
from injected.real import leaves, regressions

FOLDER = Path(os.environ.get("PAXISIM_EFLESH") or Path(paxisim.__file__).parents[2] / "shared" / "data" / "eflesh")
SEED = 1  # for practice; the benchmark is judged with seed 2

pytestmark = pytest.mark.skipif(not (FOLDER / "press_1.sensor.csv").exists(), reason="needs the eFlesh recordings")


@pytest.fixture(scope="module")
def source():
    return Source(FOLDER)


@pytest.fixture(scope="module")
def streams(source):
    return {case.kind: case.recording for case in (broken(source, SEED, number) for number in range(COUNT))}


def test_a_regression_leaves_little_more_than_the_noise_of_presses_it_has_not_seen(source):
    for name in regressions():
        for number, real in enumerate(source.both):
            left = leaves(real, source.simulated(number, name))
            assert 1 < left.mean() < 1.8, name
            assert left.max() < 3, name


def test_every_effect_stands_above_what_is_left(source):
    for case in (injected(source, SEED, number) for number in range(len(KINDS))):
        assert case.signal > 5, (case.kind, case.words)
        assert np.isfinite(case.recording.measured).all()
        assert case.ideal.shape == case.recording.simulated.shape


def test_noise_in_both_streams_is_unrelated(streams):
    found = paxisim.diagnose(streams["white noise in both"])
    assert found.verdict == "unrelated"
    assert not found.causes


def test_streams_in_another_unit_or_frozen_are_refused(streams):
    for kind, words in {
        "measured in millinewtons": "both must be in newtons",
        "microtesla": "paxisim calibrate",
        "measured frozen": "measured is constant",
        "simulated frozen": "simulated is constant",
    }.items():
        with pytest.raises(InvalidValueError, match=words):
            paxisim.diagnose(streams[kind])


@pytest.mark.slow
def test_a_real_signal_against_its_own_regression_has_no_cause(source):
    found = paxisim.diagnose(null(source, SEED, 8).recording)
    assert found.verdict == "no_discrepancy"
    assert not found.causes
