"""``paxisim calibrate``."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from load_rig import NAMES, rig

from paxisim.cli import main
from paxisim.logs.columns import to_columns
from paxisim.recording import Recording

NAMED = [f"{name}={name}" for name in NAMES]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rig(seconds=20)[0].save("raw.mcap")
    return tmp_path


def test_one_command_from_raw_channels_to_a_calibrated_recording(capsys):
    assert main(["calibrate", "raw.mcap", "--loads", *NAMED, "-o", "calibrated.mcap"]) == 0
    out = capsys.readouterr().out
    delay = re.search(r"the channels follow the loads by ([\d.]+) ms, 95% interval ([\d.]+) to ([\d.]+) ms", out)
    assert [float(word) for word in delay.groups()] == pytest.approx([30, 30, 30], abs=0.5)
    assert "gains in uT per N" in out
    assert sum(line.startswith("0: 0,") for line in out.splitlines()) == 15
    assert max(map(len, out.splitlines())) <= 80
    ready = Recording.load("calibrated.mcap")
    assert (ready.measured - ready.simulated).std() < 0.03 * ready.simulated.std()
    assert len(np.unique(ready.episode)) > 3
    assert ready.metadata["readout"]["loads"] == {name: name for name in NAMES}
    for name in ("calibrated.png", "calibrated.residuals.png"):
        assert Path(name).read_bytes()[:4] == b"\x89PNG"


def test_a_table_of_raw_channels_and_loads_will_do():
    columns = to_columns(Recording.load("raw.mcap").to_arrays())
    rows = np.column_stack(list(columns.values()))
    np.savetxt("raw.csv", rows, delimiter=",", header=",".join(columns), comments="")
    assert main(["calibrate", "raw.csv", "--loads", *NAMES, "-o", "calibrated.npz", "--degree", "2"]) == 0
    assert Recording.load("calibrated.npz").simulated is not None


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--loads", "Fz=Fzz"], "unknown covariate 'Fzz'; did you mean 'Fz'"),
        (["--loads", "F=Fz"], "unknown load component 'F'"),
        (["--loads", "Fz=Fz", "Fx"], "COMPONENT=NAME for different components"),
        (["--loads", "Fz=Fz", "Fz=Fx"], "COMPONENT=NAME for different components"),
        (["--loads", "Fz="], "COMPONENT=NAME for different components"),
        (["--loads", "Fz", "--degree", "7"], "degree must be 1, 2 or 3"),
        (["--loads", "Fz", "-o", "a.csv"], "a calibration (.json) or a calibrated recording (.npz, .mcap), got a.csv"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(words, said, capsys, folder):
    output = [] if "-o" in words else ["-o", "a.npz"]
    assert main(["calibrate", "raw.mcap", *words, *output]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1
    assert sorted(path.name for path in folder.iterdir()) == ["raw.mcap"]


def test_nothing_is_overwritten_unasked(capsys):
    Path("a.png").write_text("mine", encoding="utf-8")
    assert main(["calibrate", "raw.mcap", "--loads", *NAMES, "-o", "a.npz"]) == 2
    assert "a.png exists; --force overwrites it" in capsys.readouterr().err
    assert not Path("a.npz").exists()


def test_without_matplotlib_there_is_no_picture_and_a_word(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(["calibrate", "raw.mcap", "--loads", *NAMES, "-o", "a.npz"]) == 0
    assert "no picture: plot_calibration needs matplotlib" in capsys.readouterr().out
    assert Path("a.npz").exists()
    assert not Path("a.png").exists()
