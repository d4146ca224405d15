"""What the laboratory shows of results: tables, curves, pictures, the report, costs, touches and films."""

import re
import shutil
import xml.dom.minidom
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from paxisim_insertion import TASKS, InsertionEnv
from paxisim_insertion.results import Result
from paxisim_insertion.shell import command
from paxisim_lab.cells import Cell
from paxisim_lab.cost import cost, schedule, seconds_of
from paxisim_lab.curves import draw_svg, method_colours, read_curve, read_curves, shipped_curves
from paxisim_lab.interpret import interpret, touches
from paxisim_lab.loads import loads
from paxisim_lab.matrix import matrix
from paxisim_lab.pictures import pictures
from paxisim_lab.play import play, write_film
from paxisim_lab.rates import RESULTS
from paxisim_lab.table import table
from PIL import Image

import paxisim

POLICIES = Path(__file__).parents[1] / "policies"
LOG = "time/total_timesteps,rollout/success_rate,train/ent_coef\n"


def test_one_s_own_results_are_tabulated_with_those_of_the_package(tmp_path, monkeypatch, capsys):
    """All tables of the package's results are compared with the README in test_pages.py."""
    monkeypatch.chdir(tmp_path)
    table()
    shipped, second = (Result.load(RESULTS / f"SX-2mm_GCS_sim_{seed}.json") for seed in (0, 1))
    assert f" 0.98 / {(shipped.success_rate + second.success_rate) / 2:.2f} (" in capsys.readouterr().out
    for seed, rate in enumerate((0.0, 0.9, 0.6)):
        replace(shipped, seed=seed, success_rate=rate).save()
    table()
    before = capsys.readouterr().out
    assert " 0.98 / 0.50 (0.42 to 0.58)" in before, "they take precedence, and the table pools the seeds"
    each = before[before.index("Simulation, each seed") :]
    assert "| 0.00, 0.90, 0.60 |" in each[: each.index("\n\n", each.index("| GCS |"))]
    replace(shipped, method="CoP", sensor="surrogate 1", success_rate=0.98).save()
    replace(shipped, method="CoP", sensor="surrogate 1", seed=1, success_rate=0.0).save()
    tried = {**shipped.training, "steps": 1000}
    replace(shipped, seed=9, success_rate=0.0, training=tried).save()
    replace(shipped, seed=8, success_rate=0.0, versions={**shipped.versions, "mujoco": "3.0.0"}).save()
    table()
    mixed, left_out = capsys.readouterr().out.split("\nLeft out")
    title = "Paper's real robot / our surrogate 1"
    surrogates = mixed[mixed.index(title) : mixed.index("\nWhere ours differs")]
    assert "| CoP |  |  |  |  | - / 0.49 (0.39 to 0.59) |  |  |" in surrogates
    assert "| GCS |" not in surrogates, "methods without results are omitted"
    assert mixed.replace(surrogates, "").split() == before.split(), "the other tables stay as they are"
    assert "SX-2mm GCS, sim, seed 9: steps 1000\n" in left_out
    assert "SX-2mm GCS, sim, seed 8: mujoco 3.0.0\n" in left_out
    assert command(table, ["--results", str(tmp_path / "none")]) == 2
    assert "has no results" in capsys.readouterr().err


def log(run, start, rows):
    (run / f"log_{start}").mkdir(parents=True)
    (run / f"log_{start}" / "progress.csv").write_text(LOG + rows)


def test_learning_curves(tmp_path):
    log(tmp_path / "resumed", 0, "2400,0.0,1\n4800,0.1,0.9\n4900,,\n")
    log(tmp_path / "resumed", 4800, "7200,0.5,0.5\n")
    assert read_curve(tmp_path / "resumed") == [(2400, 0.0), (4800, 0.1), (7200, 0.5)]
    assert read_curve(tmp_path / "none") == []
    log(tmp_path / "wrong", 0, "x,1,1\n")
    with pytest.raises(paxisim.InvalidValueError, match="not the log of a training"):
        read_curve(tmp_path / "wrong")
    for seed, top in enumerate((0.4, 0.8)):
        log(tmp_path / f"{seed}", 0, f"10,0.0,1\n{60 + 40 * seed},{top},1\n")
    curves = read_curves([("SX-2mm", "DT", tmp_path / name) for name in ("0", "1", "none")])
    assert list(curves) == ["SX-2mm"]
    assert [len(points) for points in curves["SX-2mm"]["DT"]] == [2, 2]
    svg = draw_svg(curves["SX-2mm"], method_colours(["DT"]))
    assert "PolyCollection" in svg, "the band of two seeds"
    xml.dom.minidom.parseString(svg)
    shipped = shipped_curves()
    assert sum(len(seeds) for methods in shipped.values() for seeds in methods.values()) == 63
    assert list(shipped) == list(TASKS)


class Page(HTMLParser):
    """The tags that a page opens and does not close, and the addresses that it fetches."""

    def __init__(self, text):
        super().__init__()
        self.open, self.fetched, self.words = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        if tag not in ("meta", "link", "br"):
            self.open.append(tag)
        self.fetched += [value for name, value in attrs if name in ("src", "href", "xlink:href")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words += data.split()


def test_the_report_of_the_shipped_results(tmp_path, capsys):
    pytest.importorskip("jinja2")
    (tmp_path / "matrix.toml").write_text(
        '[steps]\n"SX-2mm" = 80_000\n"SY-2mm" = 100_000\n'
        '[[cells]]\ntasks = ["SX-2mm", "SY-2mm"]\nmethods = ["GCS", "DT"]\nseeds = [0]\nsensors = ["sim"]\n'
    )
    report, results = tmp_path / "new" / "report.html", tmp_path / "results"
    results.mkdir()
    for path in RESULTS.glob("*_0.json"):
        shutil.copy(path, results)
    for cell in ("SX-2mm_GCS_0", "SY-2mm_DT_0"):
        log(tmp_path / "runs" / cell, 0, "10,0.0,1\n60,0.5,1\n")
    words = [str(tmp_path / "matrix.toml"), "--runs", str(tmp_path / "runs"), "--out", str(results)]
    assert command(matrix, [*words, "--report", str(report)]) == 0
    assert str(report) in capsys.readouterr().out
    text = report.read_text()
    page = Page(text)
    assert page.open == []
    assert all(address.startswith(("data:", "#")) for address in page.fetched), "the page needs no other file"
    told = " ".join(page.words)
    assert "4 of 4 cells are finished" in told
    assert "0.90 0.79 to 0.96 paper 0.76" in told, "GCS on SY-2mm in simulation"
    assert "sim, SY-2mm DT: 1.00 where the paper has 0.84" in told
    assert "GCS 18 26 25 26 10 13" in told, "minutes of a training"
    assert len(re.findall(r"<svg.*?</svg>", text, re.DOTALL)) == 2, "SX-2mm and SY-2mm"


def test_the_cost_of_a_matrix(tmp_path, capsys):
    found = [Result.load(path) for path in sorted(RESULTS.glob("S[XY]-2mm_*_sim_0.json"))]
    assert seconds_of(Cell("SX-2mm", "DT", 5, 40_000), found) == pytest.approx(535 / 2), "of the same task and method"
    others = [535 / 80_000, 680 / 100_000]
    assert seconds_of(Cell("SQ-1mm", "DT", 5, 100), found) == pytest.approx(100 * sum(others) / 2), "of the same method"
    assert schedule([3600.0, 7200.0, 3600.0], 2) == 7200
    file = str(POLICIES.parent / "matrix.toml")
    for wrong in (["--seeds", "0"], ["--cores", "0"], ["--results", str(tmp_path / "none")]):
        assert command(cost, [file, *wrong]) == 2
    assert "train and evaluate a cell first" in capsys.readouterr().err


def test_pictures(tmp_path):
    assert command(pictures, ["--results", str(RESULTS), "--out", str(tmp_path / "out")]) == 0
    for name in ("learning.png", "learning-dark.png", "table.png", "table-dark.png"):
        assert (tmp_path / "out" / name).stat().st_size > 10_000


class Pushes:
    """A policy that pushes the peg gently straight down."""

    def act(self, observation):
        return np.array([0.0, -0.35], dtype=np.float32)


@pytest.mark.parametrize("task", ["SX-2mm", "SY-2mm"])
def test_what_the_pads_feel_on_either_rim(task):
    """The paper's "Policy Interpretation", for a peg pushed down on either rim."""
    env = InsertionEnv(task, "DT", engine="native", terminate_on_success=True)
    found = [touch for seed in range(12) for touch in touches(env, Pushes(), seed)]
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


def test_an_interpretation_in_the_shell(capsys):
    words = ["--run", str(POLICIES / "SX-2mm_GCS_0"), "--trials"]
    assert command(interpret, [*words, "2"]) == 0
    assert "steps on a rim in 2 episodes" in capsys.readouterr().out
    assert command(interpret, [*words, "0"]) == 2
    assert command(interpret, ["--run", str(POLICIES / "SQ-2mm_GCS_0")]) == 2
    assert "expected a run on SX-2mm or SY-2mm" in capsys.readouterr().err


def test_bumps_load_the_taxels_of_a_stiff_gel_unevenly(capsys):
    """At the tasks' grip, the loads vary by a tenth of their mean on the soft gel and by a quarter on a stiff one."""
    spreads = []
    for modulus in ("100e3", "0.7e6"):
        gel = ["--parameters.gel-modulus", modulus]
        assert command(loads, ["--task", "SX-2mm", "--methods", "GCS", "--episodes", "3", *gel]) == 0
        rows = [line.split("|")[1:-1] for line in capsys.readouterr().out.splitlines()[2:]]
        assert [row[0].strip() for row in rows] == ["training, GCS", "transfer pads", "transfer surrogates"]
        spreads.append([float(row[1]) for row in rows])
    (soft, pads, surrogates), (stiff, same_pads, stiffer) = spreads
    assert 0.05 < soft < 0.13 < 0.17 < stiff < 0.35
    assert surrogates < stiffer
    assert pads == same_pads, "they have gels of their own"
    assert command(loads, ["--episodes", "0"]) == 2


def test_films(tmp_path, capsys):
    pictures = np.zeros((12, 96, 192, 3), dtype=np.uint8)
    for index, picture in enumerate(pictures):  # a bright square that moves to the right
        picture[30:60, 10 * index : 10 * index + 30] = (250, 120, 20)
    for suffix in ("gif", "webp"):
        write_film(tmp_path / f"film.{suffix}", iter(pictures), 20)
        with Image.open(tmp_path / f"film.{suffix}") as film:
            assert (film.size, film.n_frames) == ((96, 48), 12)
            film.seek(11)
            last = np.asarray(film.convert("RGB"))
        assert last[22, 62, 0] > 150
        assert last[22, 10, 0] < 100
    words = ["--run", str(POLICIES / "SX-2mm_GCS_0"), "--out"]
    for name, told in (("film.avi", "ends with one of .webp, .gif"), ("film.gif", "exists already")):
        assert command(play, [*words, str(tmp_path / name)]) == 2
        assert told in capsys.readouterr().err
