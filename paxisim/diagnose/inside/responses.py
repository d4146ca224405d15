"""Responses: what the simulated stream does when a number of the scene changes, from replays at a few of its values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, radians

import numpy as np
from numpy.typing import NDArray

from paxisim.scene.parameters import SceneParameter

FloatArray = NDArray[np.float64]

SHOWN: Mapping[str, tuple[str, float]] = {"m": ("mm", 1e3), "rad": ("deg", degrees(1)), "1": ("1", 1.0)}
"""By SI unit the one in which numbers of a scene are fitted and reported, and how many of it one SI unit is."""


def in_si(unit: str, values: tuple[float, float]) -> tuple[float, float]:
    """Values in one of the units in which numbers of a scene are shown, in its SI unit."""
    times = next(times for shown, times in SHOWN.values() if shown == unit)
    return values[0] / times, values[1] / times


SPREAD: Mapping[str, float] = {"m": 0.2e-3, "rad": radians(0.5)}
"""Standard deviation of a pose from one episode to another: that of a grasp on a stage or a gripper (ours)."""


@dataclass(frozen=True, eq=False)
class Response:
    """What one number of a scene does.

    Attributes:
        parameter: The number.
        middle: The value that it is changed from: the nominal one, or that of the centre of its cause.
        values: ``(values,)`` its values for which there are replays, ascending, without the middle.
        changes: ``(values, T, pads, 3, rows, cols)`` N, what is simulated then, less what is simulated in the middle.
    """

    parameter: SceneParameter
    middle: float
    values: FloatArray
    changes: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Centre:
    """What all numbers of a cause do together at the values that were fitted.

    Attributes:
        values: The values, in SI units, in the order of the numbers.
        change: ``(T, pads, 3, rows, cols)`` N, what is simulated then, less what is simulated as it is.
    """

    values: FloatArray
    change: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Responses:
    """What the numbers of a scene do, on straight lines between the replays.

    Lines are chosen because a contact comes and goes at once: a curve through three replays would swing. From the
    nominal values to the centre of a cause its effect grows in proportion; what its numbers do besides is what they do
    at the centre.

    Attributes:
        each: The numbers.
        centres: By cause, where numbers were fitted before.
        rows: ``(T,)`` the frames of the replays that are meant.
        failed: Causes with numbers that could not be replayed.
    """

    each: tuple[Response, ...]
    rows: NDArray[np.intp]
    centres: Mapping[str, Centre] = field(default_factory=dict)
    failed: frozenset[str] = frozenset()
    _taken: dict[str, NDArray[np.float32]] = field(default_factory=dict, repr=False)

    def select(self, which: NDArray[np.intp]) -> Responses:
        """Those of some frames."""
        return replace(self, rows=self.rows[which], _taken={})

    def of(self, group: str) -> list[Response]:
        """The numbers of a cause."""
        return [one for one in self.each if one.parameter.group == group]

    @property
    def poses(self) -> list[Response]:
        """The numbers of the objects' poses."""
        return self.of("object_pose")

    def change(self, group: str, values: Sequence[float]) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` N, what a cause adds to the simulated stream.

        Args:
            group: The cause.
            values: Of its numbers, in the units of `SHOWN`.
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

    def _stack(self, group: str) -> NDArray[np.float32]:
        """``(1 + values, numbers of the stream)`` the centre of a cause, and its replays."""
        if group not in self._taken:
            changes = [one.changes[:, self.rows] for one in self.of(group)]
            centre = self.centres[group].change[self.rows] if group in self.centres else np.zeros_like(changes[0][0])
            whole = np.concatenate([centre[None], *changes])
            self._taken[group] = whole.reshape(len(whole), -1)
        return self._taken[group]

    def slope(self, one: Response) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` N, what a number adds for each of its unit near the middle."""
        below, above = np.flatnonzero(one.values < one.middle), np.flatnonzero(one.values > one.middle)
        sides = [*below[-1:], *above[:1]]
        slopes = [one.changes[k, self.rows] / (one.values[k] - one.middle) for k in sides]
        return np.mean(slopes, axis=0, dtype=np.float64)


def _shares(one: Response, value: float) -> FloatArray:
    """``(values,)`` of the two replays that a value lies between, or is beyond; the middle adds nothing."""
    known = np.sort(np.append(one.values, one.middle))
    right = int(np.clip(np.searchsorted(known, value), 1, len(known) - 1))
    share = (value - known[right - 1]) / (known[right] - known[right - 1])
    return np.where(one.values == known[right - 1], 1 - share, np.where(one.values == known[right], share, 0.0))
