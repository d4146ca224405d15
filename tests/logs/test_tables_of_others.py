"""Tables as other programs write them: delimiters, clocks, dates, the order of rows, fields without a header."""

import re
import time as clock
import warnings

import numpy as np
import pytest
from log_files import refused

from paxisim.cli import main
from paxisim.recording import Recording

NAMES = ["tactile.left.0_0.x", "tactile.left.0_0.y", "tactile.left.0_0.z", "opening"]
UNIX = 1_760_000_000.0
EVERY = 0.02  # s


@pytest.fixture(autouse=True)
def zone(monkeypatch):
    """Two hours ahead of UTC, whatever the zone of this computer."""
    monkeypatch.setenv("TZ", "XXX-02")
    clock.tzset()
    yield
    monkeypatch.undo()
    clock.tzset()


def table(name="time", cells=None, delimiter=",", first="", count=6, decimal="."):
    """Return the text of a table whose forces are 0.5 and on in steps of 1, one row every 20 ms."""
    cells = [EVERY * i for i in range(count)] if cells is None else cells
    lines = [delimiter.join([name, *NAMES])]
    for i, cell in enumerate(cells):
        lines.append(delimiter.join([str(cell), *(str(i + 0.5).replace(".", decimal) for _ in NAMES)]))
    return first + "\n".join([*lines, ""])


def iso(i, zone=""):
    return f"2025-10-09T08:53:{20 + EVERY * i:06.3f}{zone}"


READ = {  # text, time of the first row, words of the warning or ""
    "tabs": (table(delimiter="\t"), 0, ""),
    "semicolons": (table(delimiter=";"), 0, ""),
    "semicolons and decimal commas": (table(delimiter=";", decimal=","), 0, ""),
    "a capital letter": (table("Time"), 0, ""),
    "a line of sizes": (table(first="1,1,1,6\n"), 0, ""),
    "sizes in words": (table("TIMESTAMP", first="rows 1 cols 1\n"), 0, ""),
    "a stated unit": (table("time_ms", [20 * i for i in range(6)]), 0, ""),
    "a stated unit in brackets": (table("Time [us]", [20e3 * i for i in range(6)]), 0, ""),
    "slow, but stated": (table("time_s", [1000 * EVERY * i for i in range(6)]), None, ""),
    "ms by rate": (table("Time", [20 * i for i in range(6)]), 0, "in ms, so that its rows come at 50 Hz"),
    "us by rate": (table("time", [20_000 * i for i in range(6)]), 0, "in us, so that its rows come at 50 Hz"),
    "ns by rate": (table("time", [5 * 10**14 + 20_000_000 * i for i in range(6)]), 5e5, "in ns, so that"),
    "Unix ms": (table("timestamp", [int(UNIX * 1000) + 20 * i for i in range(6)]), UNIX, ""),
    "Unix ns": (table("timestamp", [int(UNIX) * 10**9 + 20_000_000 * i for i in range(6)]), UNIX, ""),
    "ISO": (table("time", [iso(i, "Z") for i in range(6)]), UNIX, ""),
    "ISO with a zone": (table("Timestamp", [iso(i, "-03:30") for i in range(6)]), UNIX + 12600, ""),
    "two clocks": (table("Timestamp,time", [f"{iso(i)},{EVERY * i}" for i in range(6)]), 0, ""),
    "ISO without one": (
        table("time", [iso(i).replace("T", " ") for i in range(6)]),
        UNIX - 7200,
        "no time zone.*UTC.02:00",
    ),
}


@pytest.mark.parametrize("case", READ)
def test_a_table_of_another_program(tmp_path, case):
    text, first, warning = READ[case]
    (tmp_path / "a.csv").write_text(text)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        loaded = Recording.load(tmp_path / "a.csv")
    assert len(said) == bool(warning)
    if warning:
        assert re.search(warning, str(said[0].message))
    every = EVERY if first is not None else 1000 * EVERY
    np.testing.assert_allclose(loaded.time, (first or 0) + every * np.arange(6), atol=1e-6)
    np.testing.assert_array_equal(loaded.measured[:, 0, 2, 0, 0], np.arange(6) + 0.5)
    np.testing.assert_array_equal(loaded.covariates["opening"], np.arange(6) + 0.5)


def test_rows_out_of_order_are_sorted_and_a_clock_that_starts_anew_is_not(tmp_path):
    path, times = tmp_path / "a.csv", [0.0, 0.02, 0.06, 0.04, 0.08, 0.1]
    path.write_text(table(cells=times))
    with pytest.warns(UserWarning, match="1 row is earlier than the one before; the rows were sorted"):
        loaded = Recording.load(path)
    np.testing.assert_array_equal(loaded.time, sorted(times))
    np.testing.assert_array_equal(loaded.measured[:, 0, 0, 0, 0], np.array([0, 1, 3, 2, 4, 5]) + 0.5)
    path.write_text(table(cells=times[::-1]))
    with pytest.warns(UserWarning, match="sorted by time"):
        assert Recording.load(path).time[0] == 0
    path.write_text(table(cells=[EVERY * (i % 10) for i in range(20)]))
    refused(
        path, "starts anew: column 'time' goes from 0.18 s in row 10 to 0 s in the next; number the parts in a column"
    )


REFUSED = {
    table("Time").replace("opening", "TIME"): "several columns of time, Time, TIME: name the one to read 'time'",
    table("time", [UNIX * 1000 + 4000 * i for i in range(6)]): "cannot be told: .* name it time_ms or time_us",
    table("time", [iso(i) for i in range(5)] + ["yesterday"]): "line 7, column 'time': expected a date and time such",
    table(cells=[0, "late"], first="1,1,1,2\n"): "line 4, column 'time': 'late' is not a number",
    "0.0,1.0,1.0\n0.1,1.0,1.0\n": "has no header: expected the columns' names in its first line, got numbers",
    "-----BEGIN A SECRET KEY OF MINE-----\nabc\n": "^(?!.*SECRET KEY OF MINE)",
    table(cells=["a secret that is longer than a number"]): "'a secret that is longer ...' is not a number",
}


@pytest.mark.parametrize("text", REFUSED, ids=range(len(REFUSED)))
def test_a_table_that_is_refused(tmp_path, capsys, text):
    (tmp_path / "a.csv").write_text(text)
    refused(tmp_path / "a.csv", REFUSED[text])
    assert main(["convert", str(tmp_path / "a.csv"), str(tmp_path / "b.npz")]) == 2
    assert capsys.readouterr().err.count("a.csv") == 1
    assert not (tmp_path / "b.npz").exists()


# the first rows of PaXini's host program, over midnight
HOST = "Timestamp,0-2-NxN-X[0],0-2-NxN-Y[0],0-2-NxN-Z[0]\n23:59:59.990,1,2,3\n00:00:00.010,1,2,4\n00:00:00.030,1,2,5\n"
BEGAN = 1_759_960_799.99  # the end of 2025-10-08 two hours ahead of UTC


def robot(path, start):
    rows = [f"{start + 0.01 * i!r},{i}" for i in range(8)]
    path.write_text("\n".join(["time,joint", *rows, ""]))
    return path


@pytest.mark.filterwarnings("always")
@pytest.mark.parametrize(
    ("name", "options", "start", "warning"),
    [
        (
            "2025-10-08-235959.csv",
            [],
            BEGAN,
            "began at 2025-10-08 23:59:59.990 in the time zone of this computer, UTC.02:00",
        ),
        ("2025-10-09-000001.csv", [], BEGAN, "began at 2025-10-08 23:59:59.990"),
        ("2025-10-09-000001.csv", ["--start", "2025-10-08T12:00:00Z"], 1_759_924_800.0, ""),
        (
            "press.csv",
            ["--start", "2025-10-08 14:00:00"],
            1_759_924_800.0,
            "start 2025-10-08 14:00:00 has no time zone",
        ),
    ],
)
def test_the_host_programs_file_is_paired_with_a_robots_times(tmp_path, capsys, name, options, start, warning):
    (tmp_path / name).write_text(HOST)
    streams = robot(tmp_path / "robot.csv", start)
    command = ["convert", str(tmp_path / name), str(tmp_path / "a.npz"), "--streams", str(streams), *options]
    assert main(command) == 0
    said = capsys.readouterr().err
    assert re.search(warning, said) if warning else "warning" not in said
    loaded = Recording.load(tmp_path / "a.npz")
    assert loaded.metadata["start"] == pytest.approx(start, abs=1e-6)
    np.testing.assert_allclose(loaded.covariates["joint"], [0, 2, 4], atol=1e-4)


def test_a_start_that_is_not_known_or_not_needed(tmp_path):
    (tmp_path / "2025-10-08-120000.csv").write_text(HOST)
    with pytest.warns(UserWarning, match="not that of its first row, 23:59:59.990.*--start"):
        assert "start" not in Recording.load(tmp_path / "2025-10-08-120000.csv").metadata
    (tmp_path / "a.csv").write_text(HOST)
    refused(
        tmp_path / "a.csv", "state when the recording began with start", streams=robot(tmp_path / "robot.csv", UNIX)
    )
    refused(tmp_path / "a.csv", "start must be a date and time such as", start="noon")
    (tmp_path / "b.csv").write_text(READ["Unix ms"][0])
    refused(tmp_path / "b.csv", "so it needs no start", start="2025-10-08T12:00:00Z")
    refused(tmp_path / "b.csv", "rate is for a recording without times", rate=50.0)


FIELDS = np.random.default_rng(0).normal(0, 100, (12, 15)).round(2)


def test_eflesh_as_its_repository_stores_it(tmp_path):
    at = (UNIX + 4.2 * np.arange(12))[:, None]
    np.savetxt(tmp_path / "sensor_post_baselines.csv", np.hstack([at, FIELDS]), fmt="%.6f", delimiter=",")
    np.savetxt(tmp_path / "sensor.csv", np.hstack([at, FIELDS + 1000]), fmt="%.6f", delimiter=",")
    np.savetxt(tmp_path / "states.csv", np.hstack([at, FIELDS[:, :3]]), fmt="%.6f", delimiter=",")
    for name, raw in (("sensor.csv", 1000), ("sensor_post_baselines.csv", 0)):
        loaded = Recording.load(tmp_path / name)
        np.testing.assert_allclose(loaded.measured[:, 0, 1, 0, 4], FIELDS[:, 13] + raw, rtol=1e-6)
        assert list(loaded.covariates) == ["robot_x", "robot_y", "robot_z"]
        np.testing.assert_allclose(loaded.covariates["robot_z"], FIELDS[:, 2] * 1e-3, atol=1e-9)
    (tmp_path / "sensor.csv").write_text(table())  # a plain table of that name
    assert Recording.load(tmp_path / "sensor.csv").covariates.keys() == {"opening"}


def test_anyskins_text_logs(tmp_path, capsys):
    path = tmp_path / "data_2025-10-09_10-00-00.txt"
    np.savetxt(path, FIELDS)
    loaded = Recording.load(path, rate=60.0)
    assert (loaded.measured.shape, loaded.metadata["unit"]) == ((12, 1, 3, 1, 5), "uT")
    np.testing.assert_allclose(loaded.measured[3, 0, :, 0, 2], FIELDS[3, 6:9], rtol=1e-6)
    np.testing.assert_allclose(loaded.time, np.arange(12) / 60)
    assert main(["convert", str(path), str(tmp_path / "a.npz")]) == 2
    assert "has no times, only fields: state its samples per second with rate" in capsys.readouterr().err
    np.savetxt(path, np.hstack([(UNIX + EVERY * np.arange(12))[:, None], FIELDS]))
    loaded = Recording.load(path)
    np.testing.assert_allclose(loaded.time, EVERY * np.arange(12), atol=1e-5)
    assert loaded.metadata["start"] == UNIX
    refused(path, "so it needs no rate", rate=60.0)
    for text, word in (
        ("1 2\n1 2\n", "must hold x, y, z of each magnetometer"),
        ("1 2 3\n1 2\n", "line 2: every row must hold the same number of numeric values"),
        ("1 2 3\n1 2 a-secret-word\n", r"line 2: (?!.*secret)"),
        ("", "is empty"),
    ):
        path.write_text(text)
        refused(path, word, rate=60.0)


def test_a_parquet_table_of_another_program(tmp_path):
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    columns = {"Time": [0, 20, 60, 40, 80, 100]} | {name: [0.5, 1.5, 3.5, 2.5, 4.5, 5.5] for name in NAMES}
    parquet.write_table(pyarrow.table(columns), tmp_path / "a.parquet")
    with pytest.warns(UserWarning, match="a.parquet: ") as said:
        loaded = Recording.load(tmp_path / "a.parquet")
    assert [("taken to be in ms" in str(one.message), "sorted" in str(one.message)) for one in said] == [
        (True, False),
        (False, True),
    ]
    np.testing.assert_allclose(loaded.time, EVERY * np.arange(6))
    np.testing.assert_array_equal(loaded.covariates["opening"], np.arange(6) + 0.5)
