"""Responses: how the simulated stream changes with a number of the scene, from replays at a few of its values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, radians

import numpy as np
from numpy.typing import NDArray

from paxisim.scene.parameters import SceneParameter

FloatArray = NDArray[np.float64]

SHOWN: Mapping[str, tuple[str, float]] = {"m": ("mm", 1e3), "rad": ("deg", degrees(1)), "1": ("1", 1.0)}
"""By SI unit: the display unit, in which numbers of a scene are fitted and reported, and the factor from SI to it."""


def in_si(unit: str, values: tuple[float, float]) -> tuple[float, float]:
    """Convert values from a display unit of `SHOWN` to SI."""
    times = next(times for shown, times in SHOWN.values() if shown == unit)
    return values[0] / times, values[1] / times


SPREAD: Mapping[str, float] = {"m": 0.2e-3, "rad": radians(0.5)}
"""Standard deviation of an object's pose between episodes, for grasps on a stage or in a gripper (our choice)."""


@dataclass(frozen=True, eq=False)
class Response:
    """Effect of one number of a scene.

    Attributes:
        parameter: The number.
        middle: Value from which it is changed: the nominal value, or that at the centre of its cause.
        values: ``(values,)`` replayed values, ascending, without the middle.
        changes: ``(values, T, pads, 3, rows, cols)`` N, simulated stream at each value minus that at the middle.
    """

    parameter: SceneParameter
    middle: float
    values: FloatArray
    changes: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Centre:
    """Joint effect of all numbers of a cause at their fitted values.

    Attributes:
        values: Fitted values in SI units, in the order of the numbers.
        change: ``(T, pads, 3, rows, cols)`` N, simulated stream at these values minus that of the unchanged scene.
    """

    values: FloatArray
    change: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Responses:
    """Effects of the numbers of a scene, interpolated linearly between the replays.

    Interpolation is linear because contacts appear and vanish abruptly, so a curve through three replays would
    overshoot. From the nominal values to the centre of a cause, its effect grows in proportion. Deviations from that
    path have the effect they have at the centre.

    Attributes:
        each: Effect of each number.
        poses: Effect of each number of the objects' poses, as near to the true scene as is known.
        simulated: ``(poses, frames)`` poses of the objects in the replays, in SI units, as deviations from their mean.
        rows: ``(T,)`` selected frames of the replays.
        centres: Centres by cause, for causes with numbers that were fitted before.
        failed: Causes with numbers that could not be replayed.
    """

    each: tuple[Response, ...]
    poses: tuple[Response, ...]
    simulated: FloatArray
    rows: NDArray[np.intp]
    centres: Mapping[str, Centre] = field(default_factory=dict)
    failed: frozenset[str] = frozenset()
    _taken: dict[str, NDArray[np.float32]] = field(default_factory=dict, repr=False)

    def select(self, which: NDArray[np.intp]) -> Responses:
        """Return the responses in some frames."""
        return replace(self, rows=self.rows[which], _taken={})

    def of(self, group: str) -> list[Response]:
        """Return the responses of the numbers of a cause."""
        return [one for one in self.each if one.parameter.group == group]

    def change(self, group: str, values: Sequence[float] | FloatArray) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` N, change of the simulated stream by a cause.

        Args:
            group: Name of the cause.
            values: Values of its numbers, in the units of `SHOWN`.
        """
        numbers, centre = self.of(group), self.centres.get(group)
        si = np.array([v / SHOWN[one.parameter.unit][1] for one, v in zip(numbers, values, strict=True)])
        stack, way = self._stack(group), 0.0
        if centre is not None:
            nominal = np.array([one.parameter.nominal for one in numbers])
            steps = np.array([one.parameter.step for one in numbers])
            there = (centre.values - nominal) / steps
            way = float(np.clip((si - nominal) / steps @ there / max(there @ there, 1e-12), 0.0, 1.0))
            si = si + (1 - way) * (centre.values - nominal)
        shares = np.concatenate([[way], *(_shares(one, value) for one, value in zip(numbers, si, strict=True))])
        total = shares.astype(np.float32) @ stack
        return total.reshape(len(self.rows), *numbers[0].changes.shape[2:]).astype(np.float64)

    def mean_pose(self, values: Sequence[float] | FloatArray) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` N, change of the simulated stream by small poses, the same in all episodes.

        Args:
            values: Values of the numbers of the poses, in the units of `SHOWN`.
        """
        if "mean_pose" not in self._taken:
            slopes = [self.slope(one) / SHOWN[one.parameter.unit][1] for one in self.poses]
            self._taken["mean_pose"] = np.stack(slopes).astype(np.float32)
        return np.tensordot(np.asarray(values, dtype=np.float32), self._taken["mean_pose"], 1).astype(np.float64)

    def _stack(self, group: str) -> NDArray[np.float32]:
        """``(1 + values, size of the stream)`` changes at the centre of a cause and in its replays."""
        if group not in self._taken:
            changes = [one.changes[:, self.rows] for one in self.of(group)]
            centre = self.centres[group].change[self.rows] if group in self.centres else np.zeros_like(changes[0][0])
            whole = np.concatenate([centre[None], *changes])
            self._taken[group] = whole.reshape(len(whole), -1)
        return self._taken[group]

    def slope(self, one: Response) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` N per SI unit, derivative of the simulated stream near the middle."""
        below, above = np.flatnonzero(one.values < one.middle), np.flatnonzero(one.values > one.middle)
        sides = [*below[-1:], *above[:1]]
        slopes = [one.changes[k, self.rows] / (one.values[k] - one.middle) for k in sides]
        return np.mean(slopes, axis=0, dtype=np.float64)


def _shares(one: Response, value: float) -> FloatArray:
    """``(values,)`` weights of the replays in a linear interpolation at a value; beyond the replays it extrapolates.

    The change at the middle is 0 and needs no weight.
    """
    known = np.sort(np.append(one.values, one.middle))
    right = int(np.clip(np.searchsorted(known, value), 1, len(known) - 1))
    share = (value - known[right - 1]) / (known[right] - known[right - 1])
    return np.where(one.values == known[right - 1], 1 - share, np.where(one.values == known[right], share, 0.0))
