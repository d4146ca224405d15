"""The page on adding a cause runs as printed, with the printed output."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[1] / "docs" / "how-to" / "add-a-cause.md"


@pytest.fixture(scope="module")
def files():
    """Code blocks of the page, by the file name in their first line."""
    blocks = re.findall(r"```python\n# (\S+)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return dict(blocks)


def test_the_cause_has_less_than_40_lines(files):
    assert len(files["thermal_gain.py"].strip().splitlines()) < 40


@pytest.mark.timeout(180)
def test_the_page_prints_what_it_says(files, tmp_path):
    assert list(files) == ["thermal_gain.py", "try_it.py"]
    for name, code in files.items():
        (tmp_path / name).write_text(code, encoding="utf-8")
    command = [sys.executable, "try_it.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=170)
    assert done.returncode == 0, done.stderr
    (said,) = re.findall(r"```text\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert done.stdout == said
