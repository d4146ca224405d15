"""The example on MuJoCo Warp runs as printed."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from held import needs_warp

ROOT = Path(__file__).parents[2]
pytestmark = needs_warp


def test_every_world_reads_its_grip_force(tmp_path):
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    # Warp leaves a temporary folder of its compiler to the interpreter's end
    done = subprocess.run(
        [sys.executable, "-W", "error", "-W", "ignore::ResourceWarning", str(ROOT / "examples" / "warp_pads.py")],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=800, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    grips = re.findall(r"grip +([\d.]+) N, pads read +([\d.]+) N and +([\d.]+) N", done.stdout)
    assert len(grips) == 8
    for asked, *read in grips:
        assert [float(each) for each in read] == pytest.approx([float(asked)] * 2, rel=0.02)
    changed, kept = map(float, re.findall(r"by ([\d.]+) N where", done.stdout))
    assert changed > 0.02 > kept
