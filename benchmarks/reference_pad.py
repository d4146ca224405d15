"""Error of GCS against a magnetic pad from first principles: ``python benchmarks/reference_pad.py``.

The paper holds a square peg without other contact and reports the mean squared error of a taxel between simulation and
real sensor: 0.68 for the raw simulation, 0.11 for the best of five draws of GCS. In this benchmark, two flat pads of
6x5 taxels hold a box, and manufactured units of `paxisim.MagneticSensor` take the place of the real sensor. They sense
the forces of the flat pads. The script prints each unit's errors in N^2, averaged over taxels and axes, and the ratio
of the mean errors.
"""

from __future__ import annotations

import mujoco
import numpy as np
import tyro

import paxisim
from paxisim.scene import ready

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
GRIP = 8.0  # N, per finger
DRAWS = 5


class Hold:
    """Two pads that hold a box of 24 x 18 mm."""

    def __init__(self) -> None:
        """Compile the model."""
        self._model = mujoco.MjModel.from_xml_string(str(ready.gripper(LAYOUT, peg=True).mjcf))
        self._pads = paxisim.find_pads(self._model)
        paxisim.Gel().apply(self._model, self._pads)
        self._readout = paxisim.TactileReadout(self._model, self._pads)

    def force(self, surface: np.ndarray | None = None) -> np.ndarray:
        """Return ``(2, 3, 6, 5)`` newtons once the box is held, with pads of the given surface or flat pads."""
        if surface is not None:
            paxisim.set_surface(self._model, self._pads, surface)
        data = mujoco.MjData(self._model)
        for side in ("left", "right"):
            data.joint(f"gripper_{side}_slide").qpos = 0.034
        for now in np.arange(0, 2, self._model.opt.timestep):
            data.ctrl[0] = np.interp(now, [0, 0.5, 1.0], [0.3, 0.8, 2 * GRIP])
            mujoco.mj_step(self._model, data)
        return self._readout.read(data).astype(np.float64)


def main(units: int = 20, seed: int = 0) -> None:
    """Print the table.

    Args:
        units: Number of manufactured sensors.
        seed: Random seed of the GCS draws.
    """
    hold, gcs = Hold(), paxisim.GCS()
    flat = hold.force()
    print(f"held with {flat[:, 2].sum(axis=(1, 2)).round(2)} N; the units read:")
    rng, errors = np.random.default_rng(seed), []
    for unit in range(units):
        real = paxisim.MagneticSensor(LAYOUT, unit)(flat)
        best = np.inf
        for _ in range(DRAWS):
            bumpy = hold.force(gcs.sample_surface(rng, layout=LAYOUT))
            drawn = gcs.sample(rng, layout=LAYOUT)(bumpy)
            best = min(best, float(np.mean((drawn - real) ** 2)))
        errors.append((float(np.mean((flat - real) ** 2)), best))
        total, outward = real[:, 2].sum(axis=(1, 2)), np.abs(real[:, :2]).max()
        print(
            f"unit {unit:2d}: total {total[0]:5.1f} and {total[1]:5.1f} N, shear up to {outward:.2f} N; "
            f"error raw {errors[-1][0]:.3f}, best of {DRAWS} draws {best:.3f}",
            flush=True,
        )
    raw, drawn = np.mean(errors, axis=0)
    print(f"mean: raw {raw:.3f} N^2, GCS {drawn:.3f} N^2, ratio {drawn / raw:.2f} (paper: 0.68, 0.11, ratio 0.16)")
    print(f"GCS is closer than raw for {sum(d < r for r, d in errors)} of {units} units")


if __name__ == "__main__":
    tyro.cli(main)
