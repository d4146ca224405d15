"""``python -m paxisim_insertion.surrogate --seed 1 --out sensor-1.json``: draw a surrogate of a real sensor.

A surrogate is a chain of effects known from real pads, drawn from ranges that no training has seen; no real sensor is
involved. GCS draws uncorrelated gains, a 3x3 kernel and no memory. A surrogate's gains differ between pads and have a
gradient across each pad, its shear comes from a wider kernel, and it adds stiffening, creep, hysteresis, a magnetic
field, a dead band and quantisation.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import paxisim
from paxisim import augment

from .shell import command

PADS, ROWS, COLS = 2, 6, 5
OPEN = 0.08
"""Gripper opening (m) at which the sensor is zeroed: the Panda gripper's maximum."""

FIELD = "interference"
FLAT = 1e-3
"""Taxel height (m) of a flat pad."""

COUNT = 0.1
"""Newtons per count of PaXini's pads."""


def draw(seed: int, *, field: bool = True) -> paxisim.Chain:
    """Draw a surrogate; the same seed gives the same surrogate.

    Args:
        seed: Random seed.
        field: Include the field of the other finger's magnets, for a sensor that was zeroed with the gripper open: with
            the gripper closed on the peg each taxel is off by up to 0.3 N. Without the field the sensor behaves as if
            it had been zeroed at that opening.

    Returns:
        A chain for tensors ``(2, 3, 6, 5)`` in newtons. With the field it needs the covariate ``gripper_opening`` (m).
    """
    rng = np.random.default_rng(seed)
    direction = rng.uniform(0, 2 * np.pi, (PADS, 1, 1))
    row, col = np.meshgrid(np.linspace(-1, 1, ROWS), np.linspace(-1, 1, COLS), indexing="ij")
    lean = rng.uniform(0.1, 0.3, (PADS, 1, 1)) * (np.cos(direction) * row + np.sin(direction) * col)
    per_metre = rng.uniform(-6, 6, (PADS, 3))
    chain = paxisim.Chain(
        [
            augment.Stiffening(rng.uniform(0.8, 1.2), 1.0),
            augment.Creep(rng.uniform(0.03, 0.15, 2), (rng.uniform(0.2, 1), rng.uniform(2, 10))),
            augment.Hysteresis(rng.uniform(0.03, 0.1, 3), (0.05, 0.2, 0.8)),
            augment.Poisson(*rng.uniform(0.1, 0.3, 2), reach=2.9, falloff=rng.uniform(0.5, 2)),
            augment.PadAxisGain(rng.uniform(0.6, 1.4, (PADS, 3))),
            augment.TaxelGain(np.maximum(1 + lean + rng.normal(0, 0.1, lean.shape), 0.2)),
            augment.Interference(
                linear=per_metre, linear_rise=per_metre * rng.uniform(-0.1, 0.1, (2, 1, 1)), zeroed_at=OPEN
            ),
            augment.DeadBand(rng.uniform(0.05, 0.15, 3), rng.uniform(0, 1)),
            augment.Quantisation((COUNT,) * 3),
        ]
    )
    kept = [(name, member) for name, member in zip(chain.names, chain.members, strict=True) if field or name != FIELD]
    return paxisim.Chain([member for _, member in kept], [name for name, _ in kept])


def uneven(seed: int, layout: paxisim.TaxelLayout) -> NDArray[np.floating]:
    """Draw taxel heights ``(pads, rows, cols)`` (m): long waves, 0.1 to 0.3 mm peak to peak.

    GCS instead draws a single bump or dent per pad, which is lower along the pad's edges.
    """
    rng = np.random.default_rng([seed, 1])
    row, col = np.meshgrid(np.linspace(-1, 1, layout.rows), np.linspace(-1, 1, layout.cols), indexing="ij")
    heights = np.empty((PADS, layout.rows, layout.cols))
    for pad in heights:
        waves = rng.uniform(-1, 1, (3, 2)) * np.pi
        pad[:] = sum(
            np.cos(x * row + y * col + phase) for (x, y), phase in zip(waves, rng.uniform(0, 6.3, 3), strict=True)
        )
        pad *= rng.uniform(0.1e-3, 0.3e-3) / np.ptp(pad)
        pad += FLAT - pad.mean()
    return heights


def unit(name: str, layout: paxisim.TaxelLayout) -> paxisim.Chain:
    """Return a unit of paxisim's magnetic pad, zeroed with the gripper open and read in counts of 0.1 N.

    Args:
        name: ``"unit:N"``, as in `paxisim.reference_sensor`.
        layout: Taxel layout of the pads.

    Raises:
        InvalidValueError: The name does not denote a unit.
    """
    return paxisim.Chain([paxisim.reference_sensor(name)(layout, zeroed_at=OPEN), augment.Firmware()])


def surrogate(seed: int = 1, *, field: bool = True, out: Path | None = None, force: bool = False) -> None:
    """Draw a surrogate of a real sensor, for ``evaluate --sensor``.

    Args:
        seed: Random seed.
        field: Include the field of the other finger's magnets, zeroed with the gripper open.
        out: Output file. Default: sensor-SEED.json.
        force: Overwrite the output if it exists.

    Raises:
        OutputExistsError: The output exists, and `force` is off.
    """
    path = out or Path(f"sensor-{seed}.json")
    if path.exists() and not force:
        raise paxisim.OutputExistsError(f"{path} exists; --force overwrites it")
    chain = draw(seed, field=field)
    chain.save(path)
    print(f"{path}: {', '.join(chain.names)}")


if __name__ == "__main__":
    sys.exit(command(surrogate))
