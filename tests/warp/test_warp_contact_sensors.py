"""The way that the page shows for MJX-Warp: contact sensors that read what TactileReadout reads. Needs no Warp."""

import re
from pathlib import Path

import mujoco
import numpy as np

import paxisim

PAGE = Path(__file__).parents[2] / "docs" / "guides" / "warp.md"


def test_the_contact_sensors_of_the_page_read_the_tensor():
    section = PAGE.read_text(encoding="utf-8").split("\n## MJX-Warp\n")[1]
    block = re.search(r"^```python\n(.*?)^```", section, re.MULTILINE | re.DOTALL)[1]
    scope = {}
    exec(compile(block, "warp.md", "exec"), scope)
    model, pads, data, read = (scope[name] for name in ("model", "pads", "data", "read"))
    readout = paxisim.TactileReadout(model, pads)
    data.qvel[:2] = 0.05, -0.03  # the block slides, so there is shear
    for _ in range(5):
        mujoco.mj_step(model, data)
        force = read(data.sensordata, data.xmat)
        np.testing.assert_allclose(force, readout.read(data), atol=1e-5)
    assert np.abs(force[0, :2]).sum(axis=(1, 2)).min() > 0.05
    assert force[0, 2].sum() > 0.9
