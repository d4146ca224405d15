"""The ``paxisim demo`` command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import tyro

from paxisim.cli.output import check_output, png, write_output

PUSH = (1.0, 0.5, 0.0)
"""Force (N) on the lower end of the peg, along the closing direction (x) and across it."""
PEG = """
<mujoco>
  <option timestep="0.002" cone="elliptic" impratio="10"/>
  <worldbody>
    <light pos="0.3 -0.3 0.5" dir="-1 1 -1.5"/>
    <site name="hand" pos="0 0 0.2"/>
    <body name="peg" pos="0 0 0.125">
      <freejoint/>
      <geom name="peg" type="box" size="0.012 0.009 0.03" mass="0.06" rgba="0.8 0.65 0.4 1"/>
    </body>
  </worldbody>
</mujoco>
"""


def demo(
    *,
    squeeze: float = 8.0,
    seed: int = 0,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    force: bool = False,
) -> None:
    """Squeeze a peg between two pads, compare the tensor with the known load, and draw it.

    A two-finger gripper holds a peg of 60 g whose lower end is pushed aside, as by the rim of a hole. Each finger has a
    pad of the paper's sensor, pooled to 6x5 taxels, on a layer of soft silicone with a random bump. At rest, the pads
    must read the squeeze force, and together the push and the weight of the peg.

    For example:

    paxisim demo --squeeze 12 -o squeeze.png

    Args:
        squeeze: Force of each finger in N, up to 20.
        seed: Random seed of the pads' bumps.
        output: Output picture, .png; default: paxisim-demo.png, or the next free name.
        force: Overwrite the output if it exists.
    """
    from importlib.resources import files

    import mujoco
    import numpy as np

    import paxisim

    if not 2 <= squeeze <= 20:
        raise paxisim.InvalidValueError(f"--squeeze must lie between 2 N, to hold the peg, and 20 N, got {squeeze:g}")
    if seed < 0:
        raise paxisim.InvalidValueError(f"--seed must be 0 or more, got {seed}")
    output = _free_name("paxisim-demo", ".png") if output is None else output
    check_output(output, force, ".png")

    layout = paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)
    inwards = {"left_finger": "left_fingertip", "right_finger": "right_fingertip"}
    # pad frame on a fingertip: x along the depth of the hand, y down to the tip, z into the finger
    mounts = [
        paxisim.Mount(body, pos=(0, 0, -0.019), quat=(0.5, -0.5, -0.5, 0.5), replaces=(tip,), name=body.split("_")[0])
        for body, tip in inwards.items()
    ]
    gripper = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
    silicone = paxisim.Gel.of(paxisim.Layer(modulus=0.2e6), layout, "taxel")
    tactile = paxisim.attach(gripper, paxisim.Pad(layout, gel=silicone), mounts)
    scene = mujoco.MjSpec.from_string(PEG)
    scene.attach(tactile.spec, site=scene.site("hand"), prefix="gripper/")
    model = scene.compile()
    pads = tactile.bind(model, prefix="gripper/")
    rng = np.random.default_rng(seed)
    bumps = [paxisim.GaussianBump.sample(layout, rng).heights(layout) for _ in pads.names]
    paxisim.set_surface(model, pads, np.stack(bumps))

    data = mujoco.MjData(model)
    data.ctrl[0] = squeeze
    readout = paxisim.TactileReadout(model, pads)
    peg = model.body("peg").id
    weight = float(model.body_mass[peg] * -model.opt.gravity[2])
    data.xfrc_applied[peg, 2] = weight  # carry the peg until the fingers hold it
    mujoco.mj_step(model, data, 500)
    end = np.array([0, 0, -model.geom("peg").size[2]])
    data.xfrc_applied[peg] = [*PUSH, *np.cross(end, PUSH)]
    mujoco.mj_step(model, data, 1000)
    force_tensor = readout.read(data)

    print(f"two pads of {layout.rows}x{layout.cols} taxels squeeze a peg; MuJoCo {mujoco.__version__}, seed {seed}\n")
    print(f"{'':36}{'known':>9}{'tensor':>9}{'error':>9}")
    total = force_tensor.sum(axis=(-2, -1))
    along_x, along_y, up = np.einsum("pij,pj->i", data.xmat[pads.bodies].reshape(-1, 3, 3), total)
    rows = [
        ("squeeze, mean of both pads (z)", squeeze, total[:, 2].mean()),
        ("push on the lower end, both pads", np.hypot(*PUSH[:2]), np.hypot(along_x, along_y)),
        ("weight of the peg, both pads", weight, -up),
    ]
    for what, known, measured in rows:
        print(f"{what:34}{known:7.3f} N{measured:7.3f} N{abs(measured / known - 1):8.2%}")
    lit = int((force_tensor[:, 2] > 0.02).sum())
    print(f"\ntensor {force_tensor.shape} {force_tensor.dtype}, {lit} of {2 * layout.taxels} taxels above 0.02 N")

    figure = paxisim.plot_pads(force_tensor, layout, names=[f"{mount.name} finger" for mount in tactile.mounts])
    write_output(output, png(figure), force)
    print(f"picture: {output}")


def _free_name(stem: str, suffix: str) -> Path:
    """Return the first of stem.suffix, stem-2.suffix, ... that does not exist."""
    path, number = Path(stem + suffix), 2
    while path.exists():
        path, number = Path(f"{stem}-{number}{suffix}"), number + 1
    return path
