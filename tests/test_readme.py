"""The README's Python runs as printed, in order, in a folder with a gripper."""

import re
from importlib.resources import files
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"


def test_the_python_examples_run(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    gripper = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
    (tmp_path / "my_gripper.xml").write_text(gripper)
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) >= 3
    scope: dict = {}
    for block in blocks:
        exec(compile(block, str(README), "exec"), scope)
    assert scope["force"].shape == (2, 3, 6, 5)
    assert (tmp_path / "pads.png").exists()


def test_the_shell_examples_parse(tmp_path, monkeypatch):
    from paxisim.cli import main

    monkeypatch.chdir(tmp_path)
    gripper = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
    (tmp_path / "my_gripper.xml").write_text(gripper)
    shell = re.findall(r"^paxisim (.*)$", README.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(shell) == 4
    for line in shell:
        if not line.startswith("view"):  # opens a window
            assert main(line.split()) == 0, line


def test_the_picture_is_there():
    text = README.read_text(encoding="utf-8")
    for target in re.findall(r"!\[.*?\]\((.*?)\)", text):
        assert (README.parent / target).is_file(), target
