"""The simulated eFlesh next to real presses: ``python benchmarks/magnetic_skin.py FOLDER``.

FOLDER holds two recordings of eFlesh, ``press_1`` and ``press_2`` (see `paxisim.logs.eflesh`). An even load on 4x4
cells of `paxisim.MagneticSkin("eflesh")` stands for the indenter, whose shape and place are not published. Only that
place is fitted: the one of 7x7 at which the change of all fifteen channels at 20 N points most nearly along the
measured one, for the turns of both boards and both signs of the magnets' poles. Compared are the size of each chip's
change at 20 N, its growth with the load as the exponent of a power law from 2 to 30 N while loading, and the width of
the loop, which the simulation lacks.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

import paxisim

LOADS = np.array([2.0, 5.0, 10.0, 20.0, 30.0])
REFERENCE = 3  # index of 20 N
TOLERANCE = 0.05  # relative width of a bin of the load
SIDE = 4  # cells along a side of the press
TURNS = {"black board": (-90, -90, 180, 90, 0), "white board": (270, 0, -90, 180, 90)}


def measured(recording: paxisim.Recording) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Return the mean change at each load, ``(loads, 3, 5)`` uT, while loading and while unloading."""
    load, height = recording.covariates["load"].reshape(-1), recording.covariates["robot_z"].reshape(-1)
    flux = recording.measured[:, 0, :, 0].astype(np.float64)
    flux = flux - flux[load < 0.5].mean(axis=0)
    speed = np.gradient(height, recording.time)
    ways = []
    for way in (speed < 0, speed > 0):
        near = [way & (np.abs(load - at) < TOLERANCE * at) for at in LOADS]
        ways.append(np.array([flux[chosen].mean(axis=0) for chosen in near]))
    return ways[0], ways[1]


def presses() -> NDArray[np.float64]:
    """Return the loads of a press at each place, ``(7, 7, loads, 3, 10, 10)``."""
    places = 10 - SIDE + 1
    force = np.zeros((places, places, len(LOADS), 3, 10, 10))
    for row in range(places):
        for col in range(places):
            force[row, col, :, 2, row : row + SIDE, col : col + SIDE] = LOADS[:, None, None] / SIDE**2
    return force


def growth(flux: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the exponent of a power law of the load for the size of each chip's change."""
    return np.polyfit(np.log(LOADS), np.log(np.linalg.norm(flux, axis=1)), 1)[0]


def main(folder: tyro.conf.Positional[Path]) -> None:
    """Print the comparison.

    Args:
        folder: Folder with press_1 and press_2.
    """
    np.set_printoptions(precision=2, suppress=True)
    simulated = {}
    eflesh = paxisim.SkinDesign.named("eflesh")
    for board, turns in TURNS.items():
        for poles, sign in (("", 1), (", other poles", -1)):
            design = replace(eflesh, turns=tuple(np.radians(turns)), remanence=sign * eflesh.remanence)
            simulated[board + poles] = paxisim.MagneticSkin(design).read(presses())[..., 0, :]
    for n in (1, 2):
        down, up = measured(paxisim.Recording.load(folder / f"press_{n}.sensor.csv"))
        size = np.linalg.norm(down[REFERENCE], axis=0)
        loop = np.linalg.norm(up - down, axis=(1, 2)) / np.linalg.norm(down, axis=(1, 2))
        print(f"press_{n}, chips centre, left, right, up, down")
        print(f"  measured: {size.round()} uT at 20 N, {size / size.max()} of the largest, exponents {growth(down)}")
        print(f"  loop: {loop} of the change at {LOADS} N")
        for name, flux in simulated.items():
            at = flux[:, :, REFERENCE].reshape(7, 7, -1)
            cosine = at @ down[REFERENCE].ravel() / np.linalg.norm(at, axis=-1) / np.linalg.norm(down[REFERENCE])
            row, col = np.unravel_index(cosine.argmax(), cosine.shape)
            size = np.linalg.norm(flux[row, col, REFERENCE], axis=0)
            x, y = 3 * (col - 3), 3 * (row - 3)
            print(f"  {name}: cosine {cosine.max():.2f} with a press at {x}, {y} mm, {cosine[3, 3]:.2f} in the middle")
            print(f"    {size.round()} uT at 20 N, {size / size.max()} of the largest", end="")
            print(f", exponents {growth(flux[row, col])}")


if __name__ == "__main__":
    tyro.cli(main)
