import numpy as np
import pytest

import paxisim.recording
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout

Recording = paxisim.recording.Recording
FORCE = np.arange(5 * 2 * 3 * 2 * 3, dtype=np.float32).reshape(5, 2, 3, 2, 3)
TIME = np.arange(5) * 0.1


def test_defaults():
    recording = Recording(time=TIME, measured=FORCE)
    assert len(recording) == 5
    assert recording.layout == TaxelLayout(2, 3, (1e-3, 1e-3))
    assert recording.pads == ("pad0", "pad1")
    assert recording.episode.tolist() == [0] * 5
    assert recording.simulated is None
    assert recording.measured is not None
    assert np.shares_memory(recording.measured, FORCE)


def test_numbers_of_other_kinds_are_converted():
    recording = Recording(
        time=[0, 1, 2, 3, 4],
        measured=FORCE.astype(int),
        simulated=FORCE.astype(np.float64),
        covariates={"closed": [True, False, True, True, False]},
        episode=[0.0, 0.0, 1.0, 1.0, 1.0],
    )
    assert recording.time.dtype == np.float64
    assert recording.measured.dtype == recording.simulated.dtype == np.float32
    assert recording.covariates["closed"].tolist() == [1, 0, 1, 1, 0]
    assert recording.episode.dtype == np.int64


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({}, "give measured, simulated or both"),
        ({"measured": FORCE[0]}, r"measured must have shape \(T, pads, 3, rows, cols\)"),
        ({"measured": FORCE[:, :, :2]}, "measured must have shape"),
        ({"measured": FORCE[:4]}, "measured has 4 samples, time has 5"),
        ({"measured": "abc"}, "measured must be an array of numbers"),
        ({"measured": FORCE, "simulated": FORCE[..., :2]}, "must have one shape"),
        ({"measured": FORCE, "layout": TaxelLayout(3, 3, (1e-3, 1e-3))}, "layout has 3x3 taxels, the tensors have 2x3"),
        ({"measured": FORCE, "layout": "paper"}, "layout must be a TaxelLayout"),
        ({"measured": FORCE, "pads": ("left",)}, "pads must be 2 different names"),
        ({"measured": FORCE, "pads": ("left", "left")}, "pads must be 2 different names"),
        ({"measured": FORCE, "pads": "lr"}, "pads must be a sequence of names"),
        ({"measured": FORCE, "covariates": {"opening": np.zeros(4)}}, r"covariates\['opening'\]"),
        ({"measured": FORCE, "covariates": {"opening": 1.0}}, r"covariates\['opening'\]"),
        ({"measured": FORCE, "covariates": {"": np.zeros(5)}}, "covariates must have names"),
        ({"measured": FORCE, "episode": np.zeros(4)}, "episode must have shape"),
        ({"measured": FORCE, "episode": [0, 0, 0.5, 1, 1]}, "whole numbers"),
        ({"measured": FORCE, "episode": [0, 1, 0, 1, 1]}, "those of episode 0 are not"),
        ({"measured": FORCE, "time": [0, 1, 3, 2, 4]}, "sample 3 is at 2 s, the one before at 3 s"),
        ({"measured": FORCE, "time": [0, 1, np.nan, 3, 4]}, "time must be finite, sample 2 is not"),
        ({"measured": FORCE[:0], "time": []}, "at least one sample"),
        ({"measured": FORCE, "metadata": {"layout": 3}}, "metadata must not hold 'layout'"),
    ],
)
def test_what_does_not_fit_is_named(fields, words):
    with pytest.raises(InvalidValueError, match=words):
        Recording(**{"time": TIME, **fields})


def test_time_may_start_anew_with_an_episode():
    recording = Recording(time=[5, 6, 0, 1, 2], measured=FORCE, episode=[7, 7, 3, 3, 3])
    assert recording.duration == 3
    assert recording.rate == 1
    assert [len(part) for part in recording.episodes()] == [2, 3]
    assert recording.select([3]).time.tolist() == [0, 1, 2]
    assert recording.select([3, 7]).episode.tolist() == [7, 7, 3, 3, 3]
    with pytest.raises(InvalidValueError, match="no episode 5 in the recording; its episodes are 7, 3"):
        recording.select([5])


def test_samples_of_all_streams_are_taken_together():
    recording = Recording(
        time=TIME, measured=FORCE, simulated=-FORCE, covariates={"pose": FORCE[:, 0, :, 0, 0]}, pads=("l", "r")
    )
    for samples in (slice(1, 4), np.array([1, 2, 3]), np.array([False, True, True, True, False])):
        part = recording[samples]
        assert part.time.tolist() == TIME[1:4].tolist()
        np.testing.assert_array_equal(part.measured, FORCE[1:4])
        np.testing.assert_array_equal(part.simulated, -FORCE[1:4])
        np.testing.assert_array_equal(part.covariates["pose"], FORCE[1:4, 0, :, 0, 0])
        assert part.pads == ("l", "r")
    assert np.shares_memory(recording[1:].measured, FORCE)


@pytest.mark.parametrize("samples", [2, slice(9, 9), [], [9], [True], "a", [0.5]])
def test_samples_that_are_not_there(samples):
    with pytest.raises(InvalidValueError):
        Recording(time=TIME, measured=FORCE)[samples]


def test_description():
    recording = Recording(time=TIME, measured=FORCE, simulated=FORCE, covariates={"opening": TIME})
    assert repr(recording) == (
        "Recording(2 pads of 2x3 taxels, 5 samples, 0.4 s at 10.0 Hz, 1 episode, measured, simulated, "
        "covariates opening)"
    )
    assert "1 sample, 0.0 s, 1 episode, simulated" in repr(Recording(time=[1], simulated=FORCE[:1]))
