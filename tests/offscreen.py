"""Programs that render pictures, run with an OpenGL that this machine has without a display."""

import os
import subprocess
import sys

import pytest

_PROBE = "import mujoco; mujoco.Renderer(mujoco.MjModel.from_xml_string('<mujoco/>'), 8, 8).close()"


def python(*words, cwd=None):
    """Run Python with these arguments and a renderer; skip the test if this machine has none."""
    for backend in ("egl", "osmesa"):
        environment = {**os.environ, "MUJOCO_GL": backend}
        if subprocess.run([sys.executable, "-c", _PROBE], env=environment, capture_output=True).returncode == 0:
            command = [sys.executable, *map(str, words)]
            return subprocess.run(command, env=environment, capture_output=True, text=True, cwd=cwd)
    pytest.skip("MuJoCo cannot render on this machine")
