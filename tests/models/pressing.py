"""Scenes for reading forces: an object pressed on a tilted pad, or squeezed between two pads."""

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from paxisim import Gel, Mount, Pad, Pads, TaxelLayout, attach, find_pads

LAYOUT = TaxelLayout(3, 4, 4e-3)
TILTED = tuple(Rotation.from_euler("xyz", [70, -40, 110], degrees=True).as_quat()[[3, 0, 1, 2]])

# for each object: its geom, which meets the pad along z, and the distance from its centre to the contact (m)
OBJECTS = {
    "box": ('<geom type="box" size="0.006 0.005 0.004"', 0.004),
    "sphere": ('<geom type="sphere" size="0.008"', 0.008),
    "capsule": ('<geom type="capsule" size="0.005 0.006" euler="0 90 0"', 0.005),
    "cylinder": ('<geom type="cylinder" size="0.005 0.006" euler="0 90 0"', 0.005),
    "ellipsoid": ('<geom type="ellipsoid" size="0.008 0.007 0.005"', 0.005),
    "mesh": ('<geom type="mesh" mesh="wedge"', 0.004),
}
WEDGE = """<asset><mesh name="wedge" inertia="convex" vertex="-.006 -.006 -.004  .006 -.006 -.004  .006 .006 -.004
  -.006 .006 -.004  -.006 -.006 .004  .006 -.006 .004  .005 .007 .004  -.006 .006 .004"/></asset>"""
WEIGHT = '<geom type="box" size="0.002 0.002 0.002" pos="0 0 0.05" mass="0.2" contype="0" conaffinity="0"/>'
JOINTS = {
    "fixed": "",
    "sliding": '<joint type="slide" axis="1 2 3" damping="20" stiffness="2000"/>',
    "hinged": '<joint type="hinge" axis="2 1 -1" pos="0.03 0 0.02" damping="0.02" stiffness="5"/>',
}


def attached(world: str, pad: Pad, *mounts: Mount) -> tuple[mujoco.MjModel, Pads, mujoco.MjData]:
    """Attach the pad at each mount, and return the compiled model, its pads with their gel, and fresh data."""
    gripper = attach(world, pad, mounts)
    model = gripper.compile()
    return model, gripper.bind(model), mujoco.MjData(model)


def scene(
    shape: str = "box", *, pads_first=True, joint="fixed", cone="elliptic", attributes="", pad=None, quat=TILTED
) -> tuple[mujoco.MjModel, Pads, mujoco.MjData]:
    """Return a tilted pad on a carrier with a free, damped object pressed 0.2 mm into it; no gravity.

    Use `push` to push the object.
    """
    geom, reach = OBJECTS[shape]
    carrier = f"""<body name="carrier" pos="0.1 -0.2 0.3" quat="{" ".join(map(str, quat))}">{JOINTS[joint]}
      {WEIGHT}</body>"""
    thing = f"""<body name="object"><joint name="object" type="free" damping="5"/>
      {geom} name="object" mass="0.05" {attributes}/></body>"""
    bodies = (carrier, thing) if pads_first else (thing, carrier)
    world = f"""<mujoco><option timestep="0.002" cone="{cone}" gravity="0 0 0"/>{WEDGE}
      <worldbody>{"".join(bodies)}</worldbody></mujoco>"""
    mount = Mount("carrier", pos=(0.004, 0.002, -0.01), quat=(0.3, 0.5, -0.2, 0.8))
    model, pads, data = attached(world, pad or Pad(LAYOUT), mount)
    place_object(model, data, pads, [0.7e-3, -0.4e-3, 0.2e-3 - reach])
    return model, pads, data


def rotation(data: mujoco.MjData, pads: Pads, pad: int = 0) -> np.ndarray:
    """Return the rotation from the pad frame to the world frame."""
    return data.xmat[pads.bodies[pad]].reshape(3, 3)


def place_object(model, data, pads, pos) -> None:
    """Put the object at `pos` (m, first pad's frame), with its axes along the pad's."""
    mujoco.mj_forward(model, data)
    to_world = rotation(data, pads)
    start = model.joint("object").qposadr[0]
    data.qpos[start : start + 3] = data.xpos[pads.bodies[0]] + to_world @ pos
    data.qpos[start + 3 : start + 7] = Rotation.from_matrix(to_world).as_quat()[[3, 0, 1, 2]]
    mujoco.mj_forward(model, data)


def push(model, data, pads, force, steps: int) -> None:
    """Push the object's centre with `force` (N, first pad's frame) for `steps` steps."""
    for _ in range(steps):
        data.body("object").xfrc_applied[:3] = rotation(data, pads) @ force
        mujoco.mj_step(model, data)


def give_gap(model, data, geoms) -> None:
    """Make MuJoCo list contacts within 1 mm that become active only when the geoms touch."""
    model.geom_gap[geoms] = model.body_margin[model.geom_bodyid[geoms]] = 1e-3
    # MuJoCo 3.5 includes the gap in the margin, MuJoCo 3.9 adds it to the margin
    for margin in (0, 1e-3):
        model.geom_margin[geoms] = margin
        mujoco.mj_forward(model, data)
        if np.any(data.contact.efc_address < 0):
            return


def turned(quat) -> np.ndarray:
    """Return the orientation of a pad that faces a pad with orientation `quat`."""
    facing = Rotation.from_quat(np.roll(quat, -1)) * Rotation.from_rotvec([np.pi, 0, 0])
    return np.roll(facing.as_quat(), 1)


def squeezed(shape: str, *, cone="elliptic", grip=4.0, pad=None, order=("fixed", "object", "moving")):
    """Return an object of 50 g held by friction between a fixed and a moving pad, under oblique gravity."""
    geom, reach = OBJECTS[shape]
    bodies = {
        "fixed": '<body name="fixed"/>',
        "moving": f'<body name="moving"><joint name="grip" type="slide" axis="0 0 1" damping="20"/>{WEIGHT}</body>',
        "object": f'<body name="object"><freejoint name="object"/>{geom} name="object" mass="0.05"/></body>',
    }
    world = f"""<mujoco><option timestep="0.002" cone="{cone}" impratio="10"/>{WEDGE}
      <worldbody>{"".join(bodies[name] for name in order)}</worldbody>
      <actuator><motor name="grip" joint="grip"/></actuator></mujoco>"""
    # the pads face each other along the world's z axis and are turned about it
    quat = Rotation.from_euler("z", 30, degrees=True).as_quat()[[3, 0, 1, 2]]
    mounts = [
        Mount("fixed", quat=tuple(quat)),
        Mount("moving", pos=(0, 0, 0.2e-3 - 2 * reach), quat=tuple(turned(quat))),
    ]
    # stiff enough for a sphere, which a single taxel may have to carry
    model, pads, data = attached(world, pad or Pad(LAYOUT, gel=Gel(modulus=3e6, thickness=1e-3)), *mounts)
    # gravity is mostly along the pads' surfaces: friction carries 80 % of the weight
    model.opt.gravity = Rotation.from_euler("xy", [50, 20], degrees=True).apply([0, 0, -9.81])
    place_object(model, data, find_pads(model, names=["fixed_pad"]), [0, 0, -reach])
    data.ctrl[0] = grip
    return model, pads, data
