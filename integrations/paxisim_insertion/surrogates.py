"""Surrogates: sensors as chains of effects known from real pads, outside what GCS draws. No real sensor is involved.

GCS draws gains of an axis from 0.5 to 1.5 for both pads, uncorrelated gains of taxels, a 3x3 kernel with amplitudes of
0.1 to 0.3, and no memory. A surrogate has gains of pads and axes below and above that range, a gradient across each
pad, a wider and stronger kernel, and adds stiffening, creep, hysteresis, a magnetic field, a dead band and counts.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import paxisim
from paxisim import augment

PADS, ROWS, COLS = 2, 6, 5
OPEN = 0.08
"""Gripper opening (m) at which the sensor is zeroed: the Panda gripper's maximum."""

LOW, HIGH = (0.3, 0.45), (1.6, 2.2)
"""Gains of a pad's axis: below or above the range of GCS, with equal probability."""

CONVOLUTION = (0.35, 0.6)
"""Amplitudes c_x and c_y of the kernel; GCS draws at most 0.3."""

LEAN = (0.3, 0.6)
"""Gradient of the gains across a pad: the gain at its edge differs by this share from that in the middle."""

FIELD = "interference"
FLAT = 1e-3
"""Mean height (m) of the taxels of a pad."""

COUNT = 0.1
"""Newtons per count of PaXini's pads."""


def draw_surrogate(seed: int, *, field: bool = True) -> paxisim.Chain:
    """Draw a surrogate; the same seed gives the same surrogate.

    Args:
        seed: Random seed.
        field: Include the field of the other finger's magnets, for a sensor that was zeroed with the gripper open: with
            the gripper closed on the peg each taxel is off by up to 0.3 N. Without the field the sensor behaves as if
            it had been zeroed at that opening.

    Returns:
        A chain for tensors ``(2, 3, 6, 5)`` in newtons. With the field it needs the covariate ``gripper_opening`` (m).
    """
    rng = np.random.default_rng([seed, 2])
    direction = rng.uniform(0, 2 * np.pi, (PADS, 1, 1))
    row, col = np.meshgrid(np.linspace(-1, 1, ROWS), np.linspace(-1, 1, COLS), indexing="ij")
    lean = rng.uniform(*LEAN, (PADS, 1, 1)) * (np.cos(direction) * row + np.sin(direction) * col)
    gains = np.where(rng.random((PADS, 3)) < 0.5, rng.uniform(*LOW, (PADS, 3)), rng.uniform(*HIGH, (PADS, 3)))
    per_metre = rng.uniform(-6, 6, (PADS, 3))
    chain = paxisim.Chain(
        [
            augment.Stiffening(rng.uniform(0.8, 1.2), 1.0),
            augment.Creep(rng.uniform(0.03, 0.15, 2), (rng.uniform(0.2, 1), rng.uniform(2, 10))),
            augment.Hysteresis(rng.uniform(0.03, 0.1, 3), (0.05, 0.2, 0.8)),
            augment.Poisson(*rng.uniform(*CONVOLUTION, 2), reach=2.9, falloff=rng.uniform(0.5, 2)),
            augment.PadAxisGain(gains),
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


def uneven_surface(seed: int, layout: paxisim.TaxelLayout) -> NDArray[np.floating]:
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
