"""Calibration files: the load from all channels together, applied when a sensor is opened."""

import errno
import json
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from load_rig import NAMES, PADS, rig

import paxisim
from paxisim.cli import main
from paxisim.errors import InvalidValueError

LOADS = dict(zip(NAMES, NAMES, strict=True))


@pytest.fixture(scope="module")
def calibration() -> paxisim.Calibration:
    return paxisim.calibrate_sensor(rig()[0], LOADS)


def bent(recording: paxisim.Recording) -> paxisim.Recording:
    """The same sensor with channels that are nonlinear, like a magnet's field."""
    measured = recording.measured
    size = np.abs(measured).max(axis=0)
    return replace(recording, measured=measured * (1 + 0.6 * measured / size))


def test_all_channels_together_say_the_load_of_another_motion(calibration: paxisim.Calibration) -> None:
    same_sensor, _ = rig()
    later = same_sensor[len(same_sensor) // 2 :]
    first = paxisim.calibrate_sensor(same_sensor[: len(same_sensor) // 2], LOADS)
    truth = np.stack([later.covariates[name] for name in NAMES], axis=1)
    truth = first.readout.earlier(later, truth)
    error = np.sqrt(np.mean((first.model(later.measured) - truth) ** 2, axis=0))
    # the load cell's own noise is 0.02 N
    assert error.max() < 0.1
    np.testing.assert_allclose(error, first.model.error, rtol=0.5)
    assert first.model.explained.min() > 0.99


def test_a_channel_that_is_never_known_is_set_aside(calibration: paxisim.Calibration, tmp_path, capsys) -> None:
    recording = rig()[0]
    recording.measured[:, 0, 2, 0, 0] = np.nan
    recording.save(tmp_path / "a.npz")
    assert main(["calibrate", str(tmp_path / "a.npz"), "--loads", *NAMES, "-o", str(tmp_path / "a.json")]) == 0
    model = paxisim.Calibration.load(tmp_path / "a.json").model
    assert not model.used[0, 2, 0, 0]
    assert model.used.sum() == calibration.model.used.sum() - 1
    np.testing.assert_allclose(model.error, calibration.model.error, rtol=0.3)


def test_a_full_disk_leaves_no_part_of_a_calibration(tmp_path, capsys, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    rig()[0].save(tmp_path / "a.npz")
    words = ["calibrate", str(tmp_path / "a.npz"), "--loads", *NAMES, "-o", str(tmp_path / "b.json")]

    def full(self: Path, data: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        assert main(words) == 2
    assert re.search(
        r"paxisim: error: .*b\.png.*[Nn]o space|paxisim: error: [Nn]o space.*b\.png", capsys.readouterr().err
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npz"]
    assert main(words) == 0, "the repeat is not refused"


def test_a_quadratic_fit_helps_where_channels_bend_and_is_refused_for_many() -> None:
    straight = rig()[0]
    # with more channels than loads, the nonlinearities cancel in a sum of channels
    few = replace(straight, measured=straight.measured[..., :1], layout=None)
    recording = bent(few)
    linear, quadratic = (paxisim.calibrate_sensor(recording, LOADS, quadratic=q).model for q in (False, True))
    assert np.all(quadratic.error < 0.7 * linear.error)
    assert "quadratic" in str(quadratic)
    many = replace(straight, measured=np.tile(straight.measured, (1, 1, 1, 1, 4)), layout=None)
    with pytest.raises(InvalidValueError, match="at most 48 channels"):
        paxisim.calibrate_sensor(many, LOADS, quadratic=True)


def test_the_file_gives_the_same_numbers(calibration: paxisim.Calibration, tmp_path) -> None:
    recording = rig()[0]
    path = tmp_path / "sensor.json"
    calibration.save(path)
    again = paxisim.Calibration.load(path)
    assert str(again) == str(calibration)
    assert repr(again) == repr(calibration)
    np.testing.assert_array_equal(again.to_force(recording.measured), calibration.to_force(recording.measured))
    np.testing.assert_array_equal(again.model(recording.measured), calibration.model(recording.measured))
    assert again.to_json() == calibration.to_json()


@pytest.mark.parametrize("quadratic", [False, True])
def test_damaged_files_are_named(quadratic: bool, tmp_path) -> None:
    good = json.loads(paxisim.calibrate_sensor(rig()[0], LOADS, quadratic=quadratic).to_json())

    def changed(*path, value):
        document = json.loads(json.dumps(good))
        place = document
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
        return json.dumps(document)

    broken = [
        "no json",
        "[1]",
        "[" * 100_000,
        changed("format", value="other"),
        changed("readout", value=None),
        changed("readout", "offset", value=[1, 2]),
        changed("readout", "offset", value="x"),
        changed("readout", "gain", value=[[1]]),
        changed("readout", "loads", value=[]),
        changed("readout", "loads", value=[5]),
        changed("readout", "delay", value=None),
        changed("readout", "used", value=[[[[None] * 5]] * 3]),
        changed("model", "weights", value=good["model"]["weights"][1:]),
        changed("model", "center", 0, value=None),
        changed("model", "used", value=[True]),
    ]
    for number, text in enumerate(broken):
        path = tmp_path / f"{number}.json"
        path.write_text(text)
        with pytest.raises(InvalidValueError, match=rf"{number}\.json"):
            paxisim.Calibration.load(path)


def test_the_total_force_is_of_one_pad(calibration: paxisim.Calibration) -> None:
    recording = rig()[0]
    at = 700
    total = calibration.total_force(recording.measured[at])
    assert total.shape == (1, 3)
    np.testing.assert_allclose(total[0], calibration.model(recording.measured[at]), rtol=1e-5)
    one = paxisim.calibrate_sensor(recording, {"Fz": "Fz"})
    assert np.isnan(one.total_force(recording.measured[at])[0, :2]).all()
    # a single-axis load cell, whatever its name, is taken as normal to the pad
    named = replace(recording, covariates={"cell": recording.covariates["Fz"]})
    only = paxisim.calibrate_sensor(named, "cell")
    assert np.isfinite(only.total_force(recording.measured[at])[0]).tolist() == [False, False, True]
    two = replace(recording, measured=np.repeat(recording.measured, 2, axis=1), pads=(), layout=None)
    assert PADS == 1
    assert paxisim.calibrate_sensor(two, LOADS).total_force(two.measured[at]) is None


def test_the_verb_writes_a_calibration_and_two_pictures(tmp_path, capsys) -> None:
    pytest.importorskip("matplotlib")
    recording = rig()[0]
    warm = 25 + 0.01 * recording.time
    raw = tmp_path / "raw.npz"
    replace(recording, covariates={**recording.covariates, "temperature": warm}).save(raw)
    output = tmp_path / "sensor.json"
    command = ["calibrate", str(raw), "--loads", *NAMES, "-o", str(output)]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "load from all 15 channels together, linear" in said
    assert paxisim.Calibration.load(output).readout.unit == "uT"
    for name in ("sensor.png", "sensor.residuals.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    assert main(command) == 2
    assert "exists" in capsys.readouterr().err
    assert main([*command[:-1], str(tmp_path / "sensor.txt")]) == 2
    figure = paxisim.plot_residuals(paxisim.Calibration.load(output), paxisim.Recording.load(raw))
    labels = [ax.get_xlabel() for ax in figure.axes]
    assert labels == ["Fx (N)", "temperature", "Fy (N)", "temperature", "Fz (N)", "temperature"]


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_a_sensor_is_opened_recorded_and_zeroed_in_newtons(calibration: paxisim.Calibration, tmp_path, capsys) -> None:
    pytest.importorskip("serial")
    from paxisim.hw.emulation.emulator import Emulator

    path, output = tmp_path / "sensor.json", tmp_path / "newtons.mcap"
    calibration.save(path)
    recording = rig()[0]
    field = recording.measured[700]
    with Emulator("anyskin", lambda now: field) as emulator:
        with paxisim.open_sensor(emulator.port, "anyskin", calibration=paxisim.Calibration.load(path)) as skin:
            frame = skin.read(20)
            assert (skin.unit, frame.unit, frame.force.dtype) == ("N", "N", np.float32)
            np.testing.assert_allclose(frame.force, calibration.to_force(field), atol=0.02)
            np.testing.assert_allclose(frame.resultant[0], calibration.model(field), atol=0.02)
            skin.zero()
            frame = skin.read(20)
            np.testing.assert_allclose(frame.force, 0, atol=1e-4)
            np.testing.assert_allclose(frame.resultant, 0, atol=1e-4)
        command = ["record", emulator.port, "--profile", "anyskin", "--seconds", "0.5"]
        assert main([*command, "-o", str(output), "--calibration", str(path)]) == 0
        wrong = replace(calibration, readout=replace(calibration.readout, unit="counts"))
        wrong.save(path)
        assert main([*command, "-o", str(tmp_path / "no.mcap"), "--calibration", str(path)]) == 2
        assert "of channels in counts, but this sensor's are in uT" in capsys.readouterr().err
    loaded = paxisim.Recording.load(output)
    assert loaded.unit == "N"
    assert loaded.metadata["calibrated_from"] == "uT"
    np.testing.assert_allclose(loaded.measured[-1], calibration.to_force(field), atol=0.02)
    other = paxisim.TaxelLayout(2, 2, (1e-3, 1e-3))
    with pytest.raises(InvalidValueError, match="of a sensor with frames of shape"):
        calibration.check((1, *other.shape), "uT")
