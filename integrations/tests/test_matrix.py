"""Matrices of cells: their order, the remaining commands, and failing cells."""

import sys

import pytest
from paxisim_insertion import matrix as module
from paxisim_insertion.matrix import Cell, matrix, read_cells
from paxisim_insertion.results import Result
from paxisim_insertion.shell import command

import paxisim

TEXT = """
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
    assert cells[:3] == [Cell("SX-2mm", "TF", 0, 40), Cell("SY-2mm", "TF", 0, 20), Cell("SX-2mm", "NT", 0, 40)]
    assert [cell.seed for cell in cells] == [0] * 4 + [1] * 4


def saved(out, sensor, steps):
    Result("SX-2mm", "NT", sensor, 0, 50, 0.5, (0.4, 0.6), {}, {"steps": steps}).save(out)


def test_what_is_left_of_a_cell(tmp_path):
    cell, runs, out = Cell("SX-2mm", "NT", 0, 40), tmp_path / "runs", tmp_path / "results"
    folder = str(runs / "SX-2mm_NT_0")
    train, *evaluations = cell.commands(runs, out)
    assert train[:5] == ["train", "--out", folder, "--steps", "40"]
    assert "--resume" not in train
    assert [words[5:] for words in evaluations] == [[], ["--transfer"], ["--drawn"]]
    (runs / "SX-2mm_NT_0").mkdir(parents=True)
    (runs / "SX-2mm_NT_0" / "run.json").write_text("{}")
    saved(out, "sim", 40)
    saved(out, "transfer", 39)
    train, *evaluations = cell.commands(runs, out)
    assert train[-1] == "--resume"
    assert [words[5:] for words in evaluations] == [["--transfer"], ["--drawn"]], "39 steps are too few"
    assert not cell.is_finished(out)
    saved(out, "transfer", 40)
    saved(out, "sim, drawn actions", 40)
    assert cell.is_finished(out)


def test_a_cell_that_fails_stops_no_other(file, tmp_path, monkeypatch, capsys):
    """The commands are stubs: one fails, the others write the requested result."""
    stand_in = tmp_path / "paxisim_insertion"
    stand_in.mkdir()
    (stand_in / "__init__.py").write_text("")
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


def test_a_cell_is_trained_and_evaluated(tmp_path, capsys, monkeypatch):
    path = tmp_path / "one.toml"
    path.write_text('[steps]\n"SX-2mm" = 20\n[[cells]]\ntasks = ["SX-2mm"]\nmethods = ["TF"]\nseeds = [3]\n')
    monkeypatch.setenv("PYTHONPATH", ":".join(sys.path))
    monkeypatch.setattr(module, "EVALUATIONS", {"sim": ["--trials", "1"]})
    assert command(matrix, [str(path), "--runs", str(tmp_path / "runs"), "--out", str(tmp_path / "results")]) == 0
    (found,) = (tmp_path / "results").glob("*.json")
    result = Result.load(found)
    assert (result.method, result.seed, result.training["steps"]) == ("TF", 3, 20)


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ('"SX-2mm" = 40', '"SX-2mm" = 0', "expected an integer of at least 1"),
        ('"SX-2mm" = 40', '"SX-2mm" = 40.5', "expected an integer"),
        ("seeds = [0, 1]", "seeds = [-1]", "at least 0"),
        ("seeds = [0, 1]", "", "not a matrix"),
        ('"NT"', '"XX"', "unknown method"),
        ('"SY-2mm" = 20', "", "'SY-2mm'"),
        ("[steps]", "[other]", "other"),
        ("[steps]", "steps", "not a matrix"),
    ],
)
def test_a_file_that_is_none(file, before, after, told):
    file.write_text(TEXT.replace(before, after))
    with pytest.raises(paxisim.PaxisimError, match=told):
        read_cells(file)
