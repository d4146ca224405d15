"""``paxisim diagnose``."""

import json
import shutil
import sys

import pytest
from pressed_recording import pressed_recording

from paxisim.augment.chain import Chain
from paxisim.cli import main
from paxisim.cli.diagnose import diagnose
from paxisim.errors import InvalidValueError, OutputExistsError, UnknownNameError


@pytest.fixture
def path(tmp_path):
    """A recording of a sensor that reads the normal force 20 % too high."""
    pressed_recording().save(tmp_path / "a.mcap")
    return tmp_path / "a.mcap"


def test_it_prints_the_table_and_writes_the_files(path, capsys):
    out = path.parent / "out"
    diagnose((path,), out, causes="axis_gain, rotation")
    printed = capsys.readouterr().out
    assert printed.startswith("Verdict: ")
    assert "axis_gain" in printed
    document = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    assert [cause["name"] for cause in document["causes"]] == ["axis_gain"]
    gain = {p["name"]: p["value"]["value"] for p in document["causes"][0]["parameters"]}["gain_z"]
    assert gain == pytest.approx(1.2, abs=0.02)
    assert len(Chain.load(out / "model.json")) == 1
    assert f"{out / 'report.html'}: the report with pictures" in printed
    assert '<section class="cause" id="axis_gain">' in (out / "report.html").read_text(encoding="utf-8")


def test_without_jinja2_there_is_a_warning_in_place_of_the_report(path, capsys, monkeypatch):
    out = path.parent / "out"
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with pytest.warns(UserWarning, match=r"report.html was not written: .*jinja2.*paxisim\[diagnose\]"):
        diagnose((path,), out, causes="axis_gain")
    assert f"{out / 'diagnosis.json'}: " in capsys.readouterr().out
    assert sorted(file.name for file in out.iterdir()) == ["diagnosis.json", "model.json"]


def test_a_diagnosis_is_not_overwritten_unasked(path):
    out = path.parent / "out"
    out.mkdir()
    (out / "model.json").write_text("mine", encoding="utf-8")
    with pytest.raises(OutputExistsError, match="--force"):
        diagnose((path,), out)
    assert (out / "model.json").read_text(encoding="utf-8") == "mine"
    diagnose((path,), out, causes="axis_gain", force=True)
    assert (out / "model.json").read_text(encoding="utf-8") != "mine"


def test_bad_input_leaves_nothing(path):
    out = path.parent / "out"
    with pytest.raises(UnknownNameError):
        diagnose((path,), out, causes="nothing")
    with pytest.raises(InvalidValueError, match="is a file"):
        diagnose((path,), path)
    with pytest.raises(InvalidValueError, match="does not exist"):
        diagnose((path,), path.parent / "no" / "out")
    with pytest.raises(FileNotFoundError):
        diagnose((path.parent / "no.mcap",), out)
    assert not out.exists()


def test_several_recordings_of_which_one_is_none(path, capsys):
    (path.parent / "b.mcap").write_bytes(b"nothing")
    shutil.copy(path, path.parent / "c.mcap")
    out = path.parent / "out"
    words = ["diagnose", *(str(path.parent / f"{name}.mcap") for name in "abc"), "-o", str(out), "--jobs", "2"]
    assert main([*words, "--causes", "axis_gain"]) == 2
    told = capsys.readouterr()
    lines = sorted(told.out.splitlines())
    assert len(lines) == 3
    assert lines[0].startswith(f"{path}: explained")
    assert "b.mcap: failed: " in lines[1]
    assert f"1 of 3 recordings could not be diagnosed: {path.parent / 'b.mcap'}" in told.err
    assert sorted(folder.name for folder in out.iterdir()) == ["a", "c"]
    assert (out / "a" / "diagnosis.json").read_bytes() == (out / "c" / "diagnosis.json").read_bytes()


def test_several_recordings_of_one_name(path, tmp_path):
    with pytest.raises(InvalidValueError, match="two recordings are named a"):
        diagnose((path, tmp_path / "other" / "a.npz"), tmp_path / "out")
    with pytest.raises(InvalidValueError, match="expected a recording"):
        diagnose((), tmp_path / "out")
    assert not (tmp_path / "out").exists()
