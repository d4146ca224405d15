"""Cost of pads, as ratios of times measured alternately in one run. Run with `pytest benchmarks -n0`.

The scene is a box peg squeezed by two pads: about 240 contacts with 6x5 taxels, 960 with 12x10.
"""

import copy
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from paxisim.layout import TaxelLayout
from paxisim.models.attach import attach
from paxisim.models.mount import Mount
from paxisim.models.pad import Pad
from paxisim.models.pads import find_pads, set_surface
from paxisim.models.readout import TactileReadout
from paxisim.models.surface import GaussianBump

PAPER = TaxelLayout(12, 10, (26.1e-3 / 12, 22.6e-3 / 10))
LAYOUTS = [pytest.param(PAPER.pool(2, 2), 0.25, id="6x5"), pytest.param(PAPER, 0.15, id="12x10")]
SUBSTEPS = 25  # steps of 2 ms per control step at 20 Hz

# the pads face each other along x, with rows running downwards
PEG = """
<mujoco>
  <option timestep="0.002" cone="elliptic" impratio="10"/>
  <worldbody>
    <body name="left" pos="-0.012 0 0" quat="0.5 0.5 -0.5 -0.5">
      <joint name="left" type="slide" axis="0 0 -1" damping="20"/>
      <geom size="0.005" pos="0 0 0.02" mass="0.1" contype="0" conaffinity="0"/>
    </body>
    <body name="right" pos="0.012 0 0" quat="0.5 0.5 0.5 0.5">
      <joint name="right" type="slide" axis="0 0 -1" damping="20"/>
      <geom size="0.005" pos="0 0 0.02" mass="0.1" contype="0" conaffinity="0"/>
    </body>
    <body>
      <freejoint/>
      <geom type="box" size="0.012 0.015 0.015" mass="0.05"/>
    </body>
  </worldbody>
  <actuator>
    <motor joint="left"/>
    <motor joint="right"/>
  </actuator>
</mujoco>
"""


def squeezed_peg(layout, sensors=None):
    """Return model, pads and data after half a second of squeezing with 5 N."""
    gripper = attach(PEG, Pad(layout, sensors=sensors), [Mount("left"), Mount("right")])
    model = gripper.compile()
    pads = gripper.bind(model)
    data = mujoco.MjData(model)
    data.ctrl[:] = 5
    mujoco.mj_step(model, data, 250)
    assert data.ncon == 2 * 4 * layout.taxels
    normal = TactileReadout(model, pads).read(data)[:, 2].sum(axis=(1, 2))
    np.testing.assert_allclose(normal, 5, rtol=0.01)
    return model, pads, data


def median_ratio(main, other) -> float:
    """Return the median ratio of times taken in the same round."""
    return float(np.median(main / other))


def many_reads(readout, data, count=50):
    out = np.empty(readout.pads.shape, dtype=np.float32)

    def reads():
        for _ in range(count):
            readout.read(data, out)

    return reads, count


@pytest.mark.parametrize(("layout", "target"), LAYOUTS)
def test_read(compare, layout, target):
    model, pads, data = squeezed_peg(layout)
    reads, count = many_reads(TactileReadout(model, pads), data)
    times = compare.time(reads, {"steps": lambda: mujoco.mj_step(model, data, count)}, rounds=60)
    size = f"{layout.rows}x{layout.cols}, {data.ncon} contacts"
    compare.report(f"read / mj_step, two pads of {size}", median_ratio(times["main"], times["steps"]), target)


@pytest.mark.parametrize("sensors", ["touch_grid", "contact"])
@pytest.mark.parametrize("layout", [param.values[0] for param in LAYOUTS], ids=["6x5", "12x10"])
def test_control_step(compare, layout, sensors):
    """Compare one read per control step with the time that sensors in the model add to its substeps."""
    model, pads, data = squeezed_peg(layout)
    readout = TactileReadout(model, pads)
    reads, count = many_reads(readout, data)
    sensing, _, sensing_data = squeezed_peg(layout, sensors)
    silent, silent_data = copy.copy(sensing), copy.copy(sensing_data)
    silent.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR

    def control_step():
        mujoco.mj_step(model, data, SUBSTEPS)
        readout.read(data)

    others = {
        "sensing": lambda: mujoco.mj_step(sensing, sensing_data, SUBSTEPS),
        "silent": lambda: mujoco.mj_step(silent, silent_data, SUBSTEPS),
        "steps": lambda: mujoco.mj_step(model, data, SUBSTEPS),
        "loop": control_step,
    }
    times = compare.time(reads, others, rounds=60)
    added = np.median(times["sensing"] - times["silent"])
    size = f"{layout.rows}x{layout.cols}"
    what = f"what {sensors} sensors add to {SUBSTEPS} substeps, {size}"
    compare.report(f"read / {what}", np.median(times["main"]) / count / added, 0.1)
    # milliseconds of physics evict Python and numpy from the caches
    in_loop = np.median(times["loop"] - times["steps"])
    compare.report(f"  the same, measured in the control loop, {size}", in_loop / added, 0.1)


def test_set_surface(compare):
    """Compare setting a new bump for an episode with compiling the model again."""
    model, pads, _ = squeezed_peg(PAPER)
    rng = np.random.default_rng(0)
    heights = GaussianBump.sample(PAPER, rng).heights(PAPER)
    mounts = [Mount("left"), Mount("right")]

    def recompile():
        gripper = attach(PEG, Pad(PAPER, heights=heights), mounts)
        gripper.bind(gripper.compile())

    times = compare.time(lambda: set_surface(model, pads, heights), {"recompile": recompile}, rounds=20)
    compare.report("set_surface / compiling anew, two pads of 12x10", median_ratio(times["main"], times["recompile"]))


def test_build_64x64(compare):
    layout = TaxelLayout(64, 64, 1e-3)

    def build():
        model = mujoco.MjModel.from_xml_string(Pad(layout).to_xml())
        assert find_pads(model).shape == (1, 3, 64, 64)

    times = compare.time(build, {}, rounds=3)
    compare.report("generating, compiling and finding a pad of 64x64", np.median(times["main"]), 5, " s")


@pytest.mark.parametrize(
    ("statement", "target"), [("import paxisim", 1.3), ("from paxisim import TactileReadout, attach, find_pads", None)]
)
def test_import(compare, statement, target):
    """Measure an import in a fresh process."""

    def run(code):
        return lambda: subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[1])

    times = compare.time(run(statement), {"both": run("import numpy, mujoco")}, rounds=15)
    ratio = median_ratio(times["main"], times["both"])
    compare.report(f"{statement} / import numpy, mujoco", ratio, target)
