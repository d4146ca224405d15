"""Matrices of cells: their order, the remaining commands, and failing cells."""

import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from paxisim_insertion import tied
from paxisim_insertion.cells import Cell, read_cells
from paxisim_insertion.matrix import matrix
from paxisim_insertion.results import Result
from paxisim_insertion.shell import command

import paxisim

TEXT = """
trials = 2

[steps]
"SX-2mm" = 40
"SY-2mm" = 20

[[cells]]
tasks = ["SX-2mm", "SY-2mm"]
methods = ["TF", "NT"]
seeds = [0, 1]

[[cells]]
tasks = ["SX-2mm"]
methods = ["TF"]
seeds = [0]
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "matrix.toml"
    path.write_text(TEXT)
    return path


def test_the_order_of_cells(file):
    cells = read_cells(file)
    assert len(cells) == 8, "no duplicates"
    assert cells[:3] == [
        Cell("SX-2mm", "TF", 0, 40, trials=2),
        Cell("SY-2mm", "TF", 0, 20, trials=2),
        Cell("SX-2mm", "NT", 0, 40, trials=2),
    ]
    assert [cell.seed for cell in cells] == [0] * 4 + [1] * 4


def test_two_sensors_of_one_name_are_refused(file):
    paths = [file.parent / folder / "unit.json" for folder in ("a", "b")]
    for path in paths:
        path.parent.mkdir()
        paxisim.Chain([]).save(path)
    text = TEXT.replace("seeds = [0]\n", f"seeds = [0]\nsensors = {list(map(str, paths))}\n")
    file.write_text(text)
    with pytest.raises(paxisim.InvalidValueError, match=r"a/unit.json and .*b/unit.json would have one name"):
        read_cells(file)


def saved(out, sensor, steps, **versions):
    Result("SX-2mm", "NT", sensor, 0, 50, 0.5, (0.4, 0.6), versions, {"steps": steps}).save(out)


def test_what_is_left_of_a_cell(tmp_path):
    cell, runs, out = Cell("SX-2mm", "NT", 0, 40), tmp_path / "runs", tmp_path / "results"
    folder = str(runs / "SX-2mm_NT_0")
    train, *evaluations = cell.commands(runs, out)
    assert train[:5] == ["train", "--out", folder, "--steps", "40"]
    assert "--resume" not in train
    assert [words[5:] for words in evaluations] == [
        ["--trials", "50"],
        ["--trials", "50", "--transfer"],
        ["--trials", "50", "--drawn"],
    ]
    (runs / "SX-2mm_NT_0").mkdir(parents=True)
    (runs / "SX-2mm_NT_0" / "run.json").write_text("{}")
    saved(out, "sim", 40)
    saved(out, "transfer", 39)
    train, *evaluations = cell.commands(runs, out)
    assert train[-1] == "--resume"
    assert [words[7:] for words in evaluations] == [["--transfer"], ["--drawn"]], "39 steps are too few"
    assert not cell.is_finished(out)
    saved(out, "sim", 40, mujoco="3.0.0")
    assert not cell.has("sim", out), "another version made it"
    saved(out, "sim", 40)
    saved(out, "transfer", 40)
    saved(out, "sim, drawn actions", 40)
    assert cell.is_finished(out)
    assert not replace(cell, trials=51).is_finished(out)


def test_the_sensors_of_cells(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    paxisim.Chain().save("mine.json")
    text = '[steps]\n"SX-2mm" = 40\n[[cells]]\ntasks = ["SX-2mm"]\nmethods = ["TF"]\nseeds = [0]\n'
    more = '[[cells]]\ntasks = ["SX-2mm"]\nmethods = ["TF"]\nseeds = [0]\nsensors = ["reference:unit:7", "mine.json"]\n'
    (tmp_path / "matrix.toml").write_text(text + more)
    (cell,) = read_cells(tmp_path / "matrix.toml")
    assert cell.evaluations == {
        "sim": [],
        "transfer": ["--transfer"],
        "surrogate reference-unit-7": ["--sensor", "reference:unit:7"],
        "surrogate mine": ["--sensor", str(tmp_path / "mine.json")],
    }
    (tmp_path / "matrix.toml").write_text(text + more.replace("unit:7", "unit:x"))
    with pytest.raises(paxisim.InvalidValueError, match="unit:x"):
        read_cells(tmp_path / "matrix.toml")
    (tmp_path / "matrix.toml").write_text(text + more.replace("mine.json", "none.json"))
    assert command(matrix, ["matrix.toml"]) == 2


def test_a_cell_that_fails_stops_no_other(file, tmp_path, monkeypatch, capsys):
    """The commands are stubs: one fails, the others write the requested result."""
    stand_in = tmp_path / "paxisim_insertion"
    stand_in.mkdir()
    (stand_in / "__init__.py").write_text("")
    shutil.copy(tied.__file__, stand_in)
    (stand_in / "train.py").write_text("import sys; sys.exit('SY-2mm_TF_0' in ' '.join(sys.argv) and 'no such thing')")
    (stand_in / "evaluate.py").write_text(
        "import json, pathlib, sys\n"
        "run, out = pathlib.Path(sys.argv[2]).name, pathlib.Path(sys.argv[4])\n"
        "task, method, seed = run.split('_')\n"
        "sensor = {'--transfer': 'transfer', '--drawn': 'sim, drawn actions'}.get(sys.argv[-1], 'sim')\n"
        "found = dict(task=task, method=method, sensor=sensor, seed=int(seed), trials=2, success_rate=0.5,\n"
        "    interval=[0, 1], versions={}, training={'steps': 40})\n"
        "out.mkdir(exist_ok=True)\n"
        "name = f'{task}_{method}_{sensor}_{seed}.json'.replace(' ', '-').replace(',', '')\n"
        "(out / name).write_text(json.dumps(found))\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    words = [str(file), "--runs", str(tmp_path / "runs"), "--out", str(tmp_path / "results"), "--jobs", "2"]
    assert command(matrix, words) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 1
    assert "1 of 8 cells failed: SY-2mm TF seed 0" in told.err
    assert "8 cells, 0 of them finished" in told.out
    assert "SX-2mm NT seed 1: finished" in told.out
    assert "SY-2mm TF seed 0: train failed, see" in told.out
    assert "240 of 240 steps, 0.0 h left" in told.out
    assert "| NT | 0.94 /" in told.out, "the tables are printed at the end"
    assert "no such thing" in (tmp_path / "runs" / "SY-2mm_TF_0.log").read_text()
    (stand_in / "train.py").write_text("")
    assert command(matrix, words) == 0
    assert "8 cells, 7 of them finished" in capsys.readouterr().out, "only the failed cell runs again"


@pytest.mark.timeout(300)
def test_a_killed_matrix_leaves_no_training_behind_and_continues(tmp_path, monkeypatch):
    path = tmp_path / "one.toml"
    path.write_text(
        'trials = 1\n[steps]\n"SX-2mm" = 400\n'
        '[[cells]]\ntasks = ["SX-2mm"]\nmethods = ["TF"]\nseeds = [3]\nsensors = ["sim"]\n'
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    words = [str(path), "--runs", str(tmp_path / "runs"), "--out", str(tmp_path / "results")]
    log = tmp_path / "runs" / "SX-2mm_TF_3.log"
    driver = subprocess.Popen([sys.executable, "-m", "paxisim_insertion.matrix", *words])
    wait_for(lambda: log.exists() and "0 of 400 steps done" in log.read_text())
    threads = Path(f"/proc/{driver.pid}/task").glob("*/children")
    (training,) = " ".join(path.read_text() for path in threads).split()
    driver.send_signal(signal.SIGKILL)
    driver.wait()
    wait_for(lambda: not Path(f"/proc/{training}").exists())
    assert command(matrix, words) == 0
    (found,) = (tmp_path / "results").glob("*.json")
    result = Result.load(found)
    assert (result.method, result.seed, result.trials, result.training["steps"]) == ("TF", 3, 1, 400)
    assert log.read_text().count("of 400 steps done") == 2


def wait_for(condition):
    until = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.05)


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ('"SX-2mm" = 40', '"SX-2mm" = 0', "expected an integer of at least 1"),
        ('"SX-2mm" = 40', '"SX-2mm" = 40.5', "expected an integer"),
        ("seeds = [0, 1]", "seeds = [-1]", "at least 0"),
        ("seeds = [0, 1]", "", "not a matrix"),
        ('"NT"', '"XX"', "unknown method"),
        ("trials = 2", "trials = 0", "at least 1"),
        ("seeds = [0, 1]", "seeds = [0]\nsensors = [3]", "name of a sensor"),
        ("seeds = [0, 1]", "seeds = [0]\nsensors = ['reference:unit:x']", "unit:x"),
        ('"SY-2mm" = 20', "", "'SY-2mm'"),
        ("[steps]", "[other]", "other"),
        ("[steps]", "steps", "not a matrix"),
    ],
)
def test_a_file_that_is_none(file, before, after, told):
    file.write_text(TEXT.replace(before, after))
    with pytest.raises(paxisim.PaxisimError, match=told):
        read_cells(file)
