"""Unit: one manufactured pad, as the matrices from which its readings are computed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.reference.dipoles import field, jacobian
from paxisim.reference.influence import influence
from paxisim.reference.parameters import PadParameters
from paxisim.reference.spread import Spread

FloatArray = NDArray[np.float64]

EXACT_RINGS = 1
"""Rings of taxels around a sensor whose magnets' fields are exact; other fields are linear in the motion."""
FAR_AWAY = 1e3
"""Distance (m) at which to put the missing neighbours of sensors at the edge: too far to contribute."""


class Unit(NamedTuple):
    """A pad of N taxels and magnets. Components come before taxels; lengths and fields are in the pad's frame.

    Attributes:
        motion: ``(3 N, 6 N)`` displacement (m/N) and rotation (rad/N) of the magnets by the forces.
        magnets: ``(3, N)`` positions of the magnets at rest (m).
        moments: ``(3, N)`` moments of the magnets (A m^2).
        sensors: ``(3, N)`` positions of the Hall sensors (m).
        near: ``(K, N)`` indices of the magnets whose field at each sensor is exact.
        offsets: ``(3, K, N)`` vectors from these magnets to the sensor (m).
        far: ``(6 N, 3 N)`` change of the field at the sensors by motion of the other magnets (T/m, T/rad).
        magnets_alone: ``(3, N)`` field of all magnets at rest (T).
        earth: ``(3, 1)`` earth's field (T).
        view: ``(3, 3, N)`` matrices from the field at a Hall sensor to the readings of its own axes.
    """

    motion: FloatArray
    magnets: FloatArray
    moments: FloatArray
    sensors: FloatArray
    near: NDArray[np.intp]
    offsets: FloatArray
    far: FloatArray
    magnets_alone: FloatArray
    earth: FloatArray
    view: FloatArray


def make_unit(layout: TaxelLayout, nominal: PadParameters, seed: int | None) -> tuple[Unit, PadParameters]:
    """Make the unit with a number, or the nominal design for None, and return it with its own parameters.

    Raises:
        InvalidValueError: The layout is not a flat grid, or the seed is not a whole number of 0 or more.
    """
    if seed is not None and (not isinstance(seed, (int, np.integer)) or seed < 0):
        raise InvalidValueError(f"the number of a unit must be a whole number of 0 or more, got {seed!r}")
    if not layout.is_grid:
        raise InvalidValueError("a magnetic pad needs a flat grid of taxels: curved gels are not supported")
    spread = None if seed is None else Spread(np.random.default_rng(seed))
    own = nominal if spread is None else spread.of(nominal)
    count, taxels = layout.taxels, layout.positions[:, :2].astype(np.float64)
    places = np.column_stack([taxels, np.full(count, own.magnet_depth)])
    sensors = places + [0, 0, own.distance]
    magnets, moments = places, np.tile([0.0, 0.0, own.moment], (count, 1))
    view, earth = np.tile(np.eye(3), (count, 1, 1)), np.zeros(3)
    if spread is not None:
        magnets, moments = spread.magnets(places, moments, own)
        view, earth = spread.sensors(count, own), spread.earth(own)
    motion = influence(layout, own, None if spread is None else magnets - places)

    near, is_near = _neighbours(layout.rows, layout.cols, EXACT_RINGS)
    offsets = sensors[:, None] - magnets  # (sensors, magnets, 3)
    all_moments = np.broadcast_to(moments, offsets.shape)
    far = jacobian(all_moments, offsets)  # (sensors, magnets, 3, 6)
    sensor = np.broadcast_to(np.arange(count), near.shape)
    far[sensor[is_near], near[is_near]] = 0
    near_offsets = np.where(is_near[..., None], offsets[sensor, near], FAR_AWAY)  # (K, sensors, 3)
    made = Unit(
        motion=motion.reshape(3 * count, 6 * count),
        magnets=magnets.T,
        moments=moments.T,
        sensors=sensors.T,
        near=near,
        offsets=near_offsets.transpose(2, 0, 1),
        far=far.transpose(3, 1, 2, 0).reshape(6 * count, 3 * count),
        magnets_alone=field(all_moments, offsets).sum(axis=1).T,
        earth=earth[:, None],
        view=view.transpose(1, 2, 0),
    )
    return made, own


def _neighbours(rows: int, cols: int, rings: int) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return the taxels in the rings around each one, ``(K, N)``, including itself, and which of them exist."""
    steps = np.arange(-rings, rings + 1)
    row, col = np.divmod(np.arange(rows * cols), cols)
    row, col = row + np.repeat(steps, len(steps))[:, None], col + np.tile(steps, len(steps))[:, None]
    exists = (row >= 0) & (row < rows) & (col >= 0) & (col < cols)
    return np.where(exists, row * cols + col, 0), exists
