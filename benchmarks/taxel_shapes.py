"""Deviation of box and sphere taxels from a fine bed of springs: ``python benchmarks/taxel_shapes.py``.

Objects of four shapes press a pad of 21 x 21 mm with a gel of 400 kPa by 0.5 to 1 mm at six places. The bed consists of
24x24 spheres. All forces are summed over 6x6 blocks and compared with those of the bed. The script prints the total
normal force as a share of the bed's, and the error of a block as a share of the bed's root mean square.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import mujoco
import numpy as np
from numpy.typing import NDArray

import paxisim

SIDE, GEL = 21e-3, paxisim.Gel(modulus=400e3)
SHAPES = {
    "plate": ('type="box" size="0.03 0.03 0.018"', 0.018),
    "box, 12 x 10 mm": ('type="box" size="0.0062 0.0048 0.018"', 0.018),
    "ball, 20 mm": ('type="sphere" size="0.02"', 0.02),
    "ellipsoid": ('type="ellipsoid" size="0.027 0.021 0.018"', 0.018),
}
PADS = (("boxes", 6), ("boxes", 12), ("spheres", 6), ("spheres", 12))


def pressed(kind: str, count: int, shape: str, place: tuple[float, float, float]) -> NDArray[np.float64]:
    """Return the ``(6, 6)`` normal forces (N) on blocks of taxels."""
    geom, half = SHAPES[shape]
    x, y, depth = place
    text = f"""
    <mujoco>
      <option timestep="0.001" cone="elliptic" impratio="10" gravity="0 0 0"/>
      <worldbody>
        <body name="plate"/>
        <body pos="{x} {y} {half - depth}"><joint type="slide" axis="0 0 1" armature="1e6"/><geom {geom}/></body>
      </worldbody>
    </mujoco>
    """
    layout = paxisim.TaxelLayout(count, count, (SIDE / count, SIDE / count))
    thickness = 3.5e-3 if kind == "spheres" else 1e-3
    pad = paxisim.Pad(layout, thickness=thickness, taxels=kind)  # type: ignore[arg-type]
    bench = paxisim.attach(text, pad, [paxisim.Mount("plate", quat=(0, 1, 0, 0), name="pad")])
    model = bench.spec.compile()
    pads, data = paxisim.find_pads(model), mujoco.MjData(model)
    GEL.apply(model, pads)
    for _ in range(400):
        data.qpos[0] = data.qvel[0] = 0.0
        mujoco.mj_step(model, data)
    normal = paxisim.TactileReadout(model, pads).read(data)[0, 2].astype(np.float64)
    return normal.reshape(6, count // 6, 6, count // 6).sum(axis=(1, 3))


def main() -> None:
    """Print the table."""
    rng = np.random.default_rng(0)
    places = [(*rng.uniform(-3e-3, 3e-3, 2), rng.uniform(0.5e-3, 1e-3)) for _ in range(6)]
    print(f"{'object':<18}{'taxels':<16}{'sum':>8}{'error':>8}")
    for shape in SHAPES:
        bed = np.array([pressed("spheres", 24, shape, place) for place in places])
        for kind, count in PADS:
            own = np.array([pressed(kind, count, shape, place) for place in places])
            error = np.sqrt(np.mean((own - bed) ** 2) / np.mean(bed**2))
            print(f"{shape:<18}{f'{count}x{count} {kind}':<16}{own.sum() / bed.sum():>8.2f}{error:>8.2f}", flush=True)


if __name__ == "__main__":
    main()
