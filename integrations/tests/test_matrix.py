"""Matrices of cells: their order, the remaining commands, failing cells, and killed drivers and nodes."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from paxisim_insertion.results import Result
from paxisim_insertion.shell import command
from paxisim_lab.cells import Cell, read_cells
from paxisim_lab.matrix import matrix

import paxisim

INTEGRATIONS = Path(__file__).parents[1]
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


def words(file, *more, name=""):
    return [str(file), "--runs", str(file.parent / f"runs{name}"), "--out", str(file.parent / f"results{name}"), *more]


def test_the_order_of_cells(file):
    cells = read_cells(file)
    assert len(cells) == 8, "no duplicates"
    assert cells[:3] == [
        Cell("SX-2mm", "TF", 0, 40, trials=2),
        Cell("SY-2mm", "TF", 0, 20, trials=2),
        Cell("SX-2mm", "NT", 0, 40, trials=2),
    ]
    assert [cell.seed for cell in cells] == [0] * 4 + [1] * 4
    assert len(read_cells(INTEGRATIONS / "matrix.toml")) == 63


def test_the_sensors_of_cells(file, monkeypatch):
    monkeypatch.chdir(file.parent)
    paths = [file.parent / folder / "mine.json" for folder in ("a", "b")]
    for path in paths:
        path.parent.mkdir()
        paxisim.Chain([]).save(path)
    more = "seeds = [0]\nsensors = "
    file.write_text(TEXT.replace("seeds = [0]\n", f'{more}["reference:unit:7", "a/mine.json"]\n'))
    cell = read_cells(file)[0]
    assert cell.evaluations == {
        "sim": [],
        "transfer pads": ["--transfer", "pads"],
        "transfer surrogates": ["--transfer", "surrogates"],
        "surrogate reference-unit-7": ["--sensor", "reference:unit:7"],
        "surrogate mine": ["--sensor", str(paths[0])],
    }
    file.write_text(TEXT.replace("seeds = [0]\n", f"{more}{list(map(str, paths))}\n"))
    with pytest.raises(paxisim.InvalidValueError, match=r"a/mine.json and .*b/mine.json would have one name"):
        read_cells(file)
    file.write_text(TEXT.replace("seeds = [0]\n", f'{more}["none.json"]\n'))
    assert command(matrix, [str(file)]) == 2


def test_a_file_that_is_none(file):
    for before, after, told in (
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
    ):
        file.write_text(TEXT.replace(before, after))
        with pytest.raises(paxisim.PaxisimError, match=told):
            read_cells(file)


def test_what_is_left_of_a_cell(tmp_path):
    cell, runs, out = Cell("SX-2mm", "NT", 0, 40), tmp_path / "runs", tmp_path / "results"

    def saved(sensor, steps, **versions):
        Result("SX-2mm", "NT", sensor, 0, 50, 0.5, (0.4, 0.6), versions, {"steps": steps}).save(out)

    folder = str(runs / "SX-2mm_NT_0")
    train, *evaluations = cell.commands(runs, out)
    assert train[:5] == ["train", "--out", folder, "--steps", "40"]
    assert "--resume" not in train
    trials = ["--trials", "50"]
    pads, surrogates, drawn = ["--transfer", "pads"], ["--transfer", "surrogates"], ["--drawn"]
    assert [line[5:] for line in evaluations] == [trials, *([*trials, *more] for more in (pads, surrogates, drawn))]
    (runs / "SX-2mm_NT_0").mkdir(parents=True)
    (runs / "SX-2mm_NT_0" / "run.json").write_text("{}")
    saved("sim", 40)
    saved("transfer pads", 39)
    saved("transfer surrogates", 40)
    train, *evaluations = cell.commands(runs, out)
    assert train[-1] == "--resume"
    assert [line[7:] for line in evaluations] == [pads, drawn], "39 steps are too few"
    assert not cell.is_finished(out)
    saved("sim", 40, mujoco="3.0.0")
    assert not cell.has("sim", out), "another version made it"
    for sensor in ("sim", "transfer pads", "sim, drawn actions"):
        saved(sensor, 40)
    assert cell.is_finished(out)
    assert not replace(cell, trials=51).is_finished(out)


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
        "sensors = {'pads': 'transfer pads', 'surrogates': 'transfer surrogates', '--drawn': 'sim, drawn actions'}\n"
        "sensor = sensors.get(sys.argv[-1], 'sim')\n"
        "found = dict(task=task, method=method, sensor=sensor, seed=int(seed), trials=2, success_rate=0.5,\n"
        "    interval=[0, 1], versions={}, training={'steps': 40})\n"
        "out.mkdir(exist_ok=True)\n"
        "name = f'{task}_{method}_{sensor}_{seed}.json'.replace(' ', '-').replace(',', '')\n"
        "(out / name).write_text(json.dumps(found))\n"
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(map(str, (tmp_path, INTEGRATIONS))))
    report = str(tmp_path / "report.html")
    assert command(matrix, words(file, "--jobs", "2", "--report", report)) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 1
    assert "1 of 8 cells failed: SY-2mm TF seed 0" in told.err
    assert "8 cells, 0 of them finished" in told.out
    assert "SX-2mm NT seed 1: finished" in told.out
    assert "SY-2mm TF seed 0: train failed, see" in told.out
    assert "240 of 240 steps, 0.0 h left" in told.out
    assert "| NT | 0.94 /" in told.out, "the tables are printed at the end"
    assert "no such thing" in (tmp_path / "runs" / "SY-2mm_TF_0.log").read_text()
    assert "SY-2mm TF seed 0: train failed" in Path(report).read_text()
    (stand_in / "train.py").write_text("")
    assert command(matrix, words(file)) == 0
    assert "8 cells, 7 of them finished" in capsys.readouterr().out, "only the failed cell runs again"


def test_what_a_matrix_cannot_run_on(file, capsys, monkeypatch):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    for more, told in (
        (["--ray", f"127.0.0.1:{port}"], "no Ray cluster answers at 127.0.0.1:"),
        (["--ray", "nonsense"], "expected HOST:PORT"),
        (["--ray", "a:1", "b:2"], "expected one address"),
        (["--ray", "--jobs", "2"], "one of --jobs and --ray"),
        (["--jobs", "0"], "jobs must be at least 1"),
        (["--report", "report.txt"], "expected an HTML file"),
    ):
        if "127" in told:
            pytest.importorskip("ray")
        assert command(matrix, words(file, *more)) == 2
        error = capsys.readouterr().err
        assert told in error
        assert error.count("\n") == 1
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setitem(sys.modules, "ray", None)
    assert command(matrix, words(file, "--ray")) == 2
    assert "pip install 'paxisim[ray]'" in capsys.readouterr().err
    assert not (file.parent / "runs").exists()


def wait_for(condition, process):
    until = time.monotonic() + 120
    while not condition():
        assert process.poll() is None or process.returncode == -signal.SIGKILL
        assert time.monotonic() < until
        time.sleep(0.05)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_killed_matrix_leaves_no_training_behind_and_continues(file, monkeypatch):
    file.write_text(
        'trials = 1\n[steps]\n"SX-2mm" = 400\n'
        '[[cells]]\ntasks = ["SX-2mm"]\nmethods = ["TF"]\nseeds = [3]\nsensors = ["sim"]\n'
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    log = file.parent / "runs" / "SX-2mm_TF_3.log"
    driver = subprocess.Popen([sys.executable, "-m", "paxisim_lab.matrix", *words(file)])
    wait_for(lambda: log.exists() and "0 of 400 steps done" in log.read_text(), driver)
    threads = Path(f"/proc/{driver.pid}/task").glob("*/children")
    (training,) = " ".join(path.read_text() for path in threads).split()
    driver.send_signal(signal.SIGKILL)
    driver.wait()
    wait_for(lambda: not Path(f"/proc/{training}").exists(), driver)
    assert command(matrix, words(file)) == 0
    (found,) = (file.parent / "results").glob("*.json")
    result = Result.load(found)
    assert (result.method, result.seed, result.trials, result.training["steps"]) == ("TF", 3, 1, 400)
    assert log.read_text().count("of 400 steps done") == 2


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    ("size", "says"), [("400k", "was killed by SIGBUS (the disk of --runs is full)"), ("1200k", "failed")]
)
def test_a_full_disk_is_said_and_leaves_no_half_of_a_model(file, monkeypatch, capsys, size, says):
    file.write_text(
        'trials = 1\nsteps = {"SX-2mm" = 400}\n[[cells]]\ntasks = ["SX-2mm"]\nmethods = ["GCS"]\nseeds = [0]\n'
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    runs = file.parent / "runs"
    runs.mkdir()
    mount = [shutil.which("mount") or "false", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(runs)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("no file system can be mounted here")
    try:
        assert command(matrix, words(file)) == 2
        assert f"train {says}, see {runs / 'SX-2mm_GCS_0.log'}" in capsys.readouterr().out
        assert not [path.name for path in runs.rglob("*") if ".new" in path.name]
        if says == "failed":
            assert "No space left on device: " in (runs / "SX-2mm_GCS_0.log").read_text()
    finally:
        subprocess.run(["umount", str(runs)], check=True)


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # of Ray's own processes
def test_a_matrix_on_ray(file, monkeypatch, capsys):
    """On a node of one core, with the weights of a matrix without Ray; tests/test_ray_cluster.py kills nodes."""
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    file.write_text(
        'trials = 1\nsteps = {"SX-2mm" = 120}\n'
        '[[cells]]\ntasks = ["SX-2mm"]\nmethods = ["TF"]\nseeds = [0]\nsensors = ["sim"]\n'
    )
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))  # for the workers
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        assert command(matrix, words(file, "--ray", cluster.address)) == 0
    finally:
        cluster.shutdown()
    told = capsys.readouterr().out
    assert "Ray cluster with 1 cores" in told
    assert "120 of 120 steps, 0.0 h left" in told
    assert command(matrix, words(file, name="-serial")) == 0
    weights = [torch.load(file.parent / runs / "SX-2mm_TF_0" / "actor.pt")["actor"] for runs in ("runs", "runs-serial")]
    assert all(torch.equal(*(found[key] for found in weights)) for key in weights[0])
