"""Pads on a gripper that paxisim does not know: find the mounts, check them, and squeeze an object.

The gripper is a hand with three fingers on hinges, given below as MJCF; replace it with your own file. Needs the extra
viz:

    python examples/custom_gripper.py
"""

from __future__ import annotations

import mujoco

import paxisim

FINGER = """
      <body name="finger{i}" euler="0 0 {angle}">
        <body name="tip{i}" pos="0.045 0 -0.02">
          <joint name="hinge{i}" axis="0 1 0" range="-0.3 0.6" damping="0.5" armature="0.01"/>
          <geom name="link{i}" type="box" size="0.002 0.01 0.03" pos="0 0 -0.03" mass="0.05"/>
          <geom name="fingertip{i}" type="box" size="0.004 0.012 0.014" pos="0 0 -0.074" mass="0.02"/>
        </body>
      </body>"""
FINGERS = "".join(FINGER.format(i=i, angle=2.0944 * i) for i in range(3))
MOTORS = "".join(f'<motor joint="hinge{i}" ctrlrange="-1 1"/>' for i in range(3))
HAND = f"""
<mujoco model="three_fingers">
  <compiler angle="radian" autolimits="true"/>
  <option cone="elliptic" impratio="10"/>
  <worldbody>
    <body name="hand">
      <geom name="palm" type="cylinder" size="0.05 0.01" mass="0.3"/>{FINGERS}
    </body>
  </worldbody>
  <actuator>{MOTORS}</actuator>
</mujoco>
"""
TORQUE = 0.5  # Nm


def main() -> None:
    """Attach the pads, draw them, squeeze a ball and read the forces."""
    layout = paxisim.TaxelLayout(rows=4, cols=4, pitch=(5e-3, 5e-3))
    found = paxisim.find_mounts(HAND)
    print(found.report)  # read it: it says where the pads go, and why
    hand = paxisim.attach(HAND, paxisim.Pad(layout, thickness=3e-3, taxels="spheres"), found.mounts)
    paxisim.plot_mounts(hand).savefig("custom_gripper.png")

    # a fixed ball between the fingers; for a robot, attach hand.spec to an arm instead
    ball = hand.spec.worldbody.add_body(name="ball", pos=[0, 0, -0.09])
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.025, 0, 0])
    model = hand.compile()
    pads = hand.bind(model)
    readout = paxisim.TactileReadout(model, pads)

    data = mujoco.MjData(model)
    data.ctrl[:] = TORQUE
    mujoco.mj_step(model, data, nstep=2000)
    force = readout.read(data)
    print()
    for name, total in zip(pads.names, force.sum(axis=(-2, -1)), strict=True):
        print(f"{name}: normal force {total[2]:.2f} N, shear {total[0]:+.2f} {total[1]:+.2f} N")


if __name__ == "__main__":
    main()
