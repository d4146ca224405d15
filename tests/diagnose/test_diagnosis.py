"""`paxisim.diagnose` from the recording to the files, and its errors for unusable recordings."""

import dataclasses
import errno
import json
import math
import os
import sys
from pathlib import Path

import numpy as np
import pytest

import paxisim.diagnose as package
from paxisim.augment.chain import Chain
from paxisim.diagnose import Diagnosis
from paxisim.diagnose.advice import advice
from paxisim.diagnose.diagnosis import Interval
from paxisim.diagnose.run import diagnose
from paxisim.diagnose.vocabulary import cause, known_causes
from paxisim.errors import InvalidValueError, UnknownNameError

sys.path.insert(0, str(Path(__file__).parents[1]))
from hidden.cases import make
from recorded import diagnosed, recording_of

CAUSES = ("axis_gain", "rotation", "latency")


def recording(causes=(), seed=3, **options):
    case = make(causes, seed=seed, **{"rows": 4, "cols": 3, "duration": 5.0, "rate": 20, **options})
    return recording_of(case)


@pytest.fixture(scope="module")
def rotated():
    return diagnose(recording(("rotation",), strength=0.9), CAUSES, seed=1)


def test_the_cause_is_named_with_its_gain_and_its_parameters(rotated):
    assert [cause.name for cause in rotated.causes] == ["rotation"]
    (cause,) = rotated.causes
    assert [(p.name, p.value.low <= p.value.value <= p.value.high) for p in cause.parameters] == [
        ("about_x", True),
        ("about_y", True),
        ("about_z", True),
    ]
    assert cause.gain.low <= cause.gain.value <= cause.gain.high
    assert rotated.heldout.nrmse_after < 0.7 * rotated.heldout.nrmse_before
    assert rotated.heldout.noise_floor < rotated.heldout.nrmse_before
    assert rotated.heldout.explained.value > 0.5
    assert len(rotated.heldout.gain_per_episode) == 8
    assert 0 <= rotated.confidence["rotation"] <= 1
    assert rotated.not_testable["creep"] == "not asked for"


def test_the_answer_is_the_same_each_time_and_for_any_number_of_processors(rotated):
    assert diagnose(recording(("rotation",), strength=0.9), CAUSES, seed=1, jobs=2).to_json() == rotated.to_json()


def test_the_model_brings_the_simulation_nearer_to_the_measurement(rotated):
    given = recording(("rotation",), strength=0.9)
    assert isinstance(rotated.model, Chain)
    extended = rotated.model.run(given.simulated.astype(float), given.time, given.covariates)
    before = np.mean((given.measured - given.simulated) ** 2)
    assert np.mean((given.measured - extended) ** 2) < 0.5 * before


def test_the_table_fits_a_terminal(rotated):
    lines = str(rotated).splitlines()
    assert lines[0] == f"Verdict: {rotated.verdict}"
    assert max(map(len, lines)) <= 80
    assert any(line.startswith("rotation") for line in lines)


def test_files_hold_the_fields_by_name_and_come_back(rotated, tmp_path):
    rotated.save(tmp_path / "out")
    text = (tmp_path / "out" / "diagnosis.json").read_text(encoding="utf-8")
    document = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert document.pop("format") == "paxisim-diagnosis/1"
    assert list(document) == [
        field.name for field in dataclasses.fields(Diagnosis) if field.name not in ("streams", "scene")
    ]
    assert Diagnosis.load(tmp_path / "out").to_json() == rotated.to_json()
    assert str(Diagnosis.load(tmp_path / "out")) == str(rotated)
    assert Chain.load(tmp_path / "out" / "model.json").to_json() == rotated.model.to_json()
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["diagnosis.json", "model.json", "report.html"]


def test_json_has_no_nan(rotated):
    odd = dataclasses.replace(rotated, confidence={"rotation": math.nan})
    assert json.loads(odd.to_json())["confidence"] == {"rotation": None}


@pytest.mark.parametrize("text", ["", "[]", '{"format": "paxisim-diagnosis/2"}', '{"format": "paxisim-diagnosis/1"}'])
def test_other_text_is_no_diagnosis(text):
    with pytest.raises(InvalidValueError):
        Diagnosis.from_json(text)


def test_errors_name_the_file_of_a_diagnosis(rotated, tmp_path):
    path = tmp_path / "diagnosis.json"
    unknown = rotated.to_json().replace(f'"verdict": "{rotated.verdict}"', '"verdict": "guilty"')
    for content, words in (
        (b"\xff", "expected UTF-8 text"),
        (b"{", "not JSON"),
        (unknown.encode(), "verdict must be one of no_discrepancy, clocks_differ, .*, got 'guilty'"),
    ):
        path.write_bytes(content)
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
    rotated.save(tmp_path / "a")


def test_the_model_of_a_diagnosis_is_in_its_folder(rotated, tmp_path):
    rotated.save(tmp_path / "a")
    (tmp_path / "a" / "fitted_scene.toml").write_text('mjcf = "../b.xml"\n[[drive]]\nstream = "z"\njoint = "z"\n')
    with pytest.raises(InvalidValueError, match="must name an MJCF in its own folder"):
        Diagnosis.load(tmp_path / "a")


def test_nothing_is_named_where_nothing_is_hidden():
    found = diagnosed(recording(), CAUSES)
    assert (found.verdict, found.causes, len(found.model)) == ("no_discrepancy", (), 0)


@pytest.fixture(scope="module")
def dead():
    return diagnosed(recording(("dead_taxels",), strength=0.6), ("dead_taxels", "axis_gain"))


def test_the_error_of_dead_taxels_lives_where_they_are(dead):
    assert [cause.name for cause in dead.causes] == ["dead_taxels"]
    gone = np.argwhere(np.asarray(dead.model["dead_taxels"].dead) + np.asarray(dead.model["dead_taxels"].stuck))
    worst = {place.where: place for place in dead.symptoms.taxels[: len(gone)]}
    assert worst.keys() == {f"pad{p} ({r}, {c})" for p, r, c in gone}
    assert all(place.after < 0.1 * place.before for place in worst.values())
    assert sum(place.after for place in dead.symptoms.axes) < 0.05


def test_what_is_outside_the_vocabulary_is_not_explained():
    found = diagnosed(recording(("hum",), strength=0.8), CAUSES)
    assert found.verdict in ("unexplained", "partly_explained")
    assert found.symptoms.left_over
    assert any("unexplained residual" in line for line in found.advice)


def test_gain_control_is_not_called_stiffening():
    given = recording(("gain_control",), strength=0.5, seed=5, duration=9.0)
    found = diagnosed(given, ("stiffening", "axis_gain", "creep"))
    assert found.verdict in ("unexplained", "partly_explained")
    assert any("total force" in item.what for item in found.symptoms.left_over)


def test_a_stream_must_be_there():
    given = recording()
    for name in ("measured", "simulated"):
        with pytest.raises(InvalidValueError, match=f"no {name} tensor"):
            diagnosed(dataclasses.replace(given, **{name: None}))


def test_streams_must_overlap_in_time():
    given = recording()
    measured, simulated = given.measured.copy(), given.simulated.copy()
    half = len(given) // 2
    measured[:half], simulated[half:] = np.nan, np.nan
    with pytest.raises(InvalidValueError, match="do not overlap"):
        diagnosed(dataclasses.replace(given, measured=measured, simulated=simulated))
    measured[:] = np.nan
    with pytest.raises(InvalidValueError, match="NaN at every sample"):
        diagnosed(dataclasses.replace(given, measured=measured))


def test_samples_with_nan_are_left_out_and_said():
    given = recording()
    measured = given.measured.copy()
    measured[50:60] = np.nan
    covariates = {**given.covariates, "temperature": np.where(np.arange(len(given)) < 9, np.nan, 25.0)}
    found = diagnosed(dataclasses.replace(given, measured=measured, covariates=covariates), ("axis_gain",))
    assert any("NaN" in warning for warning in found.symptoms.warnings)
    assert any("'temperature' is missing" in warning for warning in found.symptoms.warnings)


def test_a_time_stamp_that_comes_twice_changes_nothing_of_note(rotated):
    given = recording(("rotation",), strength=0.9)
    time = given.time.copy()
    time[101] = time[100]
    found = diagnosed(dataclasses.replace(given, time=time), CAUSES, seed=1)
    assert [cause.name for cause in found.causes] == ["rotation"]
    assert found.heldout.nrmse_after == pytest.approx(rotated.heldout.nrmse_after, rel=0.01)


def test_time_must_go_on():
    given = recording()
    with pytest.raises(InvalidValueError, match="8 of 8 episodes most samples repeat the previous time stamp"):
        diagnosed(dataclasses.replace(given, time=np.floor(given.time)))


def test_episodes_may_each_begin_at_0(rotated):
    given = recording(("rotation",), strength=0.9)
    begins = given.time[np.searchsorted(given.episode, given.episode)]
    found = diagnosed(dataclasses.replace(given, time=given.time - begins), (*CAUSES, "drift", "stiffening"), seed=1)
    assert [cause.name for cause in found.causes] == ["rotation"]
    assert "on one clock" in found.not_testable["drift"]
    assert found.heldout.nrmse_after == pytest.approx(rotated.heldout.nrmse_after, rel=0.01)


@pytest.mark.parametrize("name", ["measured", "simulated"])
def test_signals_must_change(name):
    given = recording()
    with pytest.raises(InvalidValueError, match=f"{name} is constant"):
        diagnosed(dataclasses.replace(given, **{name: np.full_like(given.measured, 0.5)}))


@pytest.mark.parametrize(
    ("scale", "said"),
    [(1000.0, r"1e\+03"), (10.0, "10"), (-10.0, "10"), (0.1, r"0\.1"), (0.001, r"0\.001")],
)
def test_another_unit_is_told(scale, said):
    given = recording()
    with pytest.raises(InvalidValueError, match=rf"measured is {said}[.\d]* times simulated: both must be in newtons"):
        diagnosed(dataclasses.replace(given, measured=given.measured * scale))


@pytest.mark.parametrize("scale", [1000.0, 0.001])
def test_streams_that_are_both_in_another_unit_are_told(scale):
    given = recording()
    with pytest.raises(InvalidValueError, match=r"N on a taxel, but 0\.01 to 1000 N were expected"):
        diagnosed(dataclasses.replace(given, measured=given.measured * scale, simulated=given.simulated * scale))


def test_a_sensor_that_is_not_connected_is_told():
    given = recording()
    noise = 0.02 * np.random.default_rng(0).standard_normal(given.measured.shape)
    with pytest.raises(InvalidValueError, match="no signal"):
        diagnosed(dataclasses.replace(given, measured=noise))


def test_a_copy_is_told_and_is_no_discrepancy(tmp_path):
    given = recording()
    found = diagnosed(dataclasses.replace(given, measured=given.simulated), ("axis_gain",))
    assert found.verdict == "no_discrepancy"
    assert found.heldout.explained is None
    assert any("a copy" in warning for warning in found.symptoms.warnings)
    assert "nan" not in str(found)
    found.save(tmp_path)
    assert str(Diagnosis.load(tmp_path)) == str(found)
    assert "Where the error is" not in found.report()


def test_a_recording_must_last():
    with pytest.raises(InvalidValueError, match="too short"):
        diagnosed(recording()[:30])


def test_one_episode_is_cut_where_the_pads_are_free():
    given = recording()
    time = np.arange(len(given)) / given.rate
    found = diagnosed(dataclasses.replace(given, time=time, episode=np.zeros(len(given))), ("axis_gain",))
    assert any("was split into" in warning for warning in found.symptoms.warnings)


def test_one_short_press_gives_no_certainty():
    given = next(recording(("rotation",), strength=0.9).episodes())
    found = diagnosed(given, CAUSES)
    assert found.verdict == "ambiguous"
    assert not any(item.rivals for item in found.causes)
    assert "a single episode cannot confirm them" in " ".join(str(found).split())
    assert "so do their rivals" not in str(found)
    assert any(warning.startswith("the recording has one episode") for warning in found.symptoms.warnings)
    assert any(
        line.startswith(("the recording has only 5", "the recording has only 4")) for line in found.symptoms.warnings
    )


@pytest.mark.parametrize(
    "arguments",
    [{"causes": "creep"}, {"jobs": 0}, {"jobs": 1.5}, {"seed": -1}, {"seed": 0.5}],
    ids=["a string", "no jobs", "half a job", "a seed below 0", "half a seed"],
)
def test_arguments_are_checked(arguments):
    with pytest.raises(InvalidValueError):
        diagnosed(recording(), **arguments)


def test_only_recordings_and_known_causes():
    with pytest.raises(InvalidValueError, match="Recording"):
        diagnosed(np.zeros(3))
    with pytest.raises(UnknownNameError, match="creep"):
        diagnosed(recording(), ["crep"])


def test_advice_is_of_rivals_and_of_what_was_not_excited():
    lines = advice(
        [("hysteresis", ("creep",))],
        {"drift": "too short", "layout": "not asked for"},
        {name: cause(name).excites for name in known_causes()},
        unexplained=False,
        episodes=2,
    )
    assert lines[0].startswith("to separate hysteresis from creep: press and release in a triangle wave at three")
    assert any("8 episodes" in line for line in lines)
    assert any(line.startswith("to test for drift") for line in lines)
    assert not any("layout" in line for line in lines)


def test_an_interval_reads_well():
    assert str(Interval(0.12345, 0.1, 0.15)) == "0.123 [0.1, 0.15]"
    assert str(Interval(2.0)) == "2"


def test_the_package_is_the_function():
    assert callable(package)
    assert "creep" in package.known_causes()
    with pytest.raises(InvalidValueError, match="Recording"):
        package(None)  # type: ignore[operator]
