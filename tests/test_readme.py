"""The README runs as printed, in order, in an empty folder; .ci/run runs its two install commands."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("serial")
pytest.importorskip("sklearn")
pytest.importorskip("jinja2")

from paxisim.cli import main

README = Path(__file__).parents[1] / "README.md"


def blocks():
    """Return the shell and Python blocks in order."""
    text = README.read_text(encoding="utf-8")
    return re.findall(r"^```(bash|python)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


@pytest.mark.real_time
@pytest.mark.timeout(300)
@pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")
def test_it_runs_as_printed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scope, verbs, background = {}, [], []
    try:
        for kind, block in blocks():
            if kind == "python":
                exec(compile(block, str(README), "exec"), scope)
                continue
            for line in block.replace("\\\n", " ").splitlines():
                program, *words = shlex.split(line.removesuffix("&"))
                if program == ".":  # activates the environment
                    continue
                if program == "until":  # waits for the emulator's port
                    subprocess.run(["bash", "-c", line], check=True, timeout=30)
                    continue
                assert program == "paxisim"
                verbs.append(words[0])
                if line.endswith("&"):
                    command = [sys.executable, "-m", "paxisim", *words]
                    background.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
                    assert background[-1].stdout.readline().strip() == "my-sensor"
                else:
                    assert main(words) == 0, line
    finally:
        for process in background:
            process.kill()
            process.communicate()
    assert verbs == ["example", "attach", "emulate", "record", "info", "example", "diagnose"]
    force = scope["force"]
    assert force.shape == (2, 3, 6, 5)
    assert force[:, 2].sum(axis=(-2, -1)) == pytest.approx([8, 8], rel=0.01), "the value in the comment"
    assert scope["reading"].any()
    assert {path.name for path in tmp_path.iterdir()} >= {"tactile_gripper.png", "pads.png", "press.mcap", "diagnosis"}

    # the README's statements about the diagnosis
    model, recording = scope["model"], scope["recording"]
    said = README.read_text(encoding="utf-8")
    assert list(model.names)[:2] == ["axis_gain", "latency"]
    assert f"`gain_z {model['axis_gain'].gain[2]:.2g}`" in said
    assert f"`latency` of {float(model['latency'].delay):.2f} s" in said
    before, after = (abs(recording.measured - s).mean() for s in (recording.simulated, scope["corrected"]))
    assert after < 0.5 * before


def test_it_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 120
