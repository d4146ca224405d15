"""A board with a minimal protocol: a frame is ``F`` and one byte, the count of every taxel."""

from __future__ import annotations

import numpy as np

from paxisim.errors import DeviceTimeoutError
from paxisim.hw.families.board import Board, Reading
from paxisim.hw.profiles.profile import Profile, Slot
from paxisim.layout import TaxelLayout

ONE_PAD = Profile("scripted", "control-box", TaxelLayout(2, 2, (1e-3, 1e-3)), (Slot("pad", 0),), verified="here")
TWO_PADS = Profile(
    "scripted-two", "control-box", TaxelLayout(2, 3, (1e-3, 1e-3)), (Slot("left", 0), Slot("right", 1)), verified="here"
)


def message(count: int) -> bytes:
    """The bytes of one frame."""
    return b"F" + bytes([count])


class ScriptedBoard(Board):
    """Reads frames that a test writes to the other end, and reports each command there as one letter."""

    status = 0

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self._got = b""
        self._skipped = 0

    def start(self) -> None:
        self.transport.write(b"S")

    def stop(self) -> None:
        self.transport.write(b"X")

    def read(self, timeout: float) -> Reading:
        deadline = self.clock.monotonic() + timeout
        while True:
            at = self._got.find(b"F")
            if at >= 0 and len(self._got) > at + 1:
                self._skipped += at
                count = self._got[at + 1]
                self._got = self._got[at + 2 :]
                pads, taxels = len(self.profile.slots), self.profile.wire_layout.taxels
                counts = np.full((pads, taxels, 3), count, dtype=np.int16)
                return Reading(
                    counts, counts.sum(axis=1, dtype=np.int16), (self.status,) * pads, self.clock.monotonic()
                )
            left = deadline - self.clock.monotonic()
            if left <= 0:
                raise DeviceTimeoutError("the scripted board sent nothing")
            self._got += self.transport.read(left)

    def zero(self) -> None:
        self.transport.write(b"Z")

    def version(self) -> str:
        self.transport.write(b"V")
        return "scripted 1.0"

    @property
    def bad_checksums(self) -> int:
        return 2

    @property
    def skipped(self) -> int:
        return self._skipped
