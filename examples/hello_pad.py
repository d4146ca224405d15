"""One pad, one box: the smallest program that reads a tactile tensor.

A box of 100 g falls onto a pad that lies face up. At rest, the pad reads the weight of the box. Needs the extra viz:

    python examples/hello_pad.py
"""

from __future__ import annotations

import mujoco

import paxisim

SCENE = """
<mujoco>
  <option cone="elliptic" impratio="10"/>
  <worldbody>
    <body name="table"/>
    <body pos="0 0 0.02">
      <freejoint/>
      <geom type="box" size="0.0065 0.0085 0.01" mass="0.1"/>
    </body>
  </worldbody>
</mujoco>
"""


def main() -> None:
    """Drop the box, read the tensor and draw it."""
    layout = paxisim.TaxelLayout(rows=6, cols=5, pitch=(4.35e-3, 4.52e-3))  # m
    # z of the pad frame points into the pad, so half a turn about x puts the pad face up
    tactile = paxisim.attach(SCENE, layout, [paxisim.Mount("table", quat=(0, 1, 0, 0))])
    model = tactile.compile()
    pads = tactile.bind(model)
    readout = paxisim.TactileReadout(model, pads)

    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, nstep=1000)  # 2 s
    force = readout.read(data)  # (pads, 3, rows, cols) float32, newtons

    print(f"tensor {force.shape} {force.dtype}")
    print(f"weight {0.1 * 9.81:.3f} N, read {force[0, 2].sum():.3f} N")
    print(force[0, 2].round(2))  # normal force on each taxel
    paxisim.plot_tactile(force[0], layout).figure.savefig("hello_pad.png")


if __name__ == "__main__":
    main()
