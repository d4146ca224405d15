"""Scenes shared by several tests: a plate on a pad, a two-finger gripper in plain MJCF, the package's own gripper."""

from importlib.resources import files

import mujoco
import numpy as np

from paxisim import Mount, Pad, Pads, TaxelLayout, find_pads

PAPER = TaxelLayout(12, 10, (26.1e-3 / 12, 22.6e-3 / 10))
POOLED = PAPER.pool(2, 2)

# The gripper closes along x and points down. It has one of everything that `attach` must keep.
GRIPPER = """
<mujoco model="gripper">
  <compiler angle="radian" autolimits="true"/>
  <default>
    <geom friction="0.7 0.01 0.001"/>
    <default class="finger">
      <joint type="slide" axis="1 0 0" range="-0.02 0.04" damping="20" armature="0.2"/>
      <geom type="box" rgba="0.3 0.3 0.3 1"/>
      <site rgba="1 0 0 1"/>
      <default class="tip">
        <geom friction="0.8 0.01 0.001" mass="0.02"/>
      </default>
    </default>
    <default class="drive">
      <motor ctrlrange="-30 30"/>
    </default>
  </default>
  <asset>
    <material name="black" rgba="0.1 0.1 0.1 1"/>
  </asset>
  <worldbody>
    <body name="hand">
      <geom name="palm" type="box" size="0.06 0.02 0.015" mass="0.4" material="black"/>
      <site name="grip_site" pos="0 0 -0.06"/>
      <camera name="wrist" pos="0 0.1 0"/>
      <body name="left_finger" pos="-0.03 0 -0.05" childclass="finger">
        <joint name="left_slide"/>
        <geom name="left_link" size="0.003 0.012 0.02" pos="-0.008 0 0.015" mass="0.05"/>
        <geom name="left_tip" class="tip" size="0.002 0.014 0.016" pos="-0.005 0 -0.016"/>
        <site name="left_site"/>
      </body>
      <body name="right_finger" pos="0.03 0 -0.05" quat="0 0 0 1" childclass="finger">
        <joint name="right_slide"/>
        <geom name="right_link" size="0.003 0.012 0.02" pos="-0.008 0 0.015" mass="0.05"/>
        <geom class="tip" size="0.002 0.014 0.016" pos="-0.005 0 -0.016"/>
        <site name="right_site"/>
      </body>
    </body>
  </worldbody>
  <contact>
    <exclude name="hand_left" body1="hand" body2="left_finger"/>
    <exclude body1="right_finger" body2="hand"/>
  </contact>
  <tendon>
    <fixed name="squeeze">
      <joint joint="left_slide" coef="1"/>
      <joint joint="right_slide" coef="1"/>
    </fixed>
  </tendon>
  <equality>
    <joint name="together" joint1="left_slide" joint2="right_slide" polycoef="0 1 0 0 0"/>
  </equality>
  <actuator>
    <motor name="close" class="drive" tendon="squeeze"/>
  </actuator>
  <sensor>
    <tendonpos name="opening" tendon="squeeze"/>
    <force name="left_force" site="left_site"/>
    <jointpos name="right_pos" joint="right_slide"/>
  </sensor>
  <keyframe>
    <key name="open" qpos="-0.01 -0.012" ctrl="-3"/>
    <key name="closed" time="0.5" qpos="0.01 0.01" qvel="0.1 0.2" ctrl="7"/>
  </keyframe>
</mujoco>
"""

# the pad frame on a fingertip: z into the finger (-x of its body), y down the finger (-z), x = y cross z (+y)
INTO_FINGER = (0.5, -0.5, -0.5, 0.5)
TIP_SURFACE = (0.0, 0.0, -0.016)

# the package's own gripper, whose fingertips are flat
OWN_GRIPPER = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")


def fingertips(**changed) -> list[Mount]:
    """Return the mounts on the fingertips of the package's gripper, with the changes given."""
    place = {"pos": (0, 0, -0.019), "quat": INTO_FINGER} | changed
    return [Mount(f"{side}_finger", **place, replaces=(f"{side}_fingertip",)) for side in ("left", "right")]


def axes_of(quat) -> np.ndarray:
    """Return the x, y and z axes of an orientation as the columns of a matrix."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.asarray(quat, dtype=float))
    return matrix.reshape(3, 3)


def with_pad(world: mujoco.MjSpec | str, pad: Pad, *, body="", prefix="p_", **place) -> mujoco.MjSpec:
    """Put the pad into a world, on a body or fixed, and return the spec."""
    spec = mujoco.MjSpec.from_string(world) if isinstance(world, str) else world
    frame = (spec.body(body) if body else spec.worldbody).add_frame(**place)
    frame.attach_body(mujoco.MjSpec.from_string(pad.to_xml()).body(pad.name), prefix, "")
    return spec


def compiled(pad: Pad, **options) -> tuple[mujoco.MjModel, Pads]:
    """Compile the pad on its own and find it in the model."""
    model = mujoco.MjModel.from_xml_string(pad.to_xml())
    set_options(model, **options)
    return model, find_pads(model)


def set_options(model: mujoco.MjModel, *, timestep=2e-3, cone="elliptic", impratio=1.0, gravity=(0, 0, 0)) -> None:
    model.opt.timestep = timestep
    model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC if cone == "elliptic" else mujoco.mjtCone.mjCONE_PYRAMIDAL
    model.opt.impratio = impratio
    model.opt.gravity = gravity


def plate_under_pad(pad: Pad, *, mass=0.5, joint="slide", attributes="", apply=True, size=0.05, **options):
    """Return a plate that touches the pad from outside (-z) and is free to move along z, or also along x or y.

    Args:
        pad: The pad.
        mass: Mass of the plate (kg).
        joint: ``"slide"`` (along z) or the axes of the slides, e.g. ``"zx"``.
        attributes: Additional attributes of the plate's geom.
        apply: Whether the pad's gel is applied to the compiled model.
        size: Half the edge length of the plate (m).
        **options: Passed to `set_options`.

    Returns:
        Model, pads and fresh data; ``qpos[0]`` is the indentation of the flat surface (m).
    """
    axes = "z" if joint == "slide" else joint
    vectors = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    joints = "".join(f'<joint name="{a}" type="slide" axis="{vectors[a]}"/>' for a in axes)
    world = f"""<mujoco><worldbody><body name="plate" pos="0 0 -0.01">{joints}
      <geom name="plate" type="box" size="{size} {size} 0.01" mass="{mass}" {attributes}/>
    </body></worldbody></mujoco>"""
    model = with_pad(world, pad, prefix="the_").compile()
    set_options(model, **options)
    pads = find_pads(model)
    if apply:
        pad.gel.apply(model, pads)
    return model, pads, mujoco.MjData(model)


def settle(model: mujoco.MjModel, data: mujoco.MjData, force, seconds: float) -> None:
    """Push the joints with `force` (N, one per degree of freedom) for `seconds`."""
    data.qfrc_applied[: np.size(force)] = force
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
