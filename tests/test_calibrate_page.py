"""The page on calibration runs as printed."""

import re
from pathlib import Path

from load_rig import rig

from paxisim.cli import main
from paxisim.recording import Recording

PAGE = Path(__file__).parents[1] / "docs" / "calibrate.md"


def test_the_page_runs_as_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rig(seconds=20)[0].save("raw.mcap")
    text = PAGE.read_text(encoding="utf-8")
    (line,) = re.findall(r"^paxisim (.*)$", text, re.MULTILINE)
    assert main(line.split()) == 0
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    scope: dict = {}
    exec(compile(code, str(PAGE), "exec"), scope)
    assert len(scope["calibrated"]) == len(Recording.load("calibrated.mcap"))
    assert (tmp_path / "calibration.png").exists()
