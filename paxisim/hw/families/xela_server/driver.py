"""Driver for XELA's server, a vendor program that reads the sensor bus and streams the taxels over a WebSocket."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import ProtocolError
from paxisim.hw.families.board import Reading
from paxisim.hw.families.listened import ListenedBoard
from paxisim.hw.families.xela_server.wire import COUNTS_MIDDLE, Routine, RoutineDecoder, SensorReading, says_no_reading
from paxisim.hw.link.clock import Clock
from paxisim.hw.link.frame_joiner import STALE_STATUS
from paxisim.hw.link.transport import Transport
from paxisim.hw.profiles.profile import Profile

MISSING_STATUS = 1
"""Status of a pad whose reading is missing from a message, or is that of another model than at the start."""


class XelaServer(ListenedBoard[Routine]):
    """Base class for the sensors behind one server. A slot's index is the sensor's number on the server.

    Optional setting: ``model``, the model that the server must report, e.g. ``"uSPa44"``.
    """

    kind = "XELA server"

    def __init__(self, transport: Transport, profile: Profile, clock: Clock) -> None:
        """Store the arguments; no I/O."""
        super().__init__(
            transport,
            profile,
            clock,
            RoutineDecoder(),
            whole="message with readings",
            silent="a server that sends a welcome and nothing else has no sensor: are they connected and set up in its "
            "settings?",
            foreign="expects readings of a XELA server, but received something else",
        )
        self._models: dict[int, str] = {}
        self._last: int | None = None
        self._lost = 0

    @property
    def lost(self) -> int:
        """See `Board.lost`."""
        return self._lost

    def start(self) -> None:
        """See `Board.start`."""
        super().start()
        self._last = None
        sensors = self._waiting[0][-1].sensors
        self._models = {number: reading.model for number, reading in sensors.items()}
        for slot in self.profile.slots:
            if slot.index not in sensors:
                raise ProtocolError(
                    f"the server has no sensor {slot.index}, which profile {self.profile.name!r} assigns to pad "
                    f"{slot.name!r}; it has {', '.join(map(str, sorted(sensors))) or 'none'}"
                )
            self._check(slot.index, sensors[slot.index])

    def _check(self, number: int, found: SensorReading) -> None:
        taxels, model = self.profile.wire_layout.taxels, self.profile.settings.get("model", found.model)
        if (found.taxels, found.model) != (taxels, model):
            raise ProtocolError(
                f"sensor {number} of the server is a {found.model or 'sensor without a name'} with {found.taxels} "
                f"taxels, but profile {self.profile.name!r} is for {model} with {taxels}"
            )
        if self._values(found) is None:
            raise ProtocolError(
                f"the server sends no calibrated values for sensor {number} ({found.model}): enable them in its "
                "settings if it supports them for this model, or choose the profile of its raw counts"
            )

    def _is_silence(self, heard: bytes) -> bool:
        return all(says_no_reading(line) for line in heard.splitlines())

    @abstractmethod
    def _values(self, reading: SensorReading) -> NDArray[np.float32] | None:
        """Return the ``(N, 3)`` values that fill the tensor; None if the reading lacks them."""

    def _reading(self, time: float, behind: int, message: Routine) -> Reading:
        taxels = self.profile.wire_layout.taxels
        values = np.zeros((len(self.profile.slots), taxels, 3), dtype=np.float32)
        is_stale = message.number == self._last
        if self._last is not None:
            self._lost += max(message.number - self._last - 1, 0)  # a lower number is that of a restarted server
        self._last = message.number
        status = []
        for pad, slot in enumerate(self.profile.slots):
            reading = message.sensors.get(slot.index)
            is_same = reading is not None and reading.model == self._models.get(slot.index)
            own = self._values(reading) if reading is not None and is_same else None
            missing = 0 if own is not None and len(own) == taxels else MISSING_STATUS
            status.append(missing or (STALE_STATUS if is_stale else 0))
            if not missing:
                values[pad] = own
        return Reading(values, None, tuple(status), time, behind)


class XelaCounts(XelaServer):
    """Raw counts relative to the middle of their range, which is near their value at rest; zero them in software."""

    heard: ClassVar = {"messages of the family 'xela-counts', or of the family 'xela-forces'": RoutineDecoder}

    def _values(self, reading: SensorReading) -> NDArray[np.float32] | None:
        return reading.counts - COUNTS_MIDDLE


class XelaForces(XelaServer):
    """Calibrated forces, which the server has for some models. No source states their unit; newtons are assumed."""

    heard: ClassVar = XelaCounts.heard

    def _values(self, reading: SensorReading) -> NDArray[np.float32] | None:
        return reading.forces
