"""`paxisim.diagnose` from the recording to the files, and its errors for unusable recordings."""

import dataclasses
import errno
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from recorded import diagnosed, names, small

import paxisim
import paxisim.diagnose as package
from paxisim.augment.chain import Chain
from paxisim.diagnose import Diagnosis
from paxisim.diagnose.pipeline import diagnose
from paxisim.diagnose.result import Interval
from paxisim.errors import InvalidValueError, UnknownNameError

CAUSES = ("axis_gain", "rotation", "latency")


def recording(*causes, seed=3, **options):
    return small(*causes, seed=seed, **{"duration": 5.0, **options})


@pytest.fixture(scope="module")
def plain():
    return recording()


@pytest.fixture(scope="module")
def turned():
    return recording("rotation", strength=0.9)


@pytest.fixture(scope="module")
def rotated(turned):
    return diagnose(turned, CAUSES, seed=1)


def test_the_cause_is_named_with_its_gain_and_its_parameters(rotated, turned):
    assert names(rotated) == ["rotation"]
    (cause,) = rotated.causes
    assert {p.name for p in cause.parameters} == {f"about_{axis}_{pad}" for axis in "xyz" for pad in (0, 1)}
    for interval in (cause.gain, *(p.value for p in cause.parameters)):
        assert interval.low <= interval.value <= interval.high
    assert rotated.heldout.nrmse_after < 0.7 * rotated.heldout.nrmse_before
    assert rotated.heldout.noise_floor < rotated.heldout.nrmse_before
    assert rotated.heldout.explained.value > 0.5
    assert len(rotated.heldout.gain_per_episode) == 8
    assert 0 <= rotated.confidence["rotation"] <= 1
    assert rotated.not_testable["creep"] == "not asked for"
    # the model brings the simulation nearer to the measurement
    extended = rotated.model.run(turned.simulated.astype(float), turned.time, turned.covariates)
    before = np.mean((turned.measured - turned.simulated) ** 2)
    assert np.mean((turned.measured - extended) ** 2) < 0.5 * before
    # the table fits a terminal
    lines = str(rotated).splitlines()
    assert lines[0] == f"Verdict: {rotated.verdict}"
    assert max(map(len, lines)) <= 80
    assert any(line.startswith("rotation") for line in lines)


def test_the_answer_is_the_same_each_time_and_for_any_number_of_processors(rotated, turned):
    assert diagnose(turned, CAUSES, seed=1, jobs=2).to_json() == rotated.to_json()


def test_files_hold_the_fields_by_name_and_come_back(rotated, tmp_path):
    rotated.save(tmp_path / "out")
    text = (tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8")
    document = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert document.pop("format") == "paxisim-diagnosis/1"
    fields = [field.name for field in dataclasses.fields(Diagnosis)]
    assert list(document) == [name for name in fields if name not in ("streams", "scene")]
    assert Diagnosis.load(tmp_path / "out").to_json() == rotated.to_json()
    assert str(Diagnosis.load(tmp_path / "out")) == str(rotated)
    assert Chain.load(tmp_path / "out" / "model.json").to_json() == rotated.model.to_json()
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["diagnosis.json", "model.json", "report.html"]
    odd = dataclasses.replace(rotated, confidence={"rotation": math.nan})
    assert json.loads(odd.to_json())["confidence"] == {"rotation": None}


def test_other_text_is_no_diagnosis_and_errors_name_the_file(rotated, tmp_path):
    for text in ("", "[]", '{"format": "paxisim-diagnosis/2"}', '{"format": "paxisim-diagnosis/1"}'):
        with pytest.raises(InvalidValueError):
            Diagnosis.from_json(text)
    unknown = rotated.to_json().replace(f'"verdict": "{rotated.verdict}"', '"verdict": "guilty"')
    for content, words in (
        (b"\xff", "expected UTF-8 text"),
        (b"{", "not JSON"),
        (unknown.encode(), "verdict must be one of no_discrepancy, clocks_differ, .*, got 'guilty'"),
    ):
        (tmp_path / "diagnosis.json").write_bytes(content)
        with pytest.raises(InvalidValueError, match=rf"diagnosis\.json: .*{words}"):
            Diagnosis.load(tmp_path)


def test_a_full_disk_leaves_no_part_of_a_diagnosis(rotated, tmp_path, monkeypatch):
    def full(self, *_, **__):
        if ".model.json" not in self.name:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return 0

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", full)
        patch.setattr(os, "replace", lambda a, b: Path(b).touch())
        with pytest.raises(OSError, match=r"No space left on device: '.*diagnosis\.json'"):
            rotated.save(tmp_path / "a")
    assert not (tmp_path / "a").exists()


def test_the_model_of_a_diagnosis_is_in_its_folder(rotated, tmp_path):
    rotated.save(tmp_path / "a")
    (tmp_path / "a" / "fitted_scene.toml").write_text('mjcf = "../b.xml"\n[[drive]]\nstream = "z"\njoint = "z"\n')
    with pytest.raises(InvalidValueError, match="must name an MJCF in its own folder"):
        Diagnosis.load(tmp_path / "a")


def test_the_error_of_dead_taxels_lives_where_they_are():
    dead = diagnosed(recording("dead_taxels", strength=0.6), ("dead_taxels", "axis_gain"))
    assert names(dead) == ["dead_taxels"]
    gone = np.argwhere(np.asarray(dead.model["dead_taxels"].dead) + np.asarray(dead.model["dead_taxels"].stuck))
    worst = {place.where: place for place in dead.symptoms.taxels[: len(gone)]}
    assert worst.keys() == {f"pad{p} ({r}, {c})" for p, r, c in gone}
    assert all(place.after < 0.1 * place.before for place in worst.values())
    assert sum(place.after for place in dead.symptoms.axes) < 0.05


@pytest.mark.parametrize(
    ("hidden", "options", "causes", "left"),
    [
        ("hum", {"strength": 0.8}, CAUSES, ""),
        ("gain_control", {"strength": 0.5, "seed": 5, "duration": 9.0}, ("stiffening", "axis_gain", "creep"), "total"),
    ],
)
def test_what_is_outside_the_vocabulary_is_not_explained(hidden, options, causes, left):
    found = diagnosed(recording(hidden, **options), causes)
    assert found.verdict in ("unexplained", "partly_explained")
    assert any(left in item.what for item in found.symptoms.left_over)
    assert any("unexplained residual" in line for line in found.advice)
    assert found.symptoms.reasons[0] == "The residual has structure."


def changed(given, **streams):
    return dataclasses.replace(given, **streams)


def shifted(given):
    """Return the recording with one stream in its first half only and the other in its second."""
    measured, simulated = given.measured.copy(), given.simulated.copy()
    measured[: len(given) // 2], simulated[len(given) // 2 :] = np.nan, np.nan
    return changed(given, measured=measured, simulated=simulated)


def scaled(given, measured=1.0, simulated=1.0):
    return changed(given, measured=given.measured * measured, simulated=given.simulated * simulated)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda given: changed(given, measured=None), "no measured tensor"),
        (lambda given: changed(given, simulated=None), "no simulated tensor"),
        (shifted, "do not overlap"),
        (lambda given: changed(given, measured=np.full_like(given.measured, np.nan)), "NaN at every sample"),
        (lambda given: changed(given, time=np.floor(given.time)), "8 of 8 episodes .* repeat the previous time"),
        (lambda given: changed(given, measured=np.full_like(given.measured, 0.5)), "measured is constant"),
        (lambda given: changed(given, simulated=np.full_like(given.measured, 0.5)), "simulated is constant"),
        (lambda given: scaled(given, 1000.0), r"measured is 1e\+03[.\d]* times simulated: both must be in newtons"),
        (lambda given: scaled(given, -10.0), r"measured is 10[.\d]* times simulated: both must be in newtons"),
        (lambda given: scaled(given, 0.1), r"measured is 0\.1[.\d]* times simulated: both must be in newtons"),
        (lambda given: scaled(given, 1000.0, 1000.0), r"N on a taxel, but 0\.01 to 1000 N were expected"),
        (lambda given: scaled(given, 0.001, 0.001), r"N on a taxel, but 0\.01 to 1000 N were expected"),
        (
            lambda given: changed(given, measured=np.random.default_rng(0).normal(0, 0.02, given.measured.shape)),
            "no signal",
        ),
        (lambda given: given[:30], "too short"),
        (lambda given: np.zeros(3), "Recording"),
    ],
)
def test_a_recording_that_cannot_be_diagnosed_is_refused(plain, spoil, words):
    with pytest.raises(InvalidValueError, match=words):
        diagnosed(spoil(plain))


def test_arguments_are_checked(plain):
    for wrong in ({"causes": "creep"}, {"jobs": 0}, {"jobs": 1.5}, {"seed": -1}, {"seed": 0.5}):
        with pytest.raises(InvalidValueError):
            diagnosed(plain, **wrong)
    with pytest.raises(UnknownNameError, match="creep"):
        diagnosed(plain, ["crep"])
    assert callable(package), "the package is the function"
    assert "creep" in package.known_causes()


def test_samples_with_nan_and_one_episode_are_told(plain):
    measured = plain.measured.copy()
    measured[50:60] = np.nan
    covariates = {**plain.covariates, "temperature": np.where(np.arange(len(plain)) < 9, np.nan, 25.0)}
    found = diagnosed(changed(plain, measured=measured, covariates=covariates), ("axis_gain",))
    assert (found.verdict, found.causes, len(found.model)) == ("no_discrepancy", (), 0)
    assert any("NaN" in warning for warning in found.symptoms.warnings)
    assert any("'temperature' is missing" in warning for warning in found.symptoms.warnings)
    time = np.arange(len(plain)) / plain.rate
    found = diagnosed(changed(plain, time=time, episode=np.zeros(len(plain))), ("axis_gain",))
    assert any("was split into" in warning for warning in found.symptoms.warnings), "cut where the pads are free"


@pytest.mark.slow
def test_a_time_stamp_that_comes_twice_and_clocks_that_begin_at_0_change_nothing_of_note(rotated, turned):
    twice = turned.time.copy()
    twice[101] = twice[100]
    begins = turned.time[np.searchsorted(turned.episode, turned.episode)]
    for time in (twice, turned.time - begins):
        found = diagnosed(changed(turned, time=time), (*CAUSES, "drift"), seed=1)
        assert names(found) == ["rotation"]
        assert found.heldout.nrmse_after == pytest.approx(rotated.heldout.nrmse_after, rel=0.01)
    assert "on one clock" in found.not_testable["drift"]


def test_a_copy_is_told_and_is_no_discrepancy(plain, tmp_path):
    found = diagnosed(changed(plain, measured=plain.simulated), ("axis_gain",))
    assert found.verdict == "no_discrepancy"
    assert found.heldout.explained is None
    assert any("a copy" in warning for warning in found.symptoms.warnings)
    assert "nan" not in str(found)
    found.save(tmp_path)
    assert str(Diagnosis.load(tmp_path)) == str(found)
    assert "Where the error is" not in found.report()


def test_an_episode_that_is_in_the_recording_twice_counts_once(rotated, turned):
    first = next(turned.episodes())
    again = changed(first, time=first.time + turned.time[-1] + 5 - first.time[0])
    found = diagnose(paxisim.Recording.concatenate([turned, again]), CAUSES, seed=1)
    assert "episode 8 is an exact copy of episode 0 and was left out" in found.symptoms.warnings
    assert found.causes == rotated.causes
    assert found.heldout == rotated.heldout


def test_one_short_press_gives_no_certainty(turned):
    found = diagnosed(next(turned.episodes()), CAUSES)
    assert found.verdict == "ambiguous"
    assert not any(item.rivals for item in found.causes)
    text = " ".join(str(found).split())
    assert "Perhaps explained by rotation (" in text
    assert "A single episode cannot confirm a cause." in text
    assert "tell the rivals apart" not in text
    assert "Episode 1 was split into blocks that were held out in turn." in found.heldout.note
    warnings = found.symptoms.warnings
    assert any(line.startswith("the recording has one episode") for line in warnings)
    assert any(line.startswith(("the recording has only 5", "the recording has only 4")) for line in warnings)


def test_an_interval_reads_well():
    assert str(Interval(0.12345, 0.1, 0.15)) == "0.123 [0.1, 0.15]"
    assert str(Interval(2.0)) == "2"
