"""Streams of different motions are told from streams of one motion, and shifted clocks from a late sensor."""

import re
from dataclasses import replace

import numpy as np
import pytest
from recorded import EFFECTS, OUTSIDERS, diagnosed, names, small

from paxisim.cli import main
from paxisim.diagnose.data.correspondence import correspondence_of
from paxisim.diagnose.data.prepare import prepare
from paxisim.recording import Recording

STRONG = 0.95


def frames_of(recording):
    return [np.flatnonzero(recording.episode == number) for number in np.unique(recording.episode)]


def unrelated(seed=0):
    """Return a recording with noise in place of both streams."""
    recording, rng = small(seed=seed), np.random.default_rng(seed)
    streams = {name: rng.standard_normal(recording.measured.shape) for name in ("measured", "simulated")}
    return replace(recording, **{name: values.astype(np.float32) for name, values in streams.items()})


def shuffled(seed=0):
    """Return a recording whose measured episodes are permuted."""
    recording = small(seed=seed)
    frames = frames_of(recording)
    least = min(map(len, frames))
    order = np.roll(np.arange(len(frames)), 1 + seed)
    kept = np.concatenate([own[:least] for own in frames])
    measured = np.concatenate([recording.measured[frames[number][:least]] for number in order])
    return replace(recording[kept], measured=measured)


def late(seconds, *causes, seed=1, **options):
    """Return a recording whose measured stream is late by `seconds`."""
    recording = small(*causes, seed=seed, duration=max(6.0, 3.5 * seconds), **options)
    frames, by = frames_of(recording), round(seconds * 20)
    kept = np.concatenate([own[by:] for own in frames])
    then = np.concatenate([own[:-by] for own in frames])
    return replace(recording[kept], measured=recording.measured[then])


def test_episodes_keep_the_recordings_own_numbers():
    at, heights = np.arange(200) / 20, np.random.default_rng(0).uniform(1, 4, (4, 5))
    knots = [0, 0.7, 2.1, 3, 3.9, 5.2, 5.9, 6.8, 8.2, 8.7, 10]
    presses = [np.interp(at, knots, [0, *np.ravel([(h, 0) for h in own])]) for own in heights]
    simulated, measured = (np.concatenate(own) for own in (presses, np.roll(presses, 1, axis=0)))
    episode = np.repeat([505, 506, 507, 508], 200)
    ones = np.ones((1, 3, 2, 2))
    mixed = Recording(
        np.tile(at, 4), np.multiply.outer(measured, ones), np.multiply.outer(simulated, ones), episode=episode
    )
    numbers = re.findall(r"episode (\d+)", correspondence_of(mixed).why)
    assert len(numbers) == 2
    assert {int(number) for number in numbers} <= {505, 506, 507, 508}
    plain = small(seed=0)
    time = plain.time + np.where(np.arange(len(plain)) >= 30, 5.0, 0.0)  # a gap in the first episode
    time[plain.episode > 0] = plain.time[plain.episode > 0]
    measured = plain.measured.copy()
    measured[30] = np.nan
    gap, warnings = prepare(replace(plain, time=time, measured=measured, episode=plain.episode + 500))
    new = 500 + int(plain.episode.max()) + 1
    assert np.unique(gap.episode).tolist() == [*range(500, new), new]
    assert f"episode {new} is the part of episode 500 from" in " ".join(warnings)


@pytest.mark.parametrize(("make", "seed"), [(unrelated, 0), (shuffled, 0), (shuffled, 2)])
def test_streams_of_different_motions_are_unrelated(make, seed):
    found = diagnosed(make(seed))
    assert found.verdict == "unrelated"
    assert not found.causes
    assert not len(found.model)
    assert "clocks" in found.advice[0]
    assert "not of the same motion" in str(found)
    assert type(found).from_json(found.to_json()).verdict == "unrelated"


@pytest.mark.parametrize("family", [pytest.param("development", marks=pytest.mark.slow), "final"])
def test_no_effect_of_a_sensor_is_taken_for_another_motion_or_another_clock(family):
    for name in (*EFFECTS, *OUTSIDERS):
        found = correspondence_of(small(name, seed=1, strength=STRONG, family=family))
        assert not found.why, name
        assert not found.clocks_apart, name


@pytest.mark.parametrize("seconds", [0.8, 5.0])
def test_clocks_that_are_apart_are_aligned_before_anything_is_named(seconds):
    found = diagnosed(late(seconds, "taxel_gain", strength=0.8), ("taxel_gain", "axis_gain", "latency", "offset"))
    assert names(found) == ["taxel_gain"]
    (warning,) = [w for w in found.symptoms.warnings if "clocks" in w]
    assert f"{seconds:.1f}" in warning
    assert f"Verdict: {found.verdict}, clocks differ by {seconds:.1f}" in str(found)
    again = type(found).from_json(found.to_json())
    assert again.clock_shift == pytest.approx(seconds, abs=0.03)


def test_streams_that_agree_once_their_clocks_are_aligned_are_not_without_discrepancy():
    found = diagnosed(late(0.8), ("axis_gain",))
    assert found.verdict == "clocks_differ"
    assert "Verdict: clocks_differ, clocks differ by 0.8" in str(found)


def test_a_sensor_that_is_late_has_no_other_clock():
    for seconds in (0.1, 0.3):
        found = correspondence_of(late(seconds))
        assert not found.clocks_apart
        assert found.shift == pytest.approx(seconds, abs=0.02)


def test_the_shell_says_so_with_status_1_and_writes_no_model(tmp_path, capsys):
    recording = unrelated()
    recording.save(tmp_path / "noise.npz")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "model.json").write_text("of an earlier run")
    status = main(["diagnose", str(tmp_path / "noise.npz"), "-o", str(tmp_path / "out"), "--force"])
    assert status == 1
    assert "Verdict: unrelated" in capsys.readouterr().out
    assert not (tmp_path / "out" / "model.json").exists()
    page = (tmp_path / "out" / "report.html").read_text()
    assert "not of the same motion" in page
    assert "model.json" not in page
