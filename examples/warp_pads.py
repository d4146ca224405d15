"""Pads in many worlds at once on MuJoCo Warp: each world has its own surface, grip force and sensor.

Runs on a GPU if there is one, otherwise on the CPU, where MuJoCo Warp is slow and first compiles for a minute or two.
Needs the extra warp, in an environment without robosuite:

    python examples/warp_pads.py --worlds 8
"""

from __future__ import annotations

import argparse
from importlib.resources import files

import mujoco
import mujoco_warp
import numpy as np
import torch
import warp

import paxisim
import paxisim.augment.torch


def gripper_with_peg() -> tuple[mujoco.MjModel, paxisim.Pads]:
    """Return a model of two fingers with 6x5 taxels each, and a peg between them."""
    layout = paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)
    gripper = paxisim.attach(files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(), layout)
    scene = gripper.spec
    scene.option.cone, scene.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10
    peg = scene.worldbody.add_body(name="peg", pos=[0, 0, -0.07])
    peg.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.012, 0.009, 0.03])
    model = gripper.compile()
    return model, gripper.bind(model)


def main() -> None:
    """Squeeze the peg in every world, read all pads, and start some worlds anew."""
    parser = argparse.ArgumentParser(description="Pads in many worlds at once on MuJoCo Warp.")
    parser.add_argument("--worlds", type=int, default=8)
    worlds = parser.parse_args().worlds
    warp.config.log_level = warp.LOG_WARNING  # otherwise it names every kernel that it loads
    model, pads = gripper_with_peg()
    rng = np.random.default_rng(0)

    def heights() -> np.ndarray:
        """Draw a surface for every pad, G of the paper's GCS, ``(worlds, pads, rows, cols)``."""
        return paxisim.GCS().sample_surface(rng, (worlds,), layout=pads.layout)

    m, d = paxisim.warp.put_worlds(model, pads, worlds)
    paxisim.warp.set_surface(m, d, model, pads, heights())
    readout = paxisim.warp.WarpTactileReadout(model, pads, worlds)
    sensor = paxisim.augment.torch.GCS(layout=pads.layout, per="episode")  # C and S, on the same device

    grip = torch.linspace(2, 10, worlds, device=warp.device_to_torch(warp.get_device()))  # N
    warp.to_torch(d.ctrl)[:] = grip[:, None]
    for _ in range(300):
        mujoco_warp.step(m, d)
    force = readout.read(m, d)
    print(f"tensor {tuple(force.shape)} on {force.device}")
    for asked, total in zip(grip.tolist(), force[:, :, 2].sum(dim=(-2, -1)).tolist(), strict=True):
        print(f"grip {asked:5.2f} N, pads read {total[0]:5.2f} N and {total[1]:5.2f} N")
    print(f"largest change by the drawn sensors: {float((sensor(force) - force).abs().max()):.2f} N")

    # every other world begins a new episode: another surface, another sensor, the initial state
    done = torch.arange(worlds, device=force.device) % 2 == 0
    kept = force.clone()  # the next read overwrites the tensor
    mujoco_warp.reset_data(m, d, warp.from_torch(done))
    warp.to_torch(d.ctrl)[:] = grip[:, None]
    paxisim.warp.set_surface(m, d, model, pads, heights(), done)
    sensor.resample(done)
    for _ in range(300):
        mujoco_warp.step(m, d)
    readout.check(m, d)  # waits for the device, so not in every step
    change = (readout.read(m, d) - kept).abs().amax(dim=(1, 2, 3, 4))
    print(f"taxels changed by {float(change[done].max()):.2f} N where an episode began")
    print(f"and by {float(change[~done].max()):.2f} N where it went on")


if __name__ == "__main__":
    main()
