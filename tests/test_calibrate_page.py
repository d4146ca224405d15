"""The calibration page runs as printed."""

import re
from pathlib import Path

import pytest
from load_rig import rig

from paxisim.cli import main
from paxisim.hw.emulation.emulator import Emulator
from paxisim.recording import Recording

PAGE = Path(__file__).parents[1] / "docs" / "guides" / "calibrate.md"


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_the_page_runs_as_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rig(seconds=20)[0].save("raw.mcap")
    text = PAGE.read_text(encoding="utf-8")
    lines = re.findall(r"^paxisim (.*)$", text, re.MULTILINE)
    for line in lines:
        if line.startswith("calibrate"):
            assert main([*line.split(), "--force"]) == 0
    code, live = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    scope: dict = {}
    exec(compile(code, str(PAGE), "exec"), scope)
    assert len(scope["calibrated"]) == len(Recording.load("calibrated.mcap"))
    assert (tmp_path / "calibration.png").exists()

    pytest.importorskip("serial")
    pytest.importorskip("termios")  # for the emulator
    recording = Recording.load("raw.mcap")
    with Emulator("anyskin", lambda now: recording.measured[700]) as emulator:
        exec(compile(live.replace("/dev/ttyACM0", emulator.port), str(PAGE), "exec"), scope)
        (record,) = [line for line in lines if line.startswith("record")]
        assert main([*record.replace("/dev/ttyACM0", emulator.port).split(), "--seconds", "0.5"]) == 0
    assert scope["frame"].unit == "N"
    assert scope["frame"].resultant.shape == (1, 3)
    assert Recording.load("newtons.mcap").unit == "N"
