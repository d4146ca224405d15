"""Background: the field of another finger's magnets and of the earth is fitted to joint positions and subtracted."""

import json
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import paxisim
from paxisim.cli import main
from paxisim.errors import DeviceError, InvalidValueError, UnknownNameError

pytest.importorskip("magpylib", reason="needs magpylib; install the test extra")
from field_rig import NOISE, field, moving

NAMES = ("opening", "wrist")


@pytest.fixture(scope="module")
def free():
    return moving(0)


@pytest.fixture(scope="module")
def background(free):
    return paxisim.fit_background(free, NAMES)


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


@pytest.mark.parametrize("names", [NAMES, ("opening", "hand"), ("opening", "pose")])
def test_what_is_left_of_another_motion_is_what_is_printed(free, names):
    background = paxisim.fit_background(free, names)
    other = moving(1, drift=0)
    left = background.apply(other).measured.astype(float)
    left -= left.mean(axis=0)  # a drift of the first recording is no part of another
    said = float(re.search(r"after subtraction: ([\d.]+) uT", str(background))[1])
    assert said / 3 < rms(left) < 1.1 * said  # folds lack a fifth of the motion, and a matrix has nine values
    assert rms(left) < 1.5 * NOISE
    assert rms(background.before) > 100 * said
    assert rms(background.noise) == pytest.approx(NOISE, rel=0.05)


def test_a_drift_is_measured_and_left_in_the_channels():
    drifting = moving(0, drift=20)
    background = paxisim.fit_background(drifting, NAMES)
    left = background.apply(drifting).measured.astype(float)
    rise = left[-200:].mean(axis=0) - left[:200].mean(axis=0)
    np.testing.assert_allclose(np.abs(rise), background.drift, rtol=0.15, atol=0.5)
    assert rms(background.error) < 1.5 * NOISE


def test_a_file_gives_the_same_field_and_a_damaged_one_is_named(background, free, tmp_path):
    background.save(tmp_path / "background.json")
    again = paxisim.Background.load(tmp_path / "background.json")
    assert (str(again), repr(again), again.to_json()) == (str(background), repr(background), background.to_json())
    np.testing.assert_array_equal(again.field(free.covariates), background.field(free.covariates))
    good = json.loads(background.to_json())
    for number, (name, value) in enumerate([
        ("format", "paxisim-calibration/1"),
        ("covariates", ["opening"]),
        ("covariates", ["opening", "opening"]),
        ("sizes", [1, -1]),
        ("sizes", [1, 10**9]),
        ("low", good["high"]),
        ("bumps", []),
        ("bumps", [[0.0]] * 3),
        ("sharpness", None),
        ("weights", good["weights"][1:]),
        ("weights", "x"),
        ("used", [True]),
        ("used", [[[[False] * 5]] * 3]),
        ("error", [[[[None] * 5]] * 3]),
    ]):  # fmt: skip
        path = tmp_path / f"{number}.json"
        path.write_text(json.dumps(good | {name: value}))
        with pytest.raises(InvalidValueError, match=rf"{number}\.json"):
            paxisim.Background.load(path)


def test_unknown_covariates_give_unknown_channels_and_dead_channels_stay(free):
    holed = replace(free, covariates={name: free.covariates[name].copy() for name in NAMES})
    holed.covariates["opening"][100:200] = np.nan
    holed.measured[:, 0, 2, 0, 0] = np.nan
    background = paxisim.fit_background(holed, NAMES)
    assert background.used.sum() == 14
    left = background.apply(holed).measured
    assert np.isnan(left[100:200][:, background.used]).all()
    assert np.isfinite(np.delete(left[:, background.used], slice(100, 200), axis=0)).all()


def test_beyond_its_range_the_field_at_the_end_is_subtracted_with_a_warning(background):
    closed = {"opening": 0.0, "wrist": [0.0, 0.0]}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        at_the_end = background.field(closed)
    with pytest.warns(paxisim.BackgroundRangeWarning, match="'opening' leaves"):
        beyond = background.field(closed | {"opening": -0.02})
    np.testing.assert_allclose(beyond, at_the_end, atol=1.0)


def test_what_makes_a_background_doubtful_is_said(free):
    touched = replace(free, measured=free.measured.copy())
    touched.measured[1000:1050] += 300
    with pytest.warns(UserWarning, match="most at 2.* touched the sensor"):
        paxisim.fit_background(touched, NAMES)
    late = {name: np.roll(free.covariates[name], 5, axis=0) for name in NAMES}  # 100 ms later
    with pytest.warns(UserWarning, match="100 ms earlier than opening, wrist"):
        paxisim.fit_background(replace(free, covariates=late)[10:], NAMES)
    with pytest.warns(UserWarning, match="'heat' changes with time only"):
        paxisim.fit_background(replace(free, covariates={**free.covariates, "heat": free.time}), [*NAMES, "heat"])


@pytest.mark.parametrize(("names", "seconds"), [(["opening"], 60), (NAMES, 20)])
def test_too_few_covariates_or_too_short_a_motion_are_said(names, seconds):
    with pytest.warns(UserWarning, match="the motion is too short"):
        paxisim.fit_background(moving(0, seconds=seconds), names)


def test_what_cannot_be_fitted_or_subtracted_is_named(free, background):
    rng = np.random.default_rng(0)
    given = replace(
        free, covariates={**free.covariates, "still": np.ones(len(free)), "wide": rng.normal(size=(len(free), 17))}
    )
    for covariates, error, match in [
        ("still", InvalidValueError, "'still' does not change"),
        ("wide", InvalidValueError, "got 17"),
        (["opening", "opening"], InvalidValueError, "different covariates"),
        ([], InvalidValueError, "different covariates"),
        ("nothing", UnknownNameError, "nothing"),
    ]:
        with pytest.raises(error, match=match):
            paxisim.fit_background(given, covariates)
    unrelated = replace(free, covariates={"current": rng.normal(size=len(free))})
    with pytest.raises(InvalidValueError, match="current do not explain"):
        paxisim.fit_background(unrelated, "current")
    with pytest.raises(InvalidValueError, match="at least 100 samples"):
        paxisim.fit_background(free[:50], NAMES)
    with pytest.raises(InvalidValueError, match="already subtracted"):
        background.apply(background.apply(free))
    with pytest.raises(InvalidValueError, match="in uT, but this sensor's are in N"):
        background.apply(replace(free, metadata={}))
    with pytest.raises(UnknownNameError, match="opening"):
        background.field({"wrist": [0, 0]})
    with pytest.raises(InvalidValueError, match="'wrist' must have 2 values"):
        background.field({"opening": 0.02, "wrist": [0, 0, 0]})


@pytest.fixture(scope="module")
def pressed():
    """A recording under presses while the gripper moves, with the load."""
    recording = moving(2)
    load = 8 * np.clip(np.sin(2 * np.pi * 0.3 * recording.time), 0, None) ** 2
    gains = np.random.default_rng(3).normal(0, 20, recording.measured.shape[1:])
    measured = recording.measured + load.reshape(-1, 1, 1, 1, 1) * gains
    return replace(recording, measured=measured, covariates={**recording.covariates, "cell": load})


def test_a_calibration_subtracts_its_background_first(pressed, background, tmp_path):
    plain = paxisim.calibrate_sensor(pressed, {"Fz": "cell"})
    calibration = paxisim.calibrate_sensor(pressed, {"Fz": "cell"}, background=background)
    used = plain.readout.used & calibration.readout.used
    assert rms(calibration.readout.error[used]) < 0.01 * rms(plain.readout.error[used])
    assert rms(calibration.readout.error[used]) < 2 * NOISE
    calibration.save(tmp_path / "sensor.json")
    again = paxisim.Calibration.load(tmp_path / "sensor.json")
    assert str(again) == str(calibration)
    assert again.covariates == NAMES
    at = {name: pressed.covariates[name][700] for name in NAMES}
    force, total = again.read(pressed.measured[700], at)
    subtracted = background.apply(pressed)
    np.testing.assert_allclose(force, calibration.to_force(subtracted.measured[700]), atol=1e-4)
    assert total[0, 2] == pytest.approx(pressed.covariates["cell"][700], abs=0.2)
    older = json.loads(plain.to_json())
    del older["background"]
    assert paxisim.Calibration.from_document(older).to_json() == plain.to_json()


def test_the_verb_fits_subtracts_and_calibrates(free, pressed, tmp_path, capsys, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    free.save("free.mcap")
    pressed.save("press.mcap")
    fit = ["--background", "free.mcap", "--covariates", *NAMES]
    assert main(["calibrate", *fit, "-o", "background.json"]) == 0
    assert "after subtraction: 0." in capsys.readouterr().out
    assert main(["calibrate", "press.mcap", "--background", "background.json", "-o", "less.mcap"]) == 0
    less = paxisim.Recording.load("less.mcap")
    assert less.metadata["background"] == list(NAMES)
    background = paxisim.Background.load("background.json")
    np.testing.assert_allclose(less.measured, background.apply(pressed).measured, atol=1e-3)
    assert main(["calibrate", "press.mcap", "--loads", "Fz=cell", *fit, "-o", "sensor.json"]) == 0
    assert paxisim.Calibration.load("sensor.json").covariates == NAMES
    for name in ("background.png", "less.png", "sensor.png", "sensor.residuals.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    files = set(tmp_path.iterdir())
    for words, said in [
        (["press.mcap"], "expected --loads"),
        (["--loads", "cell"], "need a recording"),
        (["--background", "free.mcap"], "expected --covariates"),
        (["--background", "background.json", "--covariates", "wrist"], "already fitted"),
        (["--background", "background.json"], "without a recording"),
        (["press.mcap", "--background", "background.json"], "without --loads"),
        (["less.mcap", "--loads", "Fz=cell", "--background", "background.json"], "already subtracted"),
        (["press.mcap", "--loads", "Fz=cell", "--background", "sensor.json"], "expected a background"),
    ]:
        assert main(["calibrate", *words, "-o", "no.json"]) == 2, words
        captured = capsys.readouterr()
        assert said in captured.err, (words, captured.err)
        assert captured.err.count("\n") == 1
    assert set(tmp_path.iterdir()) == files


def read_all(sensor):
    while True:
        sensor.read(20)


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_the_field_of_the_robot_is_subtracted_live(background, tmp_path, capsys, monkeypatch):
    pytest.importorskip("serial")
    openings = np.linspace(0.01, 0.05, 5)
    fields = [field(np.array([opening]), np.zeros((1, 2)))[0] + 100 for opening in openings]
    state = {"opening": openings[0], "wrist": [0.0, 0.0]}

    opening = openings[0]

    def board(now):
        return fields[int(np.argmin(np.abs(openings - opening)))]

    with paxisim.Emulator("anyskin", board) as emulator:
        with pytest.raises(InvalidValueError, match="depends on opening, wrist"):
            paxisim.open_sensor(emulator.port, "anyskin", calibration=background)
        with paxisim.open_sensor(emulator.port, "anyskin", calibration=background, covariates=lambda: state) as skin:
            skin.zero(software=True)
            read = []
            for opening in openings:
                state["opening"] = opening
                for _ in range(30):  # frames on the way are older than the opening
                    frame = skin.read(20)
                read.append(frame.force)
            assert (skin.unit, frame.unit) == ("uT", "uT")
            assert np.ptp(fields, axis=0).max() > 300
            assert np.abs(read).max() < 3, "what is left of the other finger's field"
            state = {"wrist": [0.0, 0.0]}
            with pytest.raises(DeviceError, match=r"covariates .*UnknownNameError.*opening"):
                read_all(skin)

        background.save(tmp_path / "background.json")
        (tmp_path / "my_robot_state.py").write_text(
            "def now():\n    return {'opening': 0.01, 'wrist': [0, 0]}\ndef lost():\n    return {}['wrist']\n"
        )
        monkeypatch.chdir(tmp_path)
        opening = openings[0]
        command = ["record", emulator.port, "--profile", "anyskin", "--seconds", "0.5", "-o", "less.mcap"]
        command += ["--calibration", "background.json"]
        for words, said in [
            ([], "expected --covariates"),
            (["--covariates", "my_robot_state"], "must be module:function"),
            (["--covariates", "my_robot_state:later"], "no function 'later'"),
            (["--covariates", "no_such_module:now"], "cannot import"),
            (["--covariates", "my_robot_state:lost"], "covariates for the frames .* failed with KeyError: 'wrist'"),
        ]:
            assert main([*command, *words]) == 2
            error = capsys.readouterr().err
            assert re.search(said, error), error
            assert error.count("\n") == 1, error
            Path("less.mcap").unlink(missing_ok=True)
        assert main([*command, "--covariates", "my_robot_state:now"]) == 0
    recorded = paxisim.Recording.load("less.mcap")
    assert (recorded.unit, recorded.metadata["background"]) == ("uT", list(NAMES))
    assert "calibrated_from" not in recorded.metadata
    np.testing.assert_allclose(
        recorded.measured[-1], fields[0] - background.field({"opening": 0.01, "wrist": [0, 0]}), atol=3
    )
