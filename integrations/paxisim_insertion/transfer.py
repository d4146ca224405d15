"""Transfer: a stand-in for the paper's real robot, with sensors and robots that no training has seen.

A surrogate of a sensor is a chain of effects known from real pads; no real sensor is involved. GCS draws uncorrelated
gains, a 3x3 kernel and no memory. A surrogate's gains differ between pads and have a gradient across each pad, its
shear comes from a wider kernel, and it adds stiffening, creep, hysteresis, a magnetic field, a dead band and
quantisation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import paxisim
from paxisim import augment

SURROGATES, UNITS = range(1, 11), range(1, 6)
"""Seeds of the surrogates, each zeroed once in the grasp and once before it; unit numbers of the magnetic pad."""

POSE_OFFSET = np.repeat([1.5e-3, 4e-3], 3)
"""Largest error of p_t that is constant over an episode, along each axis (m) and about each (rad)."""

POSE_NOISE = np.repeat([0.3e-3, 1e-3], 3)
"""Standard deviation of the additional error of p_t at each step (m, rad)."""

STIFFNESS, FRICTION = (0.7, 1.3), (1.0, 4.0)
"""Smallest and largest factors of the controller's stiffness and of the joints' dry friction."""

PADS, ROWS, COLS = 2, 6, 5
OPEN = 0.08
"""Gripper opening (m) at which the sensor is zeroed: the Panda gripper's maximum."""

FIELD = "interference"
FLAT = 1e-3
"""Taxel height (m) of a flat pad."""

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


def magnetic_unit(name: str, layout: paxisim.TaxelLayout) -> paxisim.Chain:
    """Return a unit of paxisim's magnetic pad, zeroed with the gripper open and read in counts of 0.1 N.

    Args:
        name: ``"unit:N"``, as in `paxisim.reference_sensor`.
        layout: Taxel layout of the pads.

    Raises:
        InvalidValueError: The name does not denote a unit.
    """
    return paxisim.Chain([paxisim.reference_sensor(name)(layout, zeroed_at=OPEN), augment.Firmware()])


@dataclass(frozen=True, eq=False)
class StandIn:
    """A stand-in for a real sensor.

    Attributes:
        kind: Type of the sensor, or how it was zeroed.
        chain: Chain applied to the simulator's readings.
        surface: ``(pads, rows, cols)`` heights of the taxels (m).
    """

    kind: str
    chain: paxisim.Chain
    surface: NDArray[np.floating]


def own_surface(chain: paxisim.Chain) -> NDArray[np.floating]:
    """Return the uneven surfaces ``(pads, rows, cols)`` (m) of the magnetic unit in a chain.

    Raises:
        InvalidValueError: The chain has no such unit.
    """
    units = [member for member in chain.members if isinstance(member, paxisim.MagneticSensor)]
    if not units:
        raise paxisim.InvalidValueError("only a unit of the magnetic pad, reference:unit:N, has a surface of its own")
    return units[0].heights(PADS)


def sensors(layout: paxisim.TaxelLayout, *, uneven: bool = False) -> list[StandIn]:
    """Return 25 sensors for pads of a layout, with alternating kinds.

    Args:
        layout: Taxel layout of the pads.
        uneven: Whether the magnetic pads have the surfaces of their units; otherwise theirs are drawn as those of the
            surrogates, as for all published figures.
    """
    turns = []
    for number in UNITS:
        for seed in SURROGATES[2 * number - 2 : 2 * number]:
            surface = uneven_surface(seed, layout)
            turns.append(StandIn("zeroed in the grasp", draw_surrogate(seed, field=False), surface))
            turns.append(StandIn("zeroed while open", draw_surrogate(seed), surface))
        surface = uneven_surface(SURROGATES[-1] + number, layout)
        unit = magnetic_unit(f"unit:{number}", layout)
        turns.append(StandIn("magnetic pad", unit, own_surface(unit) if uneven else surface))
    return turns


@dataclass(frozen=True, eq=False)
class Gap:
    """How the robot of one episode of an evaluation differs from the simulated one, as no training has seen it.

    The paper blames the failures of a policy without touch on "pose tracking noise and OSC dynamics gap due to friction
    in physical motors" and gives no figures. The ranges are ours: a camera that locates the base's markers to about
    1.5 mm and a quarter of a degree, and an arm with up to four times the joint friction of robosuite's (0.1 N m each).

    Attributes:
        offset: ``(6,)`` error of p_t that is constant over the episode (m, rad).
        stiffness: Factor of the controller's stiffness; its damping ratio is unchanged.
        friction: Factor of the joints' dry friction.
    """

    offset: NDArray[np.floating]
    stiffness: float
    friction: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Gap:
        """Draw the gap of one episode."""
        offset = rng.uniform(-POSE_OFFSET, POSE_OFFSET)
        return cls(offset, float(rng.uniform(*STIFFNESS)), float(rng.uniform(*FRICTION)))

    def believed(self, pose: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
        """Return the pose ``(6,)`` (m, rad) that the robot measures for a true pose."""
        return (pose + self.offset + POSE_NOISE * rng.standard_normal(6)).astype(np.float32)
