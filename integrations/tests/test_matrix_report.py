"""The report of a matrix, and what a matrix costs."""

import re
import shutil
import xml.dom.minidom
from html.parser import HTMLParser
from pathlib import Path

import pytest
from paxisim_insertion.cells import Cell
from paxisim_insertion.cost import cost, schedule, seconds_of
from paxisim_insertion.curve_figure import curve_svgs, method_colours
from paxisim_insertion.matrix import matrix
from paxisim_insertion.results import RESULTS, Result
from paxisim_insertion.shell import command

ROOT = Path(__file__).parents[1]
SHIPPED = """
[steps]
"SX-2mm" = 80_000
"SY-2mm" = 100_000
[[cells]]
tasks = ["SX-2mm", "SY-2mm"]
methods = ["GCS", "DT"]
seeds = [0]
"""


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


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "matrix.toml"
    path.write_text(SHIPPED)
    return path


def test_the_report_of_the_shipped_results(file, capsys):
    pytest.importorskip("jinja2")
    report, results = file.parent / "new" / "report.html", file.parent / "results"
    results.mkdir()
    for path in RESULTS.glob("*_0.json"):
        shutil.copy(path, results)
    words = [str(file), "--runs", str(ROOT / "policies"), "--out", str(results), "--report", str(report)]
    assert command(matrix, words) == 0
    assert str(report) in capsys.readouterr().out
    text = report.read_text()
    page = Page(text)
    assert page.open == []
    assert all(address.startswith(("data:", "#")) for address in page.fetched), "the page needs no other file"
    told = " ".join(page.words)
    assert "4 of 4 cells are finished" in told
    assert "0.96 0.87 to 0.99 paper 0.76" in told, "GCS on SY-2mm in simulation"
    assert "sim, SY-2mm GCS: 0.96 where the paper has 0.76" in told
    assert "Learning curves SX-2mm" not in told, "there is a legend in between"
    svgs = re.findall(r"<svg.*?</svg>", text, re.DOTALL)
    assert len(svgs) == 2, "SX-2mm and SY-2mm"
    for svg in svgs:
        xml.dom.minidom.parseString(svg)
    before = report.read_bytes()
    assert command(matrix, words) == 0
    assert report.read_bytes() == before


def test_a_report_without_results(file):
    pytest.importorskip("jinja2")
    report, runs = file.parent / "report.html", file.parent / "runs"
    (runs / "SX-2mm_DT_0").mkdir(parents=True)
    (runs / "SX-2mm_DT_0" / "run.json").write_text("not <json>")
    text = SHIPPED.replace(', "SY-2mm"', "").replace('"GCS", ', "")
    file.write_text(text)
    words = [str(file), "--runs", str(runs), "--out", str(file.parent / "none"), "--report", str(report)]
    assert command(matrix, words) == 2
    told = " ".join(Page(report.read_text()).words)
    assert "0 of 1 cells" in told
    assert "1 cell failed." in told
    assert "SX-2mm DT seed 0: train failed, see" in told
    assert "There are no results yet." in told


def test_the_curves_of_several_seeds(tmp_path):
    cells = [Cell("SX-2mm", "DT", seed, 100) for seed in (0, 1, 2)]
    for cell in cells[:2]:
        (tmp_path / cell.folder).mkdir()
        rows = "".join(f"{1000 * step},{step / (10 + cell.seed)}\n" for step in range(1 + cell.seed, 9))
        (tmp_path / cell.folder / "curve.csv").write_text("time/total_timesteps,rollout/success_rate\n" + rows)
    drawn = curve_svgs(cells, tmp_path, method_colours(["DT"]))
    assert list(drawn) == ["SX-2mm"]
    assert "PolyCollection" in drawn["SX-2mm"], "the band of two seeds"


def test_the_cost_of_a_matrix(file, capsys):
    found = [Result.load(path) for path in sorted(RESULTS.glob("S[XY]-2mm_*_sim_0.json"))]
    assert seconds_of(Cell("SX-2mm", "DT", 5, 40_000), found) == pytest.approx(358 / 2), "of the same task and method"
    others = [358 / 80_000, 435 / 100_000]
    assert seconds_of(Cell("SQ-1mm", "DT", 5, 100), found) == pytest.approx(100 * sum(others) / 2), "of the same method"
    told = schedule([3600.0, 7200.0, 3600.0], 2)
    assert (told.hours, told.used) == (2.0, 1.0)
    assert schedule([3600.0, 7200.0], 4).used == pytest.approx(3 / 8)
    assert command(cost, [str(file), "--seeds", "10", "--cores", "1", "--results", str(RESULTS)]) == 0
    assert "120 cells," in capsys.readouterr().out, "two tasks by six methods by ten seeds"
    assert command(cost, [str(file), "--seeds", "0"]) == 2
    assert command(cost, [str(file), "--results", str(file.parent / "none")]) == 2
    assert "train and evaluate a cell first" in capsys.readouterr().err
