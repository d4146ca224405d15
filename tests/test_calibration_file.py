"""Calibration files: the load from all channels together, applied when a sensor is opened."""

import errno
import json
import os
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from load_rig import NAMES, rig

import paxisim
from paxisim.cli import main
from paxisim.errors import InvalidValueError
from paxisim.logs.columns import to_columns

LOADS = dict(zip(NAMES, NAMES, strict=True))


@pytest.fixture(scope="module")
def recording() -> paxisim.Recording:
    return rig()[0]


@pytest.fixture(scope="module")
def calibration(recording) -> paxisim.Calibration:
    return paxisim.calibrate_sensor(recording, LOADS)


def test_all_channels_together_say_the_load_of_another_motion(recording) -> None:
    half = len(recording) // 2
    later = recording[half:]
    first = paxisim.calibrate_sensor(recording[:half], LOADS)
    truth = np.stack([later.covariates[name] for name in NAMES], axis=1)
    truth = first.readout.earlier(later, truth)
    error = np.sqrt(np.mean((first.model(later.measured) - truth) ** 2, axis=0))
    # the load cell's own noise is 0.02 N
    assert error.max() < 0.1
    np.testing.assert_allclose(error, first.model.error, rtol=0.5)
    assert first.model.explained.min() > 0.99


def test_a_channel_that_is_never_known_is_set_aside(calibration) -> None:
    holed = rig()[0]
    holed.measured[:, 0, 2, 0, 0] = np.nan
    model = paxisim.calibrate_sensor(holed, LOADS).model
    assert not model.used[0, 2, 0, 0]
    assert model.used.sum() == calibration.model.used.sum() - 1
    np.testing.assert_allclose(model.error, calibration.model.error, rtol=0.3)


def test_a_quadratic_fit_helps_where_channels_bend_and_is_refused_for_many(recording) -> None:
    # with more channels than loads, the nonlinearities cancel in a sum of channels
    few = replace(recording, measured=recording.measured[..., :1], layout=None)
    bent = replace(few, measured=few.measured * (1 + 0.6 * few.measured / np.abs(few.measured).max(axis=0)))
    linear, quadratic = (paxisim.calibrate_sensor(bent, LOADS, quadratic=q).model for q in (False, True))
    assert np.all(quadratic.error < 0.7 * linear.error)
    assert "quadratic" in str(quadratic)
    many = replace(recording, measured=np.tile(recording.measured, (1, 1, 1, 1, 4)), layout=None)
    with pytest.raises(InvalidValueError, match="at most 48 channels"):
        paxisim.calibrate_sensor(many, LOADS, quadratic=True)


@pytest.mark.parametrize("quadratic", [False, True])
def test_a_file_gives_the_same_numbers_and_a_damaged_one_is_named(quadratic, recording, tmp_path) -> None:
    calibration = paxisim.calibrate_sensor(recording, LOADS, quadratic=quadratic)
    calibration.save(tmp_path / "sensor.json")
    again = paxisim.Calibration.load(tmp_path / "sensor.json")
    assert (str(again), repr(again), again.to_json()) == (str(calibration), repr(calibration), calibration.to_json())
    np.testing.assert_array_equal(again.to_force(recording.measured), calibration.to_force(recording.measured))
    np.testing.assert_array_equal(again.model(recording.measured), calibration.model(recording.measured))

    good = json.loads(calibration.to_json())
    for number, (*path, value) in enumerate([
        ("format", "other"),
        ("readout", None),
        ("readout", "offset", [1, 2]),
        ("readout", "offset", "x"),
        ("readout", "gain", [[1]]),
        ("readout", "loads", []),
        ("readout", "loads", [5]),
        ("readout", "delay", None),
        ("readout", "used", [[[[None] * 5]] * 3]),
        ("model", "weights", good["model"]["weights"][1:]),
        ("model", "center", 0, None),
        ("model", "used", [True]),
    ]):  # fmt: skip
        document = place = json.loads(json.dumps(good))
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
        (tmp_path / f"{number}.json").write_text(json.dumps(document))
        with pytest.raises(InvalidValueError, match=rf"{number}\.json"):
            paxisim.Calibration.load(tmp_path / f"{number}.json")
    for text in ("no json", "[1]", "[" * 100_000):
        (tmp_path / "text.json").write_text(text)
        with pytest.raises(InvalidValueError, match=r"text\.json"):
            paxisim.Calibration.load(tmp_path / "text.json")


def test_the_total_force_is_of_one_pad(calibration, recording) -> None:
    field = recording.measured[700]
    total = calibration.total_force(field)
    assert total.shape == (1, 3)
    np.testing.assert_allclose(total[0], calibration.model(field), rtol=1e-5)
    # a single-axis load cell, whatever its name, is taken as normal to the pad
    named = replace(recording, covariates={"cell": recording.covariates["Fz"]})
    for only in (paxisim.calibrate_sensor(recording, {"Fz": "Fz"}), paxisim.calibrate_sensor(named, "cell")):
        assert np.isfinite(only.total_force(field)[0]).tolist() == [False, False, True]
    two = replace(recording, measured=np.repeat(recording.measured, 2, axis=1), pads=(), layout=None)
    assert paxisim.calibrate_sensor(two, LOADS).total_force(two.measured[700]) is None


def test_the_verb_writes_a_calibration_and_two_pictures_or_nothing(recording, tmp_path, capsys, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    warm = 25 + 0.01 * recording.time
    raw = tmp_path / "raw.npz"
    replace(recording, covariates={**recording.covariates, "temperature": warm}).save(raw)
    output = tmp_path / "sensor.json"
    command = ["calibrate", str(raw), "--loads", *NAMES, "-o", str(output)]

    def full(self: Path, data: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        assert main(command) == 2
    said = capsys.readouterr().err
    assert re.search(r"paxisim: error: (?=.*sensor\.png).*[Nn]o space", said), said
    assert list(tmp_path.iterdir()) == [raw]

    assert main(command) == 0, "the repeat is not refused"
    assert "load from all 15 channels together, linear" in capsys.readouterr().out
    assert paxisim.Calibration.load(output).readout.unit == "uT"
    for name in ("sensor.png", "sensor.residuals.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    assert main(command) == 2
    assert "exists" in capsys.readouterr().err
    figure = paxisim.plot_residuals(paxisim.Calibration.load(output), paxisim.Recording.load(raw))
    labels = [ax.get_xlabel() for ax in figure.axes]
    assert labels == ["Fx (N)", "temperature", "Fy (N)", "temperature", "Fz (N)", "temperature"]


def test_a_table_will_do_and_without_matplotlib_there_is_no_picture_and_a_word(tmp_path, capsys, monkeypatch) -> None:
    columns = to_columns(rig(seconds=20)[0].to_arrays())
    rows = np.column_stack(list(columns.values()))
    np.savetxt(tmp_path / "raw.csv", rows, delimiter=",", header=",".join(columns), comments="")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    words = [str(tmp_path / "raw.csv"), "--loads", *NAMES, "-o", str(tmp_path / "ready.npz"), "--degree", "2"]
    assert main(["calibrate", *words]) == 0
    assert "no picture: plot_calibration needs matplotlib" in capsys.readouterr().out
    assert paxisim.Recording.load(tmp_path / "ready.npz").simulated is not None
    assert not (tmp_path / "ready.png").exists()


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_a_sensor_is_opened_recorded_and_zeroed_in_newtons(calibration, recording, tmp_path, capsys) -> None:
    pytest.importorskip("serial")
    path, output = tmp_path / "sensor.json", tmp_path / "newtons.mcap"
    calibration.save(path)
    field = recording.measured[700]
    with paxisim.Emulator("anyskin", lambda now: field) as emulator:
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
