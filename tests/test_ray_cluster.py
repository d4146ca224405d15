"""RayCluster, `paxisim diagnose --ray` and the benchmark of hidden effects, on a real cluster on this machine."""

import os
import platform
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from pressed_recording import pressed_recording

from paxisim.cli import main

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
pytestmark = pytest.mark.timeout(300)
leaves_processes = pytest.mark.filterwarnings("ignore::ResourceWarning")  # of Ray's own processes

JOBS = """
import os, signal, sys
from functools import partial
from pathlib import Path
import paxisim

def work(job, folder):
    tries = folder / f"{job}.txt"
    first = not tries.exists()
    with tries.open("a") as file:
        file.write("x")
    if job == "hidden" and first:  # as on a node that does not share the folder
        for mark in folder.glob(".paxisim-*"):
            mark.unlink()
    if job in ("killed", "hidden") and first:
        os.kill(os.getpid(), signal.SIGKILL)
    if job == "refused":
        raise paxisim.InvalidValueError("expected a load")
    if job == "broken":
        raise ZeroDivisionError("no load")
    return f"{job} with {os.environ['OMP_NUM_THREADS']} thread"

folder = Path("folder").resolve()
for jobs in sys.argv[2:]:
    cluster = paxisim.RayCluster(sys.argv[1])
    print(cluster.cores, "cores")
    for job, found in cluster.run(partial(work, folder=folder), jobs.split(","), [folder, Path(sys.argv[0])]):
        print("found", job, type(found).__name__, found, sep=": ")
"""

HIDDEN = """
import argparse, sys
from dataclasses import replace
import harness
from hidden_table.cases import solve, tasks

(task,) = tasks({"single": 1}, 77)
small = {"rows": 4, "cols": 3, "duration": 6.0, "rate": 20}
task = replace(task, options=(*task.options, *small.items()))
parser = argparse.ArgumentParser()
harness.add_options(parser)
(alone,) = harness.run(solve, [task], parser.parse_args([]))
(outcome,) = harness.run(solve, [task], parser.parse_args(["--ray", sys.argv[1]]))
assert outcome.verdict not in ("refused", "crashed")
same = [replace(o, memory=0, seconds=0) for o in (alone, outcome)]
assert same[0] == same[1], same
"""


@pytest.fixture(scope="module")
def address():
    """The address of a cluster with two cores on this machine, with the modules of this process."""
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join(sys.path))  # for the workers
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 2, "include_dashboard": False})
        try:
            yield cluster.address
        finally:
            cluster.shutdown()


def told(*words, folder):
    """Run Python with these words and return its status and both outputs."""
    done = subprocess.run([sys.executable, *words], cwd=folder, capture_output=True, text=True, timeout=280)
    return done.returncode, done.stdout, done.stderr


def run_jobs(address, folder, *jobs):
    """Run groups of jobs on the cluster; return what was found, sorted, and how often each job began."""
    (folder / "jobs.py").write_text(JOBS)
    (folder / "folder").mkdir()
    status, out, err = told("jobs.py", address, *jobs, folder=folder)
    assert status == 0, err
    assert out.count("2 cores\n") == len(jobs)
    tries = {path.stem: path.read_text() for path in (folder / "folder").iterdir()}
    return sorted(line for line in out.splitlines() if line.startswith("found: ")), tries  # Ray tells of its retries


BROKEN = "found: broken: PaxisimError: failed on Ray: ZeroDivisionError: no load"
REFUSED = "found: refused: InvalidValueError: expected a load"


@leaves_processes
def test_jobs_that_fail_stop_no_other(address, tmp_path):
    found, tries = run_jobs(address, tmp_path, "good,refused,broken")
    assert found == [BROKEN, "found: good: str: good with 1 thread", REFUSED]
    assert tries == {"good": "x", "refused": "x", "broken": "x"}


@pytest.mark.slow
@leaves_processes
def test_jobs_that_are_killed_run_again(address, tmp_path):
    found, tries = run_jobs(address, tmp_path, "killed,refused,broken", "hidden")
    blind = found.pop(1)
    assert blind.startswith(f"found: hidden: InvalidValueError: the node {platform.node()} does not see {tmp_path}")
    assert found == [BROKEN, "found: killed: str: killed with 1 thread", REFUSED]
    assert tries == {"killed": "xx", "refused": "x", "broken": "x", "hidden": "x"}


@pytest.mark.slow
@leaves_processes
def test_recordings_on_ray_have_the_same_diagnoses_as_here(address, tmp_path, capsys):
    pressed_recording().save(tmp_path / "a.mcap")
    (tmp_path / "b.mcap").write_bytes(b"nothing")
    names = ["a.mcap", "b.mcap", "c.mcap"]
    words = ["-m", "paxisim", "diagnose", *names, "-o", "out", "--causes", "axis_gain", "--ray", address]
    status, out, err = told(*words, folder=tmp_path)
    assert status == 2
    assert err.count("\n") == 1
    assert f"2 of 3 recordings could not be diagnosed: {tmp_path / 'b.mcap'}" in err.replace(str(tmp_path / "c"), "")
    lines = sorted(out.splitlines())
    assert "b.mcap: failed: " in lines[1]
    assert f"does not see {tmp_path / 'c.mcap'}: check its name" in lines[2]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a"]

    here = ["diagnose", *(str(tmp_path / name) for name in names[:2]), "-o", str(tmp_path / "here")]
    assert main([*here, "--causes", "axis_gain", "--jobs", "2"]) == 2
    assert [line.replace("here", "out") for line in sorted(capsys.readouterr().out.splitlines())] == lines[:2]
    for name in ("diagnosis.json", "model.json"):
        assert (tmp_path / "out" / "a" / name).read_bytes() == (tmp_path / "here" / "a" / name).read_bytes()

    status, out, _ = told(*words, folder=tmp_path)
    assert status == 2
    assert f"a.mcap: failed: {tmp_path / 'out' / 'a' / 'report.html'} exists; --force overwrites it\n" in out


@pytest.mark.slow
@leaves_processes
def test_a_case_of_the_benchmark_has_the_same_outcome_as_here(address):
    status, _, err = told("-c", HIDDEN, address, folder=BENCHMARKS)
    assert status == 0, err


@pytest.mark.parametrize(
    ("options", "error"),
    [
        (["a", "b", "--ray", "127.0.0.1:{port}"], "no Ray cluster answers at 127.0.0.1:"),
        (["a", "b", "--ray", "nonsense"], "expected HOST:PORT"),
        (["a", "b", "--ray", "a:1", "b:2"], "expected one address"),
        (["a", "b", "--ray", "--jobs", "2"], "one of --jobs and --ray"),
        (["a", "--ray"], "expected several recordings"),
    ],
)
def test_a_cluster_that_cannot_be_used_is_one_line_and_leaves_nothing(tmp_path, capsys, options, error):
    pytest.importorskip("ray")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    words = [word.format(port=port) for word in options]
    assert main(["diagnose", *words, "-o", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert error in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_without_ray_the_error_names_the_extra(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    assert main(["diagnose", "a.mcap", "b.mcap", "-o", str(tmp_path / "out"), "--ray"]) == 2
    assert "pip install 'paxisim[ray]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
