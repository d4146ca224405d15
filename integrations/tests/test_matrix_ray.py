"""The matrix on Ray: two nodes, of which one is killed while its cell trains; clusters that cannot be used."""

import os
import socket
import subprocess
import sys
import time

import pytest
import torch
from paxisim_insertion.matrix import matrix
from paxisim_insertion.shell import command

TEXT = """
trials = 1
steps = {"SX-2mm" = 200}
[[cells]]
tasks = ["SX-2mm"]
methods = ["TF"]
seeds = [0, 1]
sensors = ["sim"]
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "matrix.toml"
    path.write_text(TEXT)
    return path


def words(file, *more, name=""):
    return [str(file), "--runs", str(file.parent / f"runs{name}"), "--out", str(file.parent / f"results{name}"), *more]


@pytest.fixture
def nodes(monkeypatch):
    """A cluster of two nodes on this machine, each with one core, with the modules of this process."""
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))  # for the workers
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        yield cluster, cluster.add_node(num_cpus=1)
    finally:
        cluster.shutdown()


@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # of Ray's own processes
def test_a_node_is_killed_while_its_cell_trains(nodes, file):
    cluster, second = nodes
    arguments = [sys.executable, "-m", "paxisim_insertion.matrix", *words(file, "--ray", cluster.address)]
    driver = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    logs = [file.parent / "runs" / f"SX-2mm_TF_{seed}.log" for seed in (0, 1)]
    until = time.monotonic() + 120
    while not all(log.exists() and "0 of 200 steps done" in log.read_text() for log in logs):
        assert driver.poll() is None, driver.stdout.read()
        assert time.monotonic() < until
        time.sleep(0.05)
    cluster.remove_node(second, allow_graceful=False)
    told, _ = driver.communicate(timeout=200)
    assert driver.returncode == 0, told
    assert "Ray cluster with 2 cores" in told
    assert "400 of 400 steps, 0.0 h left" in told
    starts = [log.read_text().count("of 200 steps done") for log in logs]
    assert sorted(starts) == [1, 2], "the cell of the killed node was resumed, the other was not disturbed"
    assert sorted(path.name for path in (file.parent / "results").iterdir()) == [
        "SX-2mm_TF_sim_0.json",
        "SX-2mm_TF_sim_1.json",
    ]
    undisturbed = starts.index(1)
    file.write_text(TEXT.replace("[0, 1]", f"[{undisturbed}]"))
    assert command(matrix, words(file, name="-serial")) == 0
    name = f"SX-2mm_TF_{undisturbed}"
    weights = [torch.load(file.parent / runs / name / "actor.pt")["actor"] for runs in ("runs", "runs-serial")]
    assert all(torch.equal(*(found[key] for found in weights)) for key in weights[0])


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (["--ray", "127.0.0.1:{port}"], "no Ray cluster answers at 127.0.0.1:"),
        (["--ray", "nonsense"], "expected HOST:PORT"),
        (["--ray", "a:1", "b:2"], "expected one address"),
        (["--ray", "--jobs", "2"], "one of --jobs and --ray"),
        (["--report", "report.txt"], "expected an HTML file"),
    ],
)
def test_what_a_matrix_cannot_run_on(file, capsys, more, told):
    if "{port}" in more[-1]:
        pytest.importorskip("ray")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            more = ["--ray", more[-1].format(port=free.getsockname()[1])]
    assert command(matrix, words(file, *more)) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert not (file.parent / "runs").exists()


def test_no_cluster_and_no_ray(file, capsys, monkeypatch):
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setitem(sys.modules, "ray", None)
    assert command(matrix, words(file, "--ray")) == 2
    assert "pip install 'paxisim[ray]'" in capsys.readouterr().err
