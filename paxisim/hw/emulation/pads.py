"""EmulatedPads: conversion of the forces on the pads to counts by the firmware, independent of any protocol."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, PaxisimError
from paxisim.hw.families import taxels
from paxisim.hw.families.table import BYTES
from paxisim.hw.profiles.profile import Profile

# seconds since the emulator started -> (pads, 3, rows, cols) newtons in the profile's wire layout
Signal = Callable[[float], NDArray[np.floating]]

# (pads, N, 3) counts of the taxels -> (pads, 3) counts that the board reports as the total
Resultant = Callable[[NDArray[np.int16]], NDArray[np.integer]]

GEN3_GATE = 2
"""Smallest nonzero value of a component on real GEN3 taxels, in counts."""

_LOWEST, _HIGHEST = BYTES


class EmulatedPads:
    """The pads on a board, measured at their own rate and converted to counts.

    The last measurement is held until the next one. `Profile.to_counts` rounds, gates and clips the counts.
    """

    def __init__(
        self,
        profile: Profile,
        signal: Signal,
        *,
        rate: float | None = None,
        gate: int = 0,
        shear_floor: int = 0,
        resultant: Resultant | None = None,
    ) -> None:
        """Evaluate the signal once to check it.

        Args:
            profile: Profile of the pads.
            signal: The forces on the pads.
            rate: Measurement rate (Hz); None: one measurement for every distinct time requested.
            gate: Threshold in counts below which components read 0.
            shear_floor: Smallest magnitude of x and y on a taxel that is on, in counts; 0 for none. See `Firmware`.
            resultant: Function that computes the total reported for each pad. Default: the sum over the taxels, clipped
                to the range of the three bytes. No source states how a real board computes its total; it is not the
                sum.

        Raises:
            InvalidValueError: The signal fails, is not finite or does not have the shape of the profile's pads, or
                `rate`, `gate` or `shear_floor` is out of range.
        """
        if rate is not None and not rate > 0:
            raise InvalidValueError(f"rate must be a positive number of Hz, got {rate!r}")
        for name, counts in (("gate", gate), ("shear_floor", shear_floor)):
            if not 0 <= counts <= 127:
                raise InvalidValueError(f"{name} must be from 0 to 127 counts, got {counts!r}")
        self.profile = profile
        self._signal, self._rate, self._gate, self._shear_floor = signal, rate, gate, shear_floor
        self._resultant = clipped_sum if resultant is None else resultant
        self._zero = np.zeros((len(profile.slots), *profile.wire_layout.shape))
        self._measured_at: float | None = None
        self._measure(0.0)

    def counts(self, now: float) -> NDArray[np.int16]:
        """Return the ``(pads, N, 3)`` counts in wire order at time `now` (s since the start)."""
        self._measure(now)
        return self._counts

    def taxels(self, pad: int, now: float) -> bytes:
        """Return the ``3 N`` bytes of one pad's taxels."""
        return taxels.to_bytes(self.counts(now)[pad])

    def totals(self, now: float) -> NDArray[np.int16]:
        """Return the ``(pads, 3)`` counts that the board reports as the pads' totals."""
        return np.clip(self._resultant(self.counts(now)), _LOWEST, _HIGHEST).astype(np.int16)

    def total(self, pad: int, now: float) -> bytes:
        """Return the three bytes of one pad's total."""
        return taxels.to_bytes(self.totals(now)[pad])

    def zero(self, now: float, pad: int | None = None) -> None:
        """Take the present forces on one pad, or on all of them, as zero."""
        which = slice(None) if pad is None else slice(pad, pad + 1)
        self._zero[which] = self._force(now)[which]
        self._measured_at = None

    def _measure(self, now: float) -> None:
        at = now if self._rate is None else np.floor(now * self._rate) / self._rate
        if at != self._measured_at:
            self._counts = self.profile.to_counts(self._force(at) - self._zero, self._gate, self._shear_floor)
            self._measured_at = at

    def _force(self, now: float) -> NDArray[np.floating]:
        try:
            force = np.asarray(self._signal(now), dtype=np.float64)
        except PaxisimError:
            raise
        except Exception as error:
            what = f"{type(error).__name__}: {error}"
            raise InvalidValueError(f"the signal failed at {now:.3f} s with {what}") from error
        if force.shape != self._zero.shape:
            raise InvalidValueError(
                f"the signal must give a tensor of shape {self._zero.shape} for profile {self.profile.name!r}, "
                f"got {force.shape}"
            )
        if not np.all(np.isfinite(force)):
            raise InvalidValueError(f"the signal must give finite forces, got some non-finite ones at {now:.3f} s")
        return force


def clipped_sum(counts: NDArray[np.int16]) -> NDArray[np.integer]:
    """Return the sum of ``(pads, N, 3)`` counts over the taxels, ``(pads, 3)``, clipped to the range of three bytes."""
    return np.clip(counts.sum(axis=1, dtype=np.int64), _LOWEST, _HIGHEST)
