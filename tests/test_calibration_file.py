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


def live_error(calibration, recording, names=NAMES):
    """Root-mean-square error of the model, given each sample as live use gives it: at once, without a shift in time."""
    said = np.stack([calibration.model(channels) for channels in recording.measured])
    return np.sqrt(np.mean((said - np.stack([recording.covariates[name] for name in names], axis=1)) ** 2, axis=0))


@pytest.mark.parametrize("kind", ["linear", "quadratic", "best"])
@pytest.mark.parametrize("delay", [0.0, 0.03, 0.15])
def test_the_printed_error_is_that_of_live_use_on_another_motion(delay, kind) -> None:
    recording, gains = rig(delay=delay, seconds=90)
    half = len(recording) // 2
    calibration = paxisim.calibrate_sensor(recording[:half], LOADS, kind=kind)
    np.testing.assert_allclose(calibration.model.error, live_error(calibration, recording[half:]), rtol=0.3)
    # a push that is held has no delay, so all of it is read
    still = np.tensordot(2 * np.eye(3), gains, 1)
    read = calibration.model(still) - calibration.model(np.zeros_like(still[0]))
    np.testing.assert_allclose(read, 2 * np.eye(3), atol=0.15)
    when = f"{1e3 * calibration.readout.delay:.1f} ms earlier" if delay else "at the same time"
    assert f"fitted to the load {when}\nerror on held-out data, of the load at the same time, as live" in str(
        calibration
    )


def test_a_delay_that_explains_little_does_not_shift_the_loads() -> None:
    calibration = paxisim.calibrate_sensor(rig(delay=0.02, load_noise=0.3)[0], LOADS)
    assert calibration.readout.delay > 0.015
    assert calibration.model.delay == 0


@pytest.mark.parametrize(("kind", "terms"), [("linear", 15), ("quadratic", 135)])
def test_the_ridge_keeps_channels_that_say_the_same_from_fitting_noise(kind, terms) -> None:
    rng = np.random.default_rng(0)
    recording = rig(seconds=90)[0]
    load = recording.covariates["Fz"]
    common = load + rng.normal(size=load.size)  # all channels share most of their noise
    channels = common[:, None] + 0.1 * rng.normal(size=(load.size, 15))
    recording = replace(recording, measured=channels.reshape(recording.measured.shape))
    first, later = recording[:300], recording[3600:]
    calibration = paxisim.calibrate_sensor(first, {"Fz": "Fz"}, kind=kind, max_delay=0)
    assert f"{kind}, ridge {calibration.model.ridge:g}" in str(calibration)
    products = np.stack([channels[:, a] * channels[:, b] for a in range(15) for b in range(a, 15)], axis=1)
    x = np.column_stack([np.ones(len(load)), channels, products])[:, : 1 + terms]
    plain = x[3600:] @ np.linalg.lstsq(x[:300], load[:300], rcond=None)[0] - load[3600:]
    assert live_error(calibration, later, ["Fz"])[0] < 0.98 * np.sqrt(np.mean(plain**2))


def test_a_channel_that_is_never_known_is_set_aside(calibration) -> None:
    holed = rig()[0]
    holed.measured[:, 0, 2, 0, 0] = np.nan
    model = paxisim.calibrate_sensor(holed, LOADS).model
    assert not model.used[0, 2, 0, 0]
    assert model.used.sum() == calibration.model.used.sum() - 1
    np.testing.assert_allclose(model.error, calibration.model.error, rtol=0.3)


def test_a_quadratic_fit_is_chosen_where_channels_bend_and_refused_for_many(recording) -> None:
    # with more channels than loads, the nonlinearities cancel in a sum of channels
    few = replace(recording, measured=recording.measured[..., :1], layout=None)
    bent = replace(few, measured=few.measured * (1 + 0.6 * few.measured / np.abs(few.measured).max(axis=0)))
    straight, curved = (paxisim.calibrate_sensor(own, LOADS, max_delay=0).model for own in (few, bent))
    linear = paxisim.calibrate_sensor(bent, LOADS, kind="linear", max_delay=0).model
    assert (straight.quadratic, curved.quadratic, linear.quadratic) == (False, True, False)
    assert np.sum(curved.error**2) < 0.7 * np.sum(linear.error**2)
    many = replace(recording, measured=np.tile(recording.measured, (1, 1, 1, 1, 4)), layout=None)
    assert not paxisim.calibrate_sensor(many, LOADS).model.quadratic
    with pytest.raises(InvalidValueError, match="at most 48 channels"):
        paxisim.calibrate_sensor(many, LOADS, kind="quadratic")
    with pytest.raises(InvalidValueError, match="'best', 'linear' or 'quadratic', got 'cubic'"):
        paxisim.calibrate_sensor(recording, LOADS, kind="cubic")


@pytest.mark.parametrize(("kind", "delay"), [("linear", 0.03), ("quadratic", 0.03), ("best", 0.9), ("best", -0.9)])
@pytest.mark.filterwarnings("ignore:the delay lies at the end")
def test_a_file_gives_the_same_numbers_and_a_damaged_one_is_named(kind, delay, tmp_path) -> None:
    recording = rig(delay=delay, seconds=30)[0]
    calibration = paxisim.calibrate_sensor(recording, LOADS, kind=kind)
    calibration.save(tmp_path / "sensor.json")
    again = paxisim.Calibration.load(tmp_path / "sensor.json")
    assert (str(again), repr(again), again.to_json()) == (str(calibration), repr(calibration), calibration.to_json())
    assert again.readout.delay_interval == calibration.readout.delay_interval
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
        ("model", "ridge", None),
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


def pressed_skin(creep: float) -> paxisim.Recording:
    """Return a recording of an eFlesh skin from first principles, pressed for different times, in microtesla."""
    time = np.arange(0, 90, 1 / 40)
    rng = np.random.default_rng(0)
    press = np.zeros_like(time)
    for start in np.arange(1, 86, 4.5):
        hold, peak = rng.uniform(0.2, 2.5), rng.uniform(1, 4)
        press += peak * np.clip(np.minimum(time - start, start + hold + 0.6 - time) / 0.3, 0, 1)
    shear = 0.3 * press * np.sin(2.1 * time)
    skin = paxisim.MagneticSkin("eflesh")
    rows, cols = skin.design.cells.shape[-2:]
    force = np.zeros((len(time), 1, 3, rows, cols))
    touched = (slice(None), 0, slice(None), slice(rows // 2 - 2, rows // 2 + 2), slice(cols // 2 - 2, cols // 2 + 2))
    force[touched] = np.stack([shear, 0 * press, press], axis=1)[:, :, None, None] / 16
    felt = paxisim.Chain([paxisim.augment.Creep((creep,), (1.0,))]).run(force, time)
    loads = {"Fx": shear + rng.normal(0, 0.002, len(time)), "Fz": press + rng.normal(0, 0.002, len(time))}
    return paxisim.Recording(time, skin.measure(felt, rng), covariates=loads, metadata={"unit": "uT"})


@pytest.mark.slow
@pytest.mark.parametrize(("creep", "found"), [(0.2, ["creep"]), (0.0, [])])
def test_the_total_force_of_a_skin_shows_what_its_calibration_misses(creep, found) -> None:
    raw = pressed_skin(creep)
    calibration = paxisim.calibrate_sensor(raw, {"Fx": "Fx", "Fz": "Fz"})
    total = calibration.apply_total(raw)
    assert (total.layout.rows, total.layout.cols, total.unit) == (1, 1, "N")
    assert total.metadata["readout"]["unused"] == [["pad0", "y", 0, 0]]
    np.testing.assert_allclose(
        total.measured[700, 0, :, 0, 0], np.nan_to_num(calibration.total_force(raw.measured[700])[0])
    )
    # a shifted load, if the fit found a delay
    np.testing.assert_allclose(total.simulated[:, 0, 2, 0, 0].max(), raw.covariates["Fz"].max(), rtol=0.01)
    assert not total.measured[:, 0, 1].any()
    diagnosis = paxisim.diagnose(total, ["creep", "hysteresis", "low_pass", "latency"])
    assert [cause.name for cause in diagnosis.causes] == found


def test_the_total_force_needs_one_pad_and_a_recording_as_output(calibration, recording, tmp_path, capsys) -> None:
    two = replace(recording, measured=np.repeat(recording.measured, 2, axis=1), pads=(), layout=None)
    with pytest.raises(InvalidValueError, match="expected one pad and a calibrated force, got 2 pads and the loads Fx"):
        paxisim.calibrate_sensor(two, LOADS).apply_total(two)
    raw = tmp_path / "raw.npz"
    recording.save(raw)
    command = ["calibrate", str(raw), "--loads", *NAMES, "--kind", "linear", "--total", "-o"]
    assert main([*command, str(tmp_path / "sensor.json")]) == 2
    assert "--total writes a recording of the total force: expected --loads and an output" in capsys.readouterr().err
    assert main([*command, str(tmp_path / "total.mcap")]) == 0
    total = paxisim.Recording.load(tmp_path / "total.mcap")
    assert total.measured.shape[1:] == (1, 3, 1, 1)
    error = np.sqrt(np.mean((total.measured - total.simulated) ** 2, axis=(0, 1, 3, 4)))
    assert error.max() < 0.3, "the load is read within the noise"


def test_the_verb_writes_a_calibration_and_two_pictures_or_nothing(recording, tmp_path, capsys, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    warm = 25 + 0.01 * recording.time
    raw = tmp_path / "raw.npz"
    replace(recording, covariates={**recording.covariates, "temperature": warm}).save(raw)
    output = tmp_path / "sensor.json"
    command = ["calibrate", str(raw), "--loads", *NAMES, "-o", str(output), "--kind", "linear"]

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
