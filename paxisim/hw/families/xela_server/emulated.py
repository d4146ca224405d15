"""Emulated XELA server, which streams the readings of all its sensors. See `paxisim.hw.families.xela_server.wire`."""

from __future__ import annotations

import math
import time

import numpy as np
from numpy.typing import NDArray

from paxisim.hw.emulation.websocket_server import WebSocketServer
from paxisim.hw.families.streaming import StreamingBoard
from paxisim.hw.families.xela_server.wire import COUNTS_MIDDLE, WELCOME, Routine, SensorReading

DEFAULT_RATE = 100.0
"""Default message rate (Hz) if the profile states none."""
COUNTS_PER_NEWTON = 2000
"""Counts per newton of calibrated force. This is a placeholder; no source states the value."""
FIRST_PORT = 5000
"""Port on which the vendor's server listens."""
_LARGEST = 65_535


def listen() -> WebSocketServer:
    """Return a server that listens on `FIRST_PORT`, or on the next free port."""
    return WebSocketServer(WELCOME, FIRST_PORT)


class XelaCounts(StreamingBoard):
    """Sends raw counts: `COUNTS_MIDDLE` plus the signal."""

    stream_rate = DEFAULT_RATE
    _number = 0

    @property
    def bytes_per_second(self) -> float:
        """Unlimited: there is no serial line."""
        return math.inf

    def _message(self, now: float) -> bytes:
        self._number += 1
        model = self.pads.profile.settings.get("model", "emulated")
        values = self.pads.counts(now).astype(np.float64)
        slots = self.pads.profile.slots
        sensors = {slot.index: self._sensor(model, own) for slot, own in zip(slots, values, strict=True)}
        return Routine(self._number, sensors).encode(time.time())

    def _sensor(self, model: str, values: NDArray[np.float64]) -> SensorReading:
        return SensorReading(model, _raw(values))


class XelaForces(XelaCounts):
    """Sends forces in addition to counts, like a server with calibration enabled."""

    def _sensor(self, model: str, values: NDArray[np.float64]) -> SensorReading:
        return SensorReading(model, _raw(COUNTS_PER_NEWTON * values), values.astype(np.float32))


def _raw(change: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.clip(np.rint(COUNTS_MIDDLE + change), 0, _LARGEST).astype(np.float32)
