"""Reports of results: tables with intervals, differences from the paper, curves, pictures, touches."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from paxisim_insertion import InsertionEnv
from paxisim_insertion.curve import read_curve, write_curve
from paxisim_insertion.interpret import interpret, touches
from paxisim_insertion.pictures import pictures
from paxisim_insertion.rates import each_seed
from paxisim_insertion.results import Result, file_of
from paxisim_insertion.run import Run
from paxisim_insertion.shell import command
from paxisim_insertion.table import table
from paxisim_insertion.tasks import TASKS

import paxisim

POLICIES = Path(__file__).parents[1] / "policies"
BASE = Result("SX-2mm", "GCS", "sim", 0, 50, 0.9, (0.8, 0.96), {}, {"steps": 80_000, "cpu_seconds": 600})


@pytest.fixture
def folder(tmp_path):
    for result in (
        BASE,
        replace(BASE, seed=1, success_rate=0.7, training={"steps": 80_000, "cpu_seconds": 360}),
        replace(
            BASE, sensor="transfer", success_rate=0.6, parts={"zeroed in the grasp": (18, 20), "magnetic pad": (12, 30)}
        ),
        replace(BASE, task="SY-2mm", sensor="transfer", success_rate=0.7, parts={"magnetic pad": (35, 50)}),
        replace(BASE, method="NT", success_rate=0.0),
        replace(BASE, method="NT", sensor="sim, drawn actions", success_rate=0.1),
        replace(BASE, method="GCS w/o G", sensor="transfer", success_rate=0.5, parts={"magnetic pad": (25, 50)}),
        replace(BASE, method="GCS+O", sensor="surrogate 1", success_rate=1.0),
    ):
        result.save(tmp_path)
    return tmp_path


def test_tables_of_several_seeds(folder, capsys):
    table(folder)
    shown = capsys.readouterr().out.split("\n\n|")
    gcs = "| GCS | 1.00 / - | 0.90 / - | 0.84 / - | 0.98 / - | 0.98 / 0.80 (0.71 to 0.87) | 0.76 / - | 0.91 / - |"
    assert gcs in shown[1]
    assert "| NT | 0.94 / - | 0.82 / - | 0.60 / - | 0.56 / - | 0.42 / 0.10 (0.04 to 0.21) | 0.20 / - |" in shown[2]
    assert "0.90 / 0.60 (0.46 to 0.72) | 0.70 / 0.70 (0.56 to 0.81) | 0.80 / - |" in shown[3]
    assert "| GCS w/o G |  |  | 0.90 / - |  | 0.40 / 0.50 (0.37 to 0.63) | 0.00 / - |  |" in shown[4]
    assert "| GCS |  |  |  |  | 0.90, 0.70 |  |  |" in shown[5]
    assert "NT" not in shown[5], "methods with one seed are omitted"
    assert " method | magnetic pad | zeroed in the grasp |" in shown[6]
    assert "| GCS | 0.59 (0.48 to 0.69) | 0.90 (0.70 to 0.97) |" in shown[6]
    assert "| GCS+O |" in shown[7]
    assert "| GCS |" not in shown[7], "methods without results are omitted"
    assert "- sim, SX-2mm NT: 0.42 / 0.00 (0.00 to 0.07), p = " in shown[7]
    assert "- sim, SX-2mm GCS: 0.98 / 0.80 (0.71 to 0.87), p = 0.0021" in shown[7]
    assert "- transfer, SX-2mm GCS:" not in shown[7], "0.90 of ten and 0.60 of fifty do not differ significantly"
    assert "| GCS |  |  |  |  | 8 |  |" in shown[8]


def test_the_means_of_each_seed():
    rates = {0: (1.0, 0.9, 0.8, 0.7, 0.6, 0.5), 1: (0.5, 0.5, 0.5, 0.5, 0.5, 0.8), 2: (1.0, 1.0, 1.0)}
    found = [
        replace(BASE, task=task, seed=seed, success_rate=rate)
        for seed, row in reversed(rates.items())
        for task, rate in zip(TASKS, row, strict=False)
    ]
    (row,) = each_seed([*found, replace(BASE, method="NT")], "sim").values()
    assert row[:-1] == [[1.0, 0.5, 1.0], [0.9, 0.5, 1.0], [0.8, 0.5, 1.0], [0.7, 0.5], [0.6, 0.5], [0.5, 0.8]]
    assert row[-1] == pytest.approx([0.75, 0.55]), "seed 2 lacks three tasks"
    assert each_seed(found, "transfer") == {}


def test_a_result_is_read_as_it_was_written(folder):
    path = folder / file_of("SX-2mm", "GCS", "transfer", 0)
    result = Result.load(path)
    assert result.parts == {"zeroed in the grasp": (18, 20), "magnetic pad": (12, 30)}
    path.write_text(path.read_text().replace('"parts": {', '"parts": {"x": 3, '))
    with pytest.raises(paxisim.InvalidValueError, match="is not a result"):
        Result.load(path)


def test_a_curve_of_a_run_that_was_resumed(tmp_path):
    name = "time/total_timesteps,rollout/success_rate,train/ent_coef\n"
    for start, rows in ((0, "2400,0.0,1\n4800,0.1,0.9\n4900,,\n"), (4800, "7200,0.5,0.5\n")):
        (tmp_path / f"log_{start}").mkdir()
        (tmp_path / f"log_{start}" / "progress.csv").write_text(name + rows)
    points = read_curve(tmp_path)
    assert points == [(2400, 0.0), (4800, 0.1), (7200, 0.5)]
    write_curve(tmp_path, points)
    assert read_curve(tmp_path) == points
    many = [(step, step / 1e4) for step in range(0, 10_000, 7)]
    write_curve(tmp_path, many)
    thinned = read_curve(tmp_path)
    assert 100 <= len(thinned) <= 200
    assert set(thinned) <= set(many)
    (tmp_path / "curve.csv").write_text("time/total_timesteps,rollout/success_rate\nx,1\n")
    with pytest.raises(paxisim.InvalidValueError, match="not the log of a training"):
        read_curve(tmp_path)
    assert read_curve(tmp_path / "none") == []


def test_pictures(folder, tmp_path, capsys):
    words = ["--results", str(folder), "--out", str(tmp_path / "out"), "--policies", str(POLICIES), "--other-versions"]
    assert command(pictures, words) == 0
    for name in ("learning.png", "table.png"):
        assert (tmp_path / "out" / name).stat().st_size > 10_000
    capsys.readouterr()
    assert command(pictures, ["--policies", str(tmp_path / "out"), "--results", str(folder)]) == 2
    assert "no folders of runs" in capsys.readouterr().err


class Pushes:
    """A policy that pushes the peg gently straight down."""

    def act(self, observation):
        return np.array([0.0, -0.35], dtype=np.float32)


@pytest.mark.parametrize("task", ["SX-2mm", "SY-2mm"])
def test_what_the_pads_feel_on_either_rim(task):
    """The paper's "Policy Interpretation", for a peg pushed down on either rim."""
    env = InsertionEnv(task, "DT", engine="native", terminate_on_success=True)
    found = [touch for seed in range(25) for touch in touches(env, Pushes(), seed)]
    sides = {side: [touch for touch in found if np.sign(touch.aside) == side] for side in (-1, 1)}
    turns = {side: np.mean([touch.turn for touch in these], axis=0) for side, these in sides.items()}
    shifts = {side: np.mean([touch.shift for touch in these], axis=0) for side, these in sides.items()}
    assert all(abs(touch.aside) < 10e-3 for touch in found)
    if task == "SY-2mm":
        for side in (-1, 1):
            assert np.prod(turns[side]) < 0, "opposite on the two pads"
            assert np.abs(turns[side]).min() > 20
        # a push straight down drags along +x, which rotates the peg in the same sense on both rims
        assert turns[-1][0] > turns[1][0] + 40
        assert turns[-1][1] < turns[1][1] - 40
    else:
        assert (shifts[-1][0] - shifts[-1][1]) * (shifts[1][0] - shifts[1][1]) < 0
        assert min(shifts[-1].min(), shifts[1].min()) < -0.5, "down on one pad"
    env.close()


def test_an_interpretation_in_the_shell(tmp_path, capsys):
    words = ["--run", str(POLICIES / "SX-2mm_GCS_0"), "--trials", "2", "--other-versions"]
    assert command(interpret, words) == 0
    shown = capsys.readouterr().out
    assert "steps on a rim in 2 episodes" in shown
    assert command(interpret, [*words[:2], "--trials", "0"]) == 2
    Run(tmp_path, "SQ-2mm", "GCS").create()
    assert command(interpret, ["--run", str(tmp_path)]) == 2
    assert "expected a run on SX-2mm or SY-2mm" in capsys.readouterr().err
