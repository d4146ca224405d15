"""A scene for layout tests: two pads, each pressed off-centre and dragged in a different direction."""

import mujoco
import numpy as np

from paxisim.layout import TaxelLayout
from paxisim.models.attach import attach
from paxisim.models.gel import Gel
from paxisim.models.mount import Mount
from paxisim.models.pad import Pad
from paxisim.models.readout import TactileReadout

LAYOUT = TaxelLayout(5, 3, (3e-3, 4e-3))
# per pad, in the pad frame: position of the object (m) and force applied to it (N)
PLACES = np.array([[2.1e-3, -3.3e-3], [-2.4e-3, 1.2e-3]])
PUSHES = np.array([[2.0, 1.1, 9.0], [-0.9, 2.6, 11.0]])
QUATS = ((1.0, 0.0, 0.0, 0.0), (0.3, 0.5, -0.2, 0.8))
OBJECT = """<body name="object{0}" pos="0 0 0"><joint name="object{0}" type="free" damping="5"/>
  <geom type="box" size="0.003 0.0025 0.003" mass="0.05"/></body>"""


def pressed_scene():
    """Model, pads and data of the two pads at first contact."""
    world = f"""<mujoco><option timestep="0.002" cone="elliptic" gravity="0 0 0"/><worldbody>
      <body name="left" pos="0 0 0.3"/><body name="right" pos="0.2 0.1 0.1"/>
      {OBJECT.format(0)}{OBJECT.format(1)}</worldbody></mujoco>"""
    mounts = [Mount(body, quat=quat) for body, quat in zip(("left", "right"), QUATS, strict=True)]
    tactile = attach(world, Pad(LAYOUT, gel=Gel(modulus=3e6, thickness=1e-3)), mounts)
    model = tactile.compile()
    pads = tactile.bind(model)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for i, body in enumerate(pads.bodies):
        start = model.joint(f"object{i}").qposadr[0]
        to_world = data.xmat[body].reshape(3, 3)
        data.qpos[start : start + 3] = data.xpos[body] + to_world @ [*PLACES[i], -0.003 + 5e-5]
        mujoco.mju_mat2Quat(data.qpos[start + 3 : start + 7], data.xmat[body])
    mujoco.mj_forward(model, data)
    return model, pads, data


def pressed_force() -> np.ndarray:
    """``(2, 3, 5, 3)`` forces (N) read from the simulator once the objects are at rest."""
    model, pads, data = pressed_scene()
    for _ in range(300):
        for i, body in enumerate(pads.bodies):
            data.body(f"object{i}").xfrc_applied[:3] = data.xmat[body].reshape(3, 3) @ PUSHES[i]
        mujoco.mj_step(model, data)
    force = TactileReadout(model, pads).read(data)
    # the tests are meaningless unless the applied forces arrive
    np.testing.assert_allclose(force.sum(axis=(-2, -1)), PUSHES, atol=0.1)
    return force
