"""EmulatedPads: what the firmware makes of the forces on the pads, before any protocol."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, PaxisimError
from paxisim.hw import taxels
from paxisim.hw.families import BYTES
from paxisim.hw.profile import Profile

# seconds since the emulator started -> (pads, 3, rows, cols) newtons of the profile's wire layout
Signal = Callable[[float], NDArray[np.floating]]

# (pads, N, 3) counts of the taxels -> (pads, 3) counts that the board reports as the total
Resultant = Callable[[NDArray[np.int16]], NDArray[np.integer]]

GEN3_GATE = 2
"""Components of real GEN3 taxels are 0 or at least so many counts."""

_LOWEST, _HIGHEST = BYTES


class EmulatedPads:
    """The pads on a board, measured at their own rate and turned into whole counts.

    Between two measurements the last one is held. The counts are rounded, gated and clipped as
    `Profile.to_counts` says.
    """

    def __init__(
        self,
        profile: Profile,
        signal: Signal,
        *,
        rate: float | None = None,
        gate: int = 0,
        resultant: Resultant | None = None,
    ) -> None:
        """Ask the signal once, to see that it fits.

        Args:
            profile: Which pads.
            signal: The forces on them.
            rate: Measurements a second (Hz); None: one whenever it is asked for.
            gate: Components below so many counts read 0.
            resultant: What the board reports as each pad's total. Default: the sum over the taxels, clipped to what
                three bytes hold. No source says how a real board arrives at its total; it is not the sum.

        Raises:
            InvalidValueError: The signal gives another shape than the profile's pads have, or `rate` or `gate` cannot
                be.
        """
        if rate is not None and not rate > 0:
            raise InvalidValueError(f"rate must be a positive number of Hz, got {rate!r}")
        if not 0 <= gate <= 127:
            raise InvalidValueError(f"gate must be from 0 to 127 counts, got {gate!r}")
        self.profile = profile
        self._signal, self._rate, self._gate = signal, rate, gate
        self._resultant = clipped_sum if resultant is None else resultant
        self._zero = np.zeros((len(profile.slots), *profile.wire_layout.shape))
        self._measured_at: float | None = None
        self._measure(0.0)

    def counts(self, now: float) -> NDArray[np.int16]:
        """``(pads, N, 3)`` counts in the order of the wire at that time (s since the start)."""
        self._measure(now)
        return self._counts

    def taxels(self, pad: int, now: float) -> bytes:
        """The ``3 N`` bytes of one pad's taxels."""
        return taxels.to_bytes(self.counts(now)[pad])

    def totals(self, now: float) -> NDArray[np.int16]:
        """``(pads, 3)`` counts that the board reports as the pads' totals."""
        return np.clip(self._resultant(self.counts(now)), _LOWEST, _HIGHEST).astype(np.int16)

    def total(self, pad: int, now: float) -> bytes:
        """The three bytes of one pad's total."""
        return taxels.to_bytes(self.totals(now)[pad])

    def zero(self, now: float, pad: int | None = None) -> None:
        """Take what one pad, or all of them, feel now as zero."""
        which = slice(None) if pad is None else slice(pad, pad + 1)
        self._zero[which] = self._force(now)[which]
        self._measured_at = None

    def _measure(self, now: float) -> None:
        at = now if self._rate is None else np.floor(now * self._rate) / self._rate
        if at != self._measured_at:
            self._counts = self.profile.to_counts(self._force(at) - self._zero, self._gate)
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
            raise InvalidValueError(f"the signal must give finite forces, got some that are not at {now:.3f} s")
        return force


def clipped_sum(counts: NDArray[np.int16]) -> NDArray[np.integer]:
    """``(pads, N, 3)`` counts -> ``(pads, 3)``: their sum, clipped to what three bytes hold."""
    return np.clip(counts.sum(axis=1, dtype=np.int64), _LOWEST, _HIGHEST)
