"""Draws docs/images/reference.png: a peg held between two pads, as the simulation, a reference sensor and GCS read it.

The states are those of docs/gcs_figure.py, and of the paper's Figures 1 and 3: a peg held in the air, and its lower end
pushed as by the rim of a hole. The reference is unit 7 of `paxisim.MagneticSensor`, both of its pads, which feel what
the flat pads of the simulation feel.

    python docs/reference_figure.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from gcs_figure import press, scene
from light_and_dark import light_and_dark
from matplotlib.figure import Figure

import paxisim
from paxisim.augment.gcs import GCS
from paxisim.viz.drawing import draw_pad, draw_scales

UNIT = 7
SEED = 6
OUTPUT = Path(__file__).parent / "images" / "reference.png"


def main() -> None:
    """Simulate and draw."""
    model, pads = scene()
    layout, rng, gcs = pads.layout, np.random.default_rng(SEED), GCS()
    raw = np.array(press(model, pads, GCS(geometry=False).sample_surface(rng, layout=layout)))
    bumpy = np.array(press(model, pads, gcs.sample_surface(rng, layout=layout)))
    drawn = gcs.sample(rng, layout=layout)(bumpy)
    real = paxisim.MagneticSensor(layout, UNIT)(raw)
    columns = {"raw simulation": raw, f"reference, unit {UNIT}": real, "GCS draw": drawn}  # (states, pads, ...)
    rows = {"left pad, held in the air": (0, 0), "right pad, held in the air": (0, 1), "left pad, pushed": (1, 0)}
    readings = np.array([[column[where] for where in rows.values()] for column in columns.values()]).astype(float)
    vmax, lowest = float(readings[:, :, 2].max()), float(readings[:, :, 2].min())
    shear_max = float(np.hypot(readings[:, :, 0], readings[:, :, 1]).max())
    for path in light_and_dark(OUTPUT):
        figure = Figure(figsize=(8.0, 8.8), layout="constrained")
        axes = figure.subplots(3, 3)
        for row, state in enumerate(rows):
            for column, name in enumerate(columns):
                ax = axes[row, column]
                picture = draw_pad(ax, readings[column, row], layout, vmax, shear_max, name if row == 0 else "")
                if column == 2:  # all are on the scales shown here
                    draw_scales(ax, picture, layout, lowest, vmax, shear_max)
                ax.set_ylabel(f"{state}\n\ny (mm)" if column == 0 else "")
                ax.set_xlabel("x (mm)" if row == 2 else "")
        figure.savefig(path, dpi=100)
    print(f"{OUTPUT.name}: normal force {lowest:.2f} to {vmax:.2f} N, shear up to {shear_max:.2f} N")
    for name, pictures in zip(columns, readings, strict=True):
        for state, (x, y, z) in zip(rows, pictures, strict=True):
            total = f"{z.sum():.2f} N in all, {z.min():.3f} to {z.max():.3f} N"
            print(f"{name}, {state}: normal {total}; shear up to {np.hypot(x, y).max():.3f} N")


if __name__ == "__main__":
    main()
