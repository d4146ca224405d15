"""eFlesh recordings: magnetometer fields together with a robot and a load cell."""

import numpy as np
import pytest
from log_files import refused

from paxisim.hw.profiles.load import load_profile
from paxisim.layout import TaxelLayout
from paxisim.logs.eflesh import NEWTONS
from paxisim.recording import Recording

START = 1743486221.5


def write(folder, sensor, states, name="press"):
    for ending, table in (("sensor", sensor), ("states", states)):
        rows = "\n".join(",".join(repr(float(value)) for value in row) for row in table)
        (folder / f"{name}.{ending}.csv").write_text(rows + "\n", encoding="utf-8")
    return folder / f"{name}.sensor.csv"


def tables(count=20, magnetometers=5):
    time = START + 0.1 * np.arange(count)
    sensor = np.column_stack([time, np.arange(count * 3 * magnetometers).reshape(count, -1)])
    states = np.column_stack(
        [time + 0.05, np.full(count, 315.0), np.full(count, -100.0), 288.0 - np.arange(count), 100.0 * np.arange(count)]
    )
    return sensor, states


def test_magnetometers_are_taxels_in_microtesla_beside_the_load_in_newtons(tmp_path):
    sensor, states = tables()
    recording = Recording.load(write(tmp_path, sensor, states))
    assert recording.measured.shape == (20, 1, 3, 1, 5)
    np.testing.assert_array_equal(recording.measured[7, 0, :, 0, 2], sensor[7, 1 + 6 : 1 + 9])
    assert recording.metadata["unit"] == "uT"
    np.testing.assert_allclose(recording.time, 0.1 * np.arange(20), atol=1e-6)
    load = recording.covariates["load"]
    assert np.isnan(load[0])  # the load cell's first reading came later
    np.testing.assert_allclose(load[1:], (np.arange(1, 20) - 0.5) * 100 * NEWTONS, rtol=1e-5)
    np.testing.assert_allclose(recording.covariates["robot_z"][1:], 0.288 - 1e-3 * (np.arange(1, 20) - 0.5), rtol=1e-5)


def test_minus_one_is_no_reading_and_gaps_are_bridged_as_far_as_asked_for(tmp_path):
    sensor, states = tables(60)
    states[20:45, 4] = -1  # 2.6 s between two readings
    path = write(tmp_path, sensor, states)
    load = Recording.load(path, max_gap=3.0, align={"load": "previous"}).covariates["load"]
    np.testing.assert_allclose(load[20:45], 1900 * NEWTONS, rtol=1e-5)
    states[3:5, 4] = -1
    write(tmp_path, sensor, states)
    load = Recording.load(path).covariates["load"]
    np.testing.assert_allclose(load[4], 350 * NEWTONS, rtol=1e-5)
    assert np.isnan(load[21:45]).all()
    assert np.isfinite(load[1:20]).all()
    load = Recording.load(path, max_gap=0.2).covariates["load"]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(load[:10])), [0, 3, 4, 5])


def test_a_layout_says_where_the_magnetometers_are_and_a_profile_does_not_apply(tmp_path):
    path = write(tmp_path, *tables(magnetometers=2))
    layout = TaxelLayout(1, 2, (3e-3, 4e-3))
    recording = Recording.load(path, layout=layout, pads=["eflesh"])
    assert recording.measured.shape[1:] == (1, 3, 1, 2)
    assert recording.layout == layout
    with pytest.raises(LookupError, match="eflesh"):
        Recording.load(path, pads=["left"])
    refused(path, "layout has 1x3 taxels, the tensors have 1x2", layout=TaxelLayout(1, 3, (3e-3, 4e-3)))
    refused(path, "for the counts of a board's CSV file", profile=load_profile("gen2-box-120"))


def test_other_files_are_refused(tmp_path):
    sensor, states = tables()
    dead = states.copy()
    dead[:, 4] = -1
    for wrong, word in (
        ((sensor[:, :-1], states), "every row must hold a time and x, y, z of each magnetometer"),
        ((sensor, states[:, :-2]), "every row must hold time, x, y, z and, with a load cell, force, got 3"),
        ((sensor, dead), "the load cell has no readings"),
        ((sensor[::-1], states), "time decreases in line 2"),
        ((sensor * np.nan, states), "line 1 is not finite"),
    ):
        refused(write(tmp_path, *wrong), word)
    path = write(tmp_path, sensor, states)
    for text, word in (("time,a,b,c\n1,2,3,4\n", "without a header"), ("", "is empty")):
        path.write_text(text, encoding="utf-8")
        refused(path, word)
    (tmp_path / "press.states.csv").unlink()
    with pytest.raises(FileNotFoundError, match=r"there is no .*press\.states\.csv"):
        Recording.load(path)
