"""Draws docs/images/anyskin.png: three contacts on a simulated AnySkin, and what its five chips read.

The chips are drawn with the axes of the pad, so that the arrows show the field as it lies, not as each turned chip
transmits it.

    python docs/anyskin_figure.py
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from light_and_dark import light_and_dark
from matplotlib.figure import Figure

import paxisim
from paxisim.viz.drawing import on_dark

OUTPUT = Path(__file__).parent / "images" / "anyskin.png"
SCALE = 25.0  # uT for an arrow of 1 mm
LIGHT = ("Greys", 0.4, "tab:blue", "tab:red")  # colours of force, N of the last one, colours of chips and field
DARK = ("Greys_r", 0.6, "#6cb0f5", "#ff7b6b")


def press(row: int, col: int, shear: float = 0.0) -> np.ndarray:
    """Return an even press of 2 N on 4x4 cells from a corner, with a share of shear along x."""
    force = np.zeros((3, 10, 10))
    force[2, row : row + 4, col : col + 4] = 2 / 16
    force[0] = shear * force[2]
    return force


def main() -> None:
    """Simulate and draw."""
    design = paxisim.SkinDesign.named("anyskin")
    skin = paxisim.MagneticSkin(replace(design, turns=(0.0,) * 5))
    contacts = {
        "2 N in the middle": press(3, 3),
        "2 N at the right": press(3, 6),
        "2 N, dragged by 1 N": press(3, 3, 0.5),
    }
    fields = {name: skin.read(force)[:, 0] for name, force in contacts.items()}
    for name, flux in fields.items():
        print(f"{name}: x {flux[0].round(1)}, y {flux[1].round(1)}, z {flux[2].round(1)} uT")
    for path in light_and_dark(OUTPUT):
        draw(design, contacts, fields).savefig(path, dpi=110)


def draw(design: paxisim.SkinDesign, contacts: dict[str, np.ndarray], fields: dict[str, np.ndarray]) -> Figure:
    """Draw the contacts, and the field at the chips."""
    greys, top, blue, red = DARK if on_dark() else LIGHT
    x, y = 1e3 * np.array(design.chips).T
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    for index, (ax, (name, force)) in enumerate(zip(figure.subplots(1, 3), contacts.items(), strict=True)):
        flux = fields[name]
        touched = np.ma.masked_equal(force[2], 0)
        ax.imshow(touched, extent=(-10, 10, 10, -10), cmap=greys, vmin=0, vmax=top)
        ax.scatter(x, y, s=140, marker="s", facecolor="none", edgecolor=blue)
        arrows = {"angles": "xy", "scale_units": "xy", "scale": SCALE, "color": red, "width": 0.012}
        ax.quiver(x, y, flux[0], flux[1], **arrows)
        for at, z in zip(zip(x, y, strict=True), flux[2], strict=True):
            ax.annotate(f"{z:+.0f}", at, xytext=(0, -16), textcoords="offset points", ha="center", color=blue)
        ax.set(title=name, xlabel="x (mm)", ylabel="y (mm)" if index == 0 else "", xlim=(-10, 10), ylim=(10, -10))
        if index == 0:
            ax.quiver(-9, 8.5, 2 * SCALE, 0, **arrows)
            ax.text(-6.4, 8.5, f"{2 * SCALE:.0f} uT", va="center", color=red)
    return figure


if __name__ == "__main__":
    main()
