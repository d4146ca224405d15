"""Error of GCS against a magnetic pad from first principles: ``python benchmarks/reference_pad.py``.

The paper holds a square peg without other contact and reports the mean squared error of a taxel between simulation and
real sensor: 0.68 for the raw simulation, 0.11 for the best of five draws of GCS. In this benchmark, two pads of 6x5
taxels hold a box, and manufactured units of `paxisim.MagneticSensor` take the place of the real sensor. The raw
simulation has flat pads. The units sense the forces of flat pads, or of pads with their own uneven surfaces.

The script prints a table in Markdown: for each gel, grip and surface, the mean errors in N^2 over taxels and axes,
their ratio, on how many units GCS is closer, and the standard deviation of the normal forces on the units over their
mean.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import mujoco
import numpy as np
import tyro

import paxisim
from paxisim.scene import ready

LAYOUT = paxisim.TaxelLayout(6, 5, (26.1e-3 / 6, 22.6e-3 / 5))
PAPER = "paper", "", "", "0.68", "0.11", "0.16", "", ""
GELS = {
    "default, 100 kPa": paxisim.Gel(),
    "0.5 MPa layer, taxel": paxisim.Gel.of(paxisim.Layer(), LAYOUT, "taxel"),
}
DRAWS = 5


class Hold:
    """Two pads that hold a box of 24 x 18 mm."""

    def __init__(self, gel: paxisim.Gel, grip: float) -> None:
        """Compile the model.

        Args:
            gel: Gel of the pads.
            grip: Force of each finger (N).
        """
        self._model = mujoco.MjModel.from_xml_string(str(ready.gripper(LAYOUT, peg=True).mjcf))
        self._model.actuator_ctrlrange[0] = (-grip, grip)
        self._pads, self._grip = paxisim.find_pads(self._model), grip
        gel.apply(self._model, self._pads)
        self._readout = paxisim.TactileReadout(self._model, self._pads)
        self._flat = np.full((2, LAYOUT.rows, LAYOUT.cols), 1e-3)

    def force(self, surface: np.ndarray | None = None) -> np.ndarray:
        """Return ``(2, 3, 6, 5)`` newtons once the box is held, with pads of the given surface or flat pads."""
        paxisim.set_surface(self._model, self._pads, self._flat if surface is None else surface)
        data = mujoco.MjData(self._model)
        for side in ("left", "right"):
            data.joint(f"gripper_{side}_slide").qpos = 0.034
        for now in np.arange(0, 2, self._model.opt.timestep):
            data.ctrl[0] = np.interp(now, [0, 0.5, 1.0], [0.3, 0.8, self._grip])  # the tendon pulls both fingers
            mujoco.mj_step(self._model, data)
        return self._readout.read(data).astype(np.float64)


def compare(hold: Hold, units: int, seed: int, uneven: bool) -> tuple[str, ...]:
    """Return the errors, their ratio, how often GCS is closer, and how uneven the normal forces are."""
    flat, gcs = hold.force(), paxisim.GCS()
    rng, errors, spread = np.random.default_rng(seed), [], []
    for unit in range(units):
        sensor = paxisim.MagneticSensor(LAYOUT, unit)
        felt = hold.force(sensor.heights(2)) if uneven else flat
        real = sensor(felt)
        best = np.inf
        for _ in range(DRAWS):
            bumpy = hold.force(gcs.sample_surface(rng, layout=LAYOUT))
            drawn = gcs.sample(rng, layout=LAYOUT)(bumpy)
            best = min(best, float(np.mean((drawn - real) ** 2)))
        errors.append((float(np.mean((flat - real) ** 2)), best))
        spread.append(felt[:, 2].std() / felt[:, 2].mean())
    raw, drawn = np.mean(errors, axis=0)
    closer = sum(best < first for first, best in errors)
    return f"{raw:.3f}", f"{drawn:.3f}", f"{drawn / raw:.2f}", f"{closer} of {units}", f"{np.mean(spread):.2f}"


def main(units: int = 20, seed: int = 0, grips: tuple[float, ...] = (8.0, 16.0, 30.0)) -> None:
    """Print the table.

    Args:
        units: Number of manufactured sensors.
        seed: Random seed of the GCS draws.
        grips: Forces of each finger (N); 30 N is the grip of the insertion tasks.
    """
    print(f"paxisim {paxisim.__version__}, MuJoCo {mujoco.__version__}, {units} units, seed {seed}\n")
    head = (
        "gel",
        "grip (N)",
        "units' surfaces",
        "raw (N²)",
        "GCS (N²)",
        "ratio",
        "GCS is closer",
        "std/mean of loads",
    )
    for row in (head, ["---"] * len(head), PAPER):
        print("| " + " | ".join(row) + " |")
    for name, gel in GELS.items():
        for grip in grips:
            hold = Hold(gel, grip)
            for uneven in (False, True):
                found = compare(hold, units, seed, uneven)
                row = name, f"{grip:g}", "uneven" if uneven else "flat", *found
                print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    tyro.cli(main)
