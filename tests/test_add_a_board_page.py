"""The page on adding a board family runs as printed, with the printed output."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import paxisim

PAGE = Path(__file__).parents[1] / "docs" / "how-to" / "add-a-board.md"

pytest.importorskip("serial")


@pytest.mark.real_time
def test_the_page_prints_what_it_says(tmp_path):
    text = PAGE.read_text(encoding="utf-8")
    files = dict(re.findall(r"```python\n# (\S+)\n(.*?)```", text, re.DOTALL))
    assert list(files) == ["my_board.py", "try_it.py"]
    for name, code in files.items():
        (tmp_path / name).write_text(code, encoding="utf-8")
    path = os.pathsep.join([str(Path(paxisim.__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-W", "error", "try_it.py"],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    (said,) = re.findall(r"```text\n(.*?)```", text, re.DOTALL)
    assert done.stdout == said
