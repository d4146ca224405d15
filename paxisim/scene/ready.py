"""Ready-made scenes: an indenter on one pad, and a gripper that opens and closes."""

from __future__ import annotations

from importlib.resources import files

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.layout import TaxelLayout
from paxisim.models.attach import attach
from paxisim.models.mjcf import format_mjcf
from paxisim.models.mount import Mount
from paxisim.models.pad import Pad
from paxisim.scene.drive import Drive, ObjectStart
from paxisim.scene.scene import Scene

BALL = 0.02
"""Radius (m) of the indenter's ball. A ball needs no alignment and has no edge on which a taxel could catch."""

_INDENTER = f"""
<mujoco model="indenter">
  <compiler autolimits="true"/>
  <option timestep="0.002" cone="elliptic" impratio="10"/>
  <worldbody>
    <light pos="0.2 -0.2 0.4" dir="-1 1 -2"/>
    <body name="bench"/>
    <body name="ball" pos="0 0 {BALL}">
      <joint name="x" type="slide" axis="1 0 0" range="-0.05 0.05"/>
      <joint name="y" type="slide" axis="0 -1 0" range="-0.05 0.05"/>
      <joint name="depth" type="slide" axis="0 0 -1" range="-0.1 0.004"/>
      <geom name="ball" type="sphere" size="{BALL}" mass="0.1" rgba="0.7 0.7 0.75 1"/>
    </body>
  </worldbody>
</mujoco>
"""
_PEG = """
<mujoco model="peg">
  <option timestep="0.002" cone="elliptic" impratio="10"/>
  <worldbody>
    <light pos="0.3 -0.3 0.5" dir="-1 1 -1.5"/>
    <site name="hand" pos="0 0 0.2"/>
    <geom name="table" type="box" size="0.1 0.1 0.01" pos="0 0 0.085"/>
    <body name="peg" pos="0 0 0.125">
      <freejoint/>
      <geom name="peg" type="box" size="0.012 0.009 0.03" mass="0.06" rgba="0.8 0.65 0.4 1"/>
    </body>
  </worldbody>
</mujoco>
"""


def indenter(layout: TaxelLayout, heights: NDArray[np.floating] | None = None) -> Scene:
    """Build a scene in which a stage presses a ball on one pad that lies face up.

    The streams are ``x`` and ``y``, along the pad's own axes from its centre, and ``depth``, which is 0 where the ball
    touches the flat pad and positive where it is pressed in; all are in m.

    Args:
        layout: Taxel layout of the pad.
        heights: ``(rows, cols)`` thickness of each taxel cube (m), as for `Pad`. Default: a flat pad.
    """
    bench = attach(_INDENTER, Pad(layout, heights=heights), [Mount("bench", quat=(0.0, 1.0, 0.0, 0.0), name="pad")])
    drives = tuple(Drive(name, joint=name, unit="m") for name in ("x", "y", "depth"))
    return Scene(bench.to_xml(), drives, closing="depth")


def gripper(layout: TaxelLayout, *, peg: bool = False) -> Scene:
    """Build a scene of the two-finger gripper of `paxisim demo`, with a pad on each finger.

    The stream is ``opening``, the distance (m) between the pads.

    Args:
        layout: Taxel layout of each pad.
        peg: Put a box of 24 x 18 x 60 mm on a table between the fingers; otherwise the fingers move in free space.
    """
    text = files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8")
    # the pad frame on a fingertip: x along the hand's depth, y down to the tip, z into the finger
    mounts = [
        Mount(f"{side}_finger", (0, 0, -0.019), (0.5, -0.5, -0.5, 0.5), (f"{side}_fingertip",), side)
        for side in ("left", "right")
    ]
    tactile = attach(text, Pad(layout), mounts)
    world = mujoco.MjSpec.from_string(_PEG)
    if not peg:
        world.delete(world.body("peg"))
        world.delete(world.geom("table"))
    world.attach(tactile.spec, site=world.site("hand"), prefix="gripper_")
    mjcf = format_mjcf(world, "the scene")
    # the pads are 100 mm apart when the joints are at 0
    drives = tuple(
        Drive("opening", joint=f"gripper_{side}_slide", unit="m", scale=-0.5, offset=0.05) for side in ("left", "right")
    )
    start = (ObjectStart("peg", (0.0, 0.0, 0.125)),) if peg else ()
    return Scene(mjcf, drives, closing="opening", start=start)
