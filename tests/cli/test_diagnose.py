"""``paxisim diagnose``."""

import json
import re
import sys

import pytest
from pressed_recording import pressed_recording

from paxisim.augment.chain import Chain
from paxisim.cli import main


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a recording of a sensor that reads the normal force 20 % too high."""
    monkeypatch.chdir(tmp_path)
    pressed_recording().save("a.mcap")
    return tmp_path


def test_it_prints_the_table_and_writes_the_files(folder, capsys):
    words = ["diagnose", "a.mcap", "-o", "out", "--causes", "axis_gain, rotation"]
    (folder / "out").mkdir()
    (folder / "out" / "model.json").write_text("mine", encoding="utf-8")
    assert main([*words, "--force"]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("Verdict: ")
    assert "axis_gain" in printed
    document = json.loads((folder / "out" / "diagnosis.json").read_text(encoding="utf-8"))
    assert [cause["name"] for cause in document["causes"]] == ["axis_gain"]
    gain = {p["name"]: p["value"]["value"] for p in document["causes"][0]["parameters"]}["gain_z"]
    assert gain == pytest.approx(1.2, abs=0.02)
    assert len(Chain.load("out/model.json")) == 1
    assert "out/report.html: the report with pictures" in printed
    assert '<section class="cause" id="axis_gain">' in (folder / "out" / "report.html").read_text(encoding="utf-8")


@pytest.mark.filterwarnings("always:report.html was not written")
def test_without_jinja2_there_is_a_warning_in_place_of_the_report(folder, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "jinja2", None)
    assert main(["diagnose", "a.mcap", "-o", "out", "--causes", "axis_gain"]) == 0
    said = capsys.readouterr()
    assert "out/diagnosis.json: " in said.out
    assert re.search(r"warning: report.html was not written: .*jinja2.*paxisim\[diagnose\]", said.err), said.err
    assert sorted(file.name for file in (folder / "out").iterdir()) == ["diagnosis.json", "model.json"]


@pytest.mark.parametrize("done", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_several_recordings_of_which_one_is_none(folder, capsys, done):
    (folder / "b.mcap").write_bytes(b"nothing")
    if done:  # the first is diagnosed already
        (folder / "out" / "a").mkdir(parents=True)
        (folder / "out" / "a" / "diagnosis.json").write_text("mine")
    assert main(["diagnose", "a.mcap", "b.mcap", "-o", "out", "--jobs", "2", "--causes", "axis_gain"]) == 2
    told = capsys.readouterr()
    first, second = sorted(told.out.splitlines())
    assert first.startswith("a.mcap: failed: out/a/" if done else "a.mcap: explained")
    assert ("--force" in first) is done
    assert second.startswith("b.mcap: failed: ")
    failed = "2 of 2 recordings could not be diagnosed: a.mcap, b.mcap" if done else "1 of 2 .*: b.mcap"
    assert re.search(failed, told.err), told.err
    assert [path.name for path in (folder / "out").iterdir()] == ["a"]
    assert ((folder / "out" / "a" / "diagnosis.json").read_text() == "mine") is done
