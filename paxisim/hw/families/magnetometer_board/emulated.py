"""Emulated magnetometer board, which streams once a host listens. See `paxisim.hw.families.magnetometer_board.wire`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from paxisim.hw.emulation.pads import EmulatedPads
from paxisim.hw.families.magnetometer_board.wire import Burst
from paxisim.hw.families.streaming import StreamingBoard

DEFAULT_RATE = 100.0
"""Default burst rate (Hz) if the profile states none; the sketch sends as fast as it can read its chips."""
FLUX_STEP = 0.01
"""Resolution of the flux (uT): the last decimal that the text sketch prints. The resolution of the chips is coarser."""
BOARD_TEMPERATURE = 25.0
"""Temperature that each chip reports (degC)."""


class MagnetometerBoard(StreamingBoard):
    """Sends bursts at a fixed rate and accepts no requests. Bursts have no error byte."""

    stream_rate = DEFAULT_RATE

    def __init__(
        self, pads: EmulatedPads, *, rate: float | None = DEFAULT_RATE, wrong_status: Callable[[], bool] = lambda: False
    ) -> None:
        """Power on.

        Args:
            pads: The board's one pad.
            rate: Burst rate (Hz); None: one burst whenever `tick` is called.
            wrong_status: Not used.
        """
        super().__init__(pads, rate=rate, wrong_status=wrong_status)
        self._text = bool(pads.profile.settings.get("text", False))

    def _message(self, now: float) -> bytes:
        flux = np.rint(self.pads.counts(now)[0] / FLUX_STEP) * FLUX_STEP
        burst = Burst(np.insert(flux, 0, BOARD_TEMPERATURE, axis=1).astype(np.float32))
        return burst.encode_text() if self._text else burst.encode()
