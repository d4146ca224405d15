"""Writes what the page "A pad in the browser" loads: the pads, the transforms' matrices, and MuJoCo's module.

    python docs/browser/make.py

``pad.js`` is the page's program. This script writes ``data.js`` beside it, which is committed: the MJCF of a stage with
one pad, flat and with three of GCS's uneven surfaces, and the kernels of the Poisson effect. It also writes
``mujoco.js``, which is not committed: MuJoCo's own WebAssembly module from the npm package mujoco-js (Apache 2.0), as a
plain script, so that the built site works from a folder too. That needs npm.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import paxisim

HERE = Path(__file__).parent
MODULE = "mujoco-js@0.0.7"
LAYOUT = paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)
STAGE = """
<mujoco model="stage">
  <option timestep="0.002" cone="elliptic" impratio="10" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body name="table" euler="180 0 0"/>
    <body name="ball" pos="0 0 0.0125">
      <joint name="x" type="slide" axis="1 0 0"/>
      <joint name="y" type="slide" axis="0 1 0"/>
      <joint name="z" type="slide" axis="0 0 1" damping="20"/>
      <geom name="ball" type="sphere" size="0.012" mass="0.1"/>
    </body>
  </worldbody>
  <actuator>
    <position joint="x" kp="1500" kv="20"/>
    <position joint="y" kp="1500" kv="20"/>
    <motor joint="z"/>
  </actuator>
</mujoco>
"""


def stage(heights: np.ndarray | None) -> str:
    """Return the MJCF of the stage with a pad of these heights (m), ``(rows, cols)``; None: flat."""
    pad = paxisim.Pad(LAYOUT, heights=heights)
    return paxisim.attach(STAGE, pad, [paxisim.Mount("table")]).to_xml()


def data() -> dict[str, Any]:
    """Return what the page needs to know."""
    ranges = paxisim.GCS()
    surfaces = {"flat": stage(None)}
    for seed in (1, 2, 3):
        heights = ranges.sample_surface(np.random.default_rng(seed), layout=LAYOUT, pads=1)[0]
        surfaces[f"bumps, seed {seed}"] = stage(np.asarray(heights))
    each = np.zeros((LAYOUT.taxels, *LAYOUT.shape))  # 1 N on one taxel at a time
    each[:, 2] = np.eye(LAYOUT.taxels).reshape(-1, LAYOUT.rows, LAYOUT.cols)
    shear = paxisim.augment.Poisson(1.0, 1.0)(each)[:, :2].reshape(LAYOUT.taxels, 2, LAYOUT.taxels)
    return {
        "rows": LAYOUT.rows,
        "cols": LAYOUT.cols,
        "pitch": LAYOUT.pitch,
        "surfaces": surfaces,
        "kernel": np.round(shear, 9).tolist(),  # from the load of a taxel to the shear of all along x, then y
    }


def module() -> str:
    """Return MuJoCo's module as a plain script that defines ``loadMujoco``."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["npm", "pack", "--silent", MODULE]
        packed = subprocess.run(command, cwd=folder, check=True, stdout=subprocess.PIPE, text=True)
        with tarfile.open(Path(folder) / packed.stdout.split()[-1]) as archive:
            file = archive.extractfile("package/dist/mujoco_wasm.js")
            assert file is not None
            text = file.read().decode()
    return text.replace("export default loadMujoco;", "").replace("import.meta.url", "document.baseURI")


if __name__ == "__main__":
    (HERE / "data.js").write_text(f"window.PAD = {json.dumps(data())};\n", encoding="utf-8")
    if "--data" not in sys.argv:
        (HERE / "mujoco.js").write_text(module(), encoding="utf-8")
