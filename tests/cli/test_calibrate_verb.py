"""``paxisim calibrate``."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
from load_rig import NAMES, rig

from paxisim.cli import main
from paxisim.logs.columns import to_columns
from paxisim.recording import Recording


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rig(seconds=20)[0].save("raw.mcap")
    return tmp_path


def test_one_command_from_raw_channels_to_a_calibrated_recording(capsys):
    named = [f"{name}={name}" for name in NAMES]
    assert main(["calibrate", "raw.mcap", "--loads", *named, "-o", "calibrated.mcap"]) == 0
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


def test_a_table_will_do_and_without_matplotlib_there_is_no_picture_and_a_word(capsys, monkeypatch):
    columns = to_columns(Recording.load("raw.mcap").to_arrays())
    rows = np.column_stack(list(columns.values()))
    np.savetxt("raw.csv", rows, delimiter=",", header=",".join(columns), comments="")
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(["calibrate", "raw.csv", "--loads", *NAMES, "-o", "calibrated.npz", "--degree", "2"]) == 0
    assert "no picture: plot_calibration needs matplotlib" in capsys.readouterr().out
    assert Recording.load("calibrated.npz").simulated is not None
    assert not Path("calibrated.png").exists()
