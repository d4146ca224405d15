"""The README's Python runs as printed, in order, in a folder with a gripper."""

import re
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from importlib.resources import files
from pathlib import Path

import pytest

pytest.importorskip("serial")
pytest.importorskip("pyarrow")
pytest.importorskip("rerun")

from paxisim.cli import main

README = Path(__file__).parents[1] / "README.md"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    gripper = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
    (tmp_path / "my_gripper.xml").write_text(gripper)
    return tmp_path


@contextmanager
def started(line):
    """A command of the README that ends in ``&``, as a process; its first line says that it is ready."""
    words = [sys.executable, "-m", "paxisim.cli", *line.removesuffix("&").split()]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline().strip() == "my-sensor"
            yield
        finally:
            process.kill()


def shell_lines():
    return re.findall(r"^paxisim (.*)$", README.read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_the_python_examples_run(folder):
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) >= 3
    scope: dict = {}
    emulate, record = shell_lines()[4:6]
    with started(emulate):
        assert main(record.split()) == 0
        for block in blocks:
            exec(compile(block, str(README), "exec"), scope)
    assert scope["force"].shape == (2, 3, 6, 5)
    assert scope["frame"].force.shape == (1, 3, 12, 10)
    assert (folder / "pads.png").exists()
    named = {cause.name: cause for cause in scope["diagnosis"].causes}  # what the README says of them
    assert set(named) == {"axis_gain", "latency"}
    assert named["latency"].rivals == ("low_pass",)
    gain_z = next(p.value for p in named["axis_gain"].parameters if p.name == "gain_z")
    # its interval is 0.001 wide, so that its ends are rounded one way or the other
    assert f"`gain_z {gain_z.value:.2g}`" in README.read_text(encoding="utf-8")
    assert gain_z.high - gain_z.low < 0.005


@pytest.mark.real_time
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_the_shell_examples_run(folder):
    with ExitStack() as processes:
        lines = shell_lines()
        assert len(lines) == 10
        for line in lines:
            if line.endswith("&"):
                processes.enter_context(started(line))
            elif not line.startswith("view"):  # opens a window
                assert main(line.split()) == 0, line
    assert (folder / "press.parquet").exists()
    assert (folder / "press-dataset/meta/info.json").exists()


def test_the_picture_is_there():
    text = README.read_text(encoding="utf-8")
    for target in re.findall(r"!\[.*?\]\((.*?)\)", text):
        assert (README.parent / target).is_file(), target
