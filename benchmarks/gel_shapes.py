"""How far springs are from the elastic layer under round and edged objects: ``python benchmarks/gel_shapes.py``.

Objects of six shapes press on a pad of 6x5 taxels with 8 N, at six random places. The script prints two tables in
Markdown. Each cell has the indentation over that of the elastic layer, and the share of the load on other taxels than
those that the layer loads. The springs are those of `paxisim.Gel.of` for three contacts: a flat face over the pad, one
taxel, and a ball of 20 mm at 5 N.

- a bed of springs finer than taxels, for layers of 0.1 to 1.2 MPa;
- box and sphere taxels in MuJoCo, in place of one layer.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported

import mujoco
import numpy as np
import tyro
from gel_layers import CONTACTS, HALF, LAYERS, LAYOUT, RADIUS, Place, bench, loads_of, print_head, print_row, settled
from numpy.typing import NDArray

import paxisim
from paxisim.layer.contact import pressed

SHAPES = (*HALF, *RADIUS)
FORCE, PLACES = 8.0, 6  # N
FINE = 4  # cells along a side of a taxel, for the elastic layer under an object
Pressed = tuple[NDArray[np.float64], float]  # normal forces (N), (30,), and indentation (m)


def elastic(shape: str, layer: paxisim.Layer, at: Place, force: float, stiffness: float | None = None) -> Pressed:
    """Return the loads and the indentation of the elastic layer, or of springs of this stiffness (N/m) on its cells."""
    cells = paxisim.TaxelLayout(FINE * 6, FINE * 5, (LAYOUT.pitch[0] / FINE, LAYOUT.pitch[1] / FINE))
    x, y = (cells.positions[:, axis].astype(np.float64) - at[axis] for axis in (0, 1))
    if shape in RADIUS:
        radius = RADIUS[shape]
        squared = np.clip(radius**2 - (y**2 + (x**2 if "ball" in shape else 0)), 0, None)
        gap = radius - np.sqrt(squared)
    else:
        shift, (half_x, half_y) = HALF[shape][0] if "edge" in shape else 0.0, HALF[shape]
        gap = np.where((np.abs(x - shift) <= half_x) & (np.abs(y) <= half_y), 0.0, 1.0)
    matrix = layer.compliance(cells) if stiffness is None else np.eye(cells.taxels) / stiffness
    loads, depth = pressed(matrix, gap, force)
    return loads.reshape(6, FINE, 5, FINE).sum(axis=(1, 3)).ravel(), depth + float(gap.min())


def beds(places: list[Place]) -> None:
    """Print the table of springs finer than taxels."""
    print_head("Objects at 8 N: a bed of springs", "layer", "object", "layer sinks (mm)", *CONTACTS)
    for name, layer in LAYERS.items():
        for shape in SHAPES:
            exact = [elastic(shape, layer, at, FORCE) for at in places]
            found = []
            for contact in CONTACTS.values():
                stiffness = layer.stiffness(LAYOUT, contact) / FINE**2
                bed = [elastic(shape, layer, at, FORCE, stiffness) for at in places]
                found.append(compared(bed, exact))
            print_row(name, shape, f"{1e3 * np.mean([depth for _, depth in exact]):.3f}", *found)


def taxels(places: list[Place], layer: str) -> None:
    """Print the table of MuJoCo's taxels."""
    kinds = ("boxes", "spheres")
    heads = [f"{kind}, {contact}" for kind in kinds for contact in CONTACTS]
    print_head(f"Objects at 8 N: MuJoCo's taxels in place of {layer}", "object", *heads)
    gels = [paxisim.Gel.of(LAYERS[layer], LAYOUT, contact) for contact in CONTACTS.values()]
    for shape in SHAPES:
        exact = [elastic(shape, LAYERS[layer], at, FORCE) for at in places]
        found = []
        for kind in kinds:
            for gel in gels:
                pressed_ = []
                for at in places:
                    model, pads, data = bench(shape, gel, kind=kind, at=at)
                    depth = settled(model, data, (FORCE, 0.0), 0.4)
                    pressed_.append((loads_of(model, pads, data), depth))
                found.append(compared(pressed_, exact))
        print_row(shape, *found)


def compared(found: list[Pressed], exact: list[Pressed]) -> str:
    """Return the indentation over the exact one, and the share of the load on the wrong taxels."""
    sinks = np.mean([own for _, own in found]) / np.mean([true for _, true in exact])
    wrong = [np.abs(own - true).sum() / 2 / true.sum() for (own, _), (true, _) in zip(found, exact, strict=True)]
    return f"{sinks:.2f} x, {100 * np.mean(wrong):.0f} %"


def main(seed: int = 0, layer: str = "0.3 MPa") -> None:
    """Print the tables.

    Args:
        seed: Random seed of the places.
        layer: Layer of the table of MuJoCo's taxels.
    """
    rng = np.random.default_rng(seed)
    places = [(x, y) for x, y in rng.uniform(-0.5, 0.5, (PLACES, 2)) * np.array(LAYOUT.pitch[::-1])]
    print(f"paxisim {paxisim.__version__}, MuJoCo {mujoco.__version__}, seed {seed}")
    beds(places)
    taxels(places, layer)


if __name__ == "__main__":
    tyro.cli(main)
