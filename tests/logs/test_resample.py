"""Streams of different rates resampled onto one time axis."""

import numpy as np
import pytest
from log_files import MS, START, counts, refused

from paxisim.errors import UnknownNameError
from paxisim.logs.mcap_writer import LogWriter
from paxisim.logs.resample import resample, resample_log
from paxisim.logs.stream import Log, Stream
from paxisim.recording import Recording


def stream(times_ms, values) -> Stream:
    return Stream(START + np.round(np.asarray(times_ms) * MS).astype(np.int64), np.asarray(values, dtype=np.float64))


def at(times_ms) -> np.ndarray:
    return stream(times_ms, times_ms).nanoseconds


NAN = float("nan")
RAMP = stream([0, 10, 20, 30, 130, 140], [0, 1, 2, 3, 13, 14])


@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("linear", [NAN, 0, 0.4, 0.6, 1, NAN, 13.5, 14, NAN]),
        ("nearest", [NAN, 0, 0, 1, 1, NAN, 13, 14, NAN]),
        ("previous", [NAN, 0, 0, 0, 1, NAN, 13, 14, NAN]),
    ],
)
def test_nothing_is_made_up_before_after_and_in_gaps(method, expected):
    found = resample(RAMP, at([-1, 0, 4, 6, 10, 60, 135, 140, 141]), method, max_gap=None)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_greatest_gap_is_chosen():
    assert resample(RAMP, at([60]), "linear", max_gap=0.1).tolist() == [6.0]
    assert np.isnan(resample(RAMP, at([60]), "linear", max_gap=0.0999)).all()
    assert np.isnan(resample(RAMP, at([5]), "linear", max_gap=0.0099)).all()


def test_linear_on_many_samples_is_numpys():
    rng = np.random.default_rng(0)
    times = np.sort(rng.uniform(0, 30_000, 9000))
    values = rng.normal(size=(9000, 2))
    wanted = np.sort(rng.uniform(times[0], times[-1], 10_000))
    found = resample(stream(times, values), at(wanted), "linear", max_gap=10)
    for i in range(2):
        expected = np.interp(at(wanted) - START, at(times) - START, values[:, i])
        np.testing.assert_allclose(found[:, i], expected, atol=1e-6)


def test_two_samples_at_one_time_and_a_single_one():
    twice = stream([0, 10, 10, 20], [0, 1, 5, 6])
    assert resample(twice, at([5, 10, 15]), "linear", None).tolist() == [0.5, 5, 5.5]
    np.testing.assert_array_equal(resample(stream([5], [3.0]), at([4, 5, 6]), "linear", None), [NAN, 3, NAN])


def write(path, simulated_ms=None, temperature_ms=None, marks=()):
    """Write a measured stream, every 10 ms for 0.5 s, and streams whose values are their times in ms."""
    with LogWriter(path, {}) as log:
        for number, ms in marks:
            log.write_at("episode", START + ms * MS, number)
        for i, force in enumerate(counts(50)):
            log.write_at("measured", START + i * 10 * MS, force)
        for ms in simulated_ms if simulated_ms is not None else ():
            log.write_at("simulated", START + int(ms * MS), np.full((2, 3, 4, 3), ms))
        for ms in temperature_ms if temperature_ms is not None else ():
            log.write_at("covariate/temperature", START + int(ms * MS), ms)


def test_streams_of_other_rates_come_to_the_times_of_the_measured_one(tmp_path):
    write(tmp_path / "a.mcap", np.arange(-5, 600, 4), np.arange(95, 400, 100))
    recording = Recording.load(tmp_path / "a.mcap")
    np.testing.assert_array_equal(recording.measured, counts(50))
    np.testing.assert_allclose(recording.simulated[:, 1, 2, 3, 2], np.arange(50) * 10, rtol=1e-6)
    temperature = recording.covariates["temperature"]
    assert np.flatnonzero(~np.isnan(temperature)).tolist() == list(range(10, 40))
    np.testing.assert_allclose(temperature[10:40], np.arange(100, 400, 10))
    dropped = Recording.load(tmp_path / "a.mcap", missing="drop")
    np.testing.assert_allclose(dropped.covariates["temperature"], np.arange(100, 400, 10))
    assert dropped.time[0] == pytest.approx(0.1)


def test_each_stream_may_have_its_own_method(tmp_path):
    write(tmp_path / "a.mcap", np.arange(-5, 600, 4), np.arange(95, 400, 100))
    held = Recording.load(tmp_path / "a.mcap", align={"temperature": "previous"})
    assert np.unique(held.covariates["temperature"][10:40]).tolist() == [95, 195, 295]
    np.testing.assert_allclose(held.simulated[:, 0, 0, 0, 0], np.arange(50) * 10, rtol=1e-6)
    with pytest.raises(UnknownNameError, match="unknown stream to align 'temprature'; did you mean 'temperature'"):
        Recording.load(tmp_path / "a.mcap", align={"temprature": "previous"})
    path = tmp_path / "a.mcap"
    for wrong in ("cubic", {"simulated": "cubic"}):
        refused(path, "align must be one of linear, nearest, previous, got 'cubic'", align=wrong)
    refused(path, "max_gap must be a positive time", max_gap=-1)
    refused(path, "missing must be", missing="keep")


def test_streams_that_do_not_overlap_or_whose_gap_is_too_small_are_named(tmp_path):
    path = tmp_path / "a.mcap"
    write(path, np.arange(1000, 1100, 10))
    refused(path, "simulated is not known at any time of measured: it has 10 samples from 1.000 s to 1.090 s, measured")
    path.unlink()
    write(path, temperature_ms=[2000])
    with pytest.warns(UserWarning, match="covariate/temperature is not known at any time"):
        recording = Recording.load(path)
    assert np.isnan(recording.covariates["temperature"]).all()
    with pytest.warns(UserWarning, match="not known"):
        refused(path, "no sample is left", missing="drop")
    path.unlink()
    write(path, temperature_ms=[95, 195, 295])
    words = r"temperature is not known .* from 0.095 s to 0.295 s.*more than 0.05 s apart are not known \(max_gap\)"
    with pytest.warns(UserWarning, match=words):
        Recording.load(path, max_gap=0.05)


def in_bursts(seconds=5.0):
    """Return arrival times (ms) of 100 Hz lines from a program that flushes 110 at once, some after a stall."""
    late = np.where(np.arange(110) == 60, 5.0, 0.02).cumsum()
    return np.concatenate([start + late for start in np.arange(0, seconds * 1000, 1100)])


def test_what_comes_in_bursts_is_known_between_them_with_a_warning(tmp_path):
    with LogWriter(tmp_path / "a.mcap", {}) as log:
        for i in range(50):
            log.write_at("measured", START + i * 100 * MS, counts(1)[0])
        for i, ms in enumerate(in_bursts()):
            log.write_at("covariate/opening", START + int(ms * MS), i)
    with pytest.warns(UserWarning, match=r"opening came in bursts, 1.1 s apart.*buffers its output; let it flush"):
        opening = Recording.load(tmp_path / "a.mcap").covariates["opening"]
    assert np.isfinite(opening[1:45]).all()
    assert np.all(np.abs(opening[1:45] - 10 * np.arange(1, 45)) <= 110)  # late by at most one burst


def test_a_pause_is_a_gap_also_where_samples_come_fast():
    fast = np.concatenate([np.arange(0, 1000, 0.2), np.arange(5000, 6000, 0.2)])
    found = resample(stream(fast, fast), at([500.1, 1100, 4900, 5500.1]), "linear", None)
    assert np.isnan(found).tolist() == [False, True, True, False]
    long = np.concatenate([in_bursts(), 60_000 + in_bursts()])
    found = resample(stream(long, long), at([1000, 30_000]), "linear", None)
    assert np.isnan(found).tolist() == [False, True]


def test_episodes_begin_at_their_marks(tmp_path):
    write(tmp_path / "a.mcap", marks=[(7, 5), (8, 100), (9, 200)])
    recording = Recording.load(tmp_path / "a.mcap")
    assert recording.episode.tolist() == [7] * 10 + [8] * 10 + [9] * 30
    assert recording.time[10] == 0.1
    write(tmp_path / "b.mcap", marks=[(0, 0), (1, 100), (0, 200)])
    assert Recording.load(tmp_path / "b.mcap").episode.tolist() == [0] * 10 + [1] * 10 + [2] * 30
    write(tmp_path / "c.mcap")
    assert Recording.load(tmp_path / "c.mcap").episode.tolist() == [0] * 50


def test_simulated_alone_gives_the_time_axis():
    force = counts(3)
    log = Log({"simulated": Stream(START + np.array([0, 5, 9]), force)})
    found = resample_log(log)
    assert found.measured is None
    assert found.simulated is force
    assert found.time.tolist() == [0, 5e-9, 9e-9]
