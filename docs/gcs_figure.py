"""Draws docs/images/gcs.png: the paper's figure of GCS, raw readings beside three draws of the same physical states.

A peg is held between two pads in MuJoCo, free in the air and with its lower end pushed sideways, as by the rim of a
hole. The raw reading is that of flat pads. For each draw (A-C) the pads get their bumps and the press is simulated
again (G); then the convolution (C) and the gains (S) are applied. The left finger is shown.

    python docs/gcs_figure.py
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import mujoco
import numpy as np
from light_and_dark import light_and_dark
from matplotlib.figure import Figure

import paxisim
from paxisim.augment.gcs import GCS
from paxisim.cli.demo import PEG
from paxisim.viz.drawing import draw_pad

SQUEEZE = 8.0  # N
RIM = (-3.0, 0.0, 2.0)  # N, world frame: the push of the rim on the lower end, along the closing direction and up
LOWER_END = (0.007, 0.0, -0.03)  # m, from the peg's centre
SEED = 6
OUTPUT = Path(__file__).parent / "images" / "gcs.png"


def scene() -> tuple[mujoco.MjModel, paxisim.Pads]:
    """The two-finger gripper with the paper's pads, pooled to 6x5, around a peg."""
    layout = paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)
    # the pad frame on a fingertip: x along the hand's depth, y down to the tip, z into the finger
    mounts = [
        paxisim.Mount(
            f"{side}_finger", pos=(0, 0, -0.019), quat=(0.5, -0.5, -0.5, 0.5), replaces=(f"{side}_fingertip",)
        )
        for side in ("left", "right")
    ]
    gripper = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
    tactile = paxisim.attach(gripper, layout, mounts)
    # a handle wider than the pads, as the paper's
    world = mujoco.MjSpec.from_string(PEG.replace('size="0.012 0.007 0.03"', 'size="0.012 0.014 0.03"'))
    world.attach(tactile.spec, site=world.site("hand"), prefix="gripper/")
    model = world.compile()
    return model, tactile.bind(model, prefix="gripper/")


def press(model: mujoco.MjModel, pads: paxisim.Pads, heights: np.ndarray) -> list[np.ndarray]:
    """The readings at rest, ``(pads, 3, rows, cols)`` each: held, and pushed by the rim."""
    paxisim.set_surface(model, pads, heights)
    data = mujoco.MjData(model)
    readout = paxisim.TactileReadout(model, pads)
    data.ctrl[0] = SQUEEZE
    peg = model.body("peg").id
    data.xfrc_applied[peg, 2] = -model.body_mass[peg] * model.opt.gravity[2]  # held until the fingers have it
    mujoco.mj_step(model, data, 500)
    data.xfrc_applied[peg] = 0
    mujoco.mj_step(model, data, 1000)
    held = readout.read(data)
    for _ in range(1000):
        arm = data.xmat[peg].reshape(3, 3) @ LOWER_END
        data.xfrc_applied[peg] = [*RIM, *np.cross(arm, RIM)]
        mujoco.mj_step(model, data)
    assert data.ncon, "the peg was pushed out"
    return [held, readout.read(data)]


def main() -> None:
    """Simulate and draw."""
    model, pads = scene()
    layout = pads.layout
    rng = np.random.default_rng(SEED)
    columns = [press(model, pads, GCS(geometry=False).sample_surface(rng, layout=layout))]
    for _ in range(3):
        gcs = GCS()
        states = press(model, pads, gcs.sample_surface(rng, layout=layout))
        chain = gcs.sample(rng, layout=layout)
        columns.append([chain(force) for force in states])
    readings = np.array(columns)[:, :, 0]  # (columns, states, 3, rows, cols) of the left finger
    vmax = float(np.abs(readings[:, :, 2]).max())
    shear_max = float(np.hypot(readings[:, :, 0], readings[:, :, 1]).max())
    for path in light_and_dark(OUTPUT):
        draw(readings, layout, vmax, shear_max).savefig(path, dpi=110)
    print(f"{OUTPUT.name}: normal force up to {vmax:.2f} N, shear up to {shear_max:.2f} N")
    print(np.round(readings.sum(axis=(-2, -1)), 2))


def draw(readings: np.ndarray, layout: paxisim.TaxelLayout, vmax: float, shear_max: float) -> Figure:
    """Draw the readings, ``(columns, states, 3, rows, cols)``."""
    figure = Figure(figsize=(10.2, 6.2), layout="constrained")
    axes = figure.subplots(2, 4)
    for row, state in enumerate(["held in the air", "pushed by the rim"]):
        for column, title in enumerate(["raw", "GCS, A", "GCS, B", "GCS, C"]):
            ax, force = axes[row, column], readings[column, row]
            title = title if row == 0 else ""
            if column == 3:  # all are on the scales shown here
                paxisim.plot_tactile(force, layout, ax, vmax=vmax, shear_max=shear_max, title=title)
            else:
                draw_pad(ax, force.astype(float), layout, vmax, shear_max, title)
            ax.set_ylabel(f"{state}\n\ny (mm)" if column == 0 else "")
            ax.set_xlabel("x (mm)" if row == 1 else "")
    return figure


if __name__ == "__main__":
    main()
