"""The magnetometer board's side of the line: it streams once a host listens. See `frames.magnetometer_board`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from paxisim.hw.emulation.pads import EmulatedPads
from paxisim.hw.emulation.streaming import StreamingBoard
from paxisim.hw.frames.magnetometer_board import Burst

RATE = 100.0
"""Bursts a second (Hz) where the profile says nothing; the sketch sends as fast as it can read its chips."""
STEP = 0.01
"""Microtesla that numbers are multiples of: the last decimal that the text sketch prints; chips' steps are coarser."""
TEMPERATURE = 25.0
"""What each chip reports (degC)."""


class MagnetometerBoard(StreamingBoard):
    """Sends a burst at its rate, and takes no requests. There is no error byte that could be wrong."""

    stream_rate = RATE

    def __init__(
        self, pads: EmulatedPads, *, rate: float | None = RATE, wrong_status: Callable[[], bool] = lambda: False
    ) -> None:
        """Power on.

        Args:
            pads: The one pad that it is.
            rate: Bursts a second (Hz); None: one whenever `tick` is called.
            wrong_status: Not asked.
        """
        super().__init__(pads, rate=rate, wrong_status=wrong_status)
        self._text = bool(pads.profile.settings.get("text", False))

    def _message(self, now: float) -> bytes:
        flux = np.rint(self.pads.counts(now)[0] / STEP) * STEP
        burst = Burst(np.insert(flux, 0, TEMPERATURE, axis=1).astype(np.float32))
        return burst.encode_text() if self._text else burst.encode()
