"""Prediction of a real sensor with a model of moving magnets: ``python benchmarks/eflesh_physics.py FOLDER``.

FOLDER holds two recordings of eFlesh, ``press_1`` and ``press_2`` (see `paxisim.logs.eflesh`): four disc magnets of
N52, 3/8 by 1/8 inch, in a printed lattice above five magnetometers. The parts of `paxisim.reference` predict all
fifteen channels from the load. The lattice is compressed like a neo-Hookean rod. Each magnet follows it by its own
share and tilts. Each magnetometer is rotated in its plane by its own angle and reads the sum of four dipoles. These
parameters are fitted to one recording from several starts and judged on the other, next to the readouts of
`calibrate_readout`::

    NRMSE = sqrt(sum (measured - predicted)^2 / sum measured^2)    over all samples and channels
"""

from __future__ import annotations

import math
import warnings
from pathlib import Path

import numpy as np
import tyro
from scipy.optimize import least_squares

import paxisim
from paxisim.calibrate.loads import values_of
from paxisim.reference.dipoles import field, turned
from paxisim.reference.parameters import VACUUM
from paxisim.reference.stiffening import finite_share

MOMENT = 1.45 * math.pi / 4 * 9.525e-3**2 * 3.175e-3 / VACUUM
"""Moment of a magnet (A m^2); grade N52 has a remanence of 1.43 to 1.48 T."""
HEIGHT = 10e-3
"""Height of the lattice (m), which sets the scale of its strain."""
BOARD = np.array([[0, 0, 0], [-7, 0, 0], [7, 0, 0], [0, 7, 0], [0, -7, 0]]) * 1e-3
"""Assumed positions of the magnetometers (m): centre, left, right, up and down, 7 mm apart as on AnySkin's board."""
MAGNETS = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * 6e-3
STRIDE = 12  # the fit uses every 12th sample
STARTS = 12


def predicted(values: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Return the ``(T, 15)`` change of the flux (uT) under a load ``(T,)`` (N)."""
    stiffness, angle = np.exp(values[0]), values[1:6]
    place, tilt, follow, lean = np.split(values[6:], [12, 20, 32])
    place, follow = place.reshape(4, 3) * 1e-3, follow.reshape(4, 3)
    tilt, lean = (np.pad(part.reshape(4, 2), ((0, 0), (0, 1))) for part in (tilt, lean))
    strain = np.clip(load, 0, None)[:, None, None] / stiffness
    stroke = HEIGHT * strain * finite_share(strain)
    moment = turned(np.tile([0.0, 0.0, MOMENT], (4, 1)), tilt)

    def flux(there: np.ndarray, moment: np.ndarray) -> np.ndarray:
        offsets = BOARD[:, None] - there[:, None]
        return field(np.broadcast_to(moment[:, None], offsets.shape), offsets).sum(axis=-2)

    moved = place - stroke * follow
    leaning = turned(np.broadcast_to(moment, moved.shape), stroke / HEIGHT * lean)
    change = flux(moved, leaning) - flux(place[None], moment[None])
    c, s = np.cos(angle), np.sin(angle)
    x, y = change[..., 0] * c + change[..., 1] * s, change[..., 1] * c - change[..., 0] * s
    return 1e6 * np.stack([x, y, change[..., 2]], axis=-1).reshape(len(load), 15)


def fit(load: np.ndarray, channels: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return the best values of several starts, and each channel's offset."""
    load, channels = load[::STRIDE], channels[::STRIDE]
    scale = channels.std(axis=0)

    def left(values: np.ndarray) -> np.ndarray:
        off = predicted(values, load) - channels
        return ((off - off.mean(axis=0)) / scale.mean()).ravel()

    best, found = np.inf, None
    for _ in range(STARTS):
        place = np.column_stack([MAGNETS * 1e3, np.full(4, rng.uniform(8, 14))]) + rng.normal(0, 0.5, (4, 3))
        turns = rng.integers(0, 4, 5) * np.pi / 2
        start = np.concatenate(
            [[np.log(40.0)], turns, place.ravel(), np.zeros(8), np.tile([0, 0, 0.5], 4), np.zeros(8)]
        )
        result = least_squares(left, start, method="trf", max_nfev=60, x_scale="jac", loss="soft_l1")
        if result.cost < best:
            best, found = result.cost, result.x
    assert found is not None
    return found, (channels - predicted(found, load)).mean(axis=0)


def main(folder: tyro.conf.Positional[Path], seed: int = 0) -> None:
    """Print the table.

    Args:
        folder: Folder with press_1 and press_2.
        seed: Random seed of the starts.
    """
    warnings.simplefilter("ignore")
    presses = [paxisim.Recording.load(folder / f"press_{n}.sensor.csv") for n in (1, 2)]
    for first, other in ((0, 1), (1, 0)):
        fitted, judged = presses[first], presses[other]
        straight = paxisim.calibrate_readout(fitted, "load")
        cubic = paxisim.calibrate_readout(fitted, "load", degree=3)
        loads, channels = [], []
        for one in (fitted, judged):
            values = values_of(one, straight.loads)
            known = np.isfinite(values).all(axis=1)
            loads.append(straight.earlier(one[known], values[known]))
            channels.append(one.measured[known])
        flat = [np.moveaxis(part[:, 0, :, 0], 1, 2).reshape(len(part), 15).astype(np.float64) for part in channels]
        values, offset = fit(loads[0][:, 0], flat[0], np.random.default_rng(seed))
        size = np.sum(flat[1] ** 2)
        physics = float(np.sqrt(np.sum((flat[1] - predicted(values, loads[1][:, 0]) - offset) ** 2) / size))
        errors = []
        for readout in (straight, cubic):
            said = readout.to_channels(readout.expected(loads[1]))
            errors.append(float(np.sqrt(np.sum((channels[1] - said) ** 2) / size)))
        print(
            f"press_{first + 1} to press_{other + 1}: linear readout {errors[0]:.4f}, cubic {errors[1]:.4f}, "
            f"magnets {physics:.4f} ({physics / errors[0]:.2f} of linear)"
        )
        heights, follow = values[6:18].reshape(4, 3)[:, 2], values[26:38].reshape(4, 3)[:, 2]
        strain = 30 / np.exp(values[0])
        print(
            f"  magnets {heights.round(1)} mm above the board, moving {follow.round(2)} of the lattice's stroke, "
            f"{1e3 * HEIGHT * strain * finite_share(np.float64(strain)):.1f} mm at 30 N",
            flush=True,
        )


if __name__ == "__main__":
    tyro.cli(main)
