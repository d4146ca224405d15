"""Emulated GEN3 serial converter with one sensor. See `paxisim.hw.families.serial_converter.wire`."""

from __future__ import annotations

from collections.abc import Callable

from paxisim.hw.emulation.pads import GEN3_GATE, EmulatedPads
from paxisim.hw.families import registers
from paxisim.hw.families.control_box.emulated import RESULTANT_BLOCK, region, version_of
from paxisim.hw.families.emulated_board import EmulatedBoard
from paxisim.hw.families.serial_converter import wire as wire
from paxisim.hw.link.framing import FrameDecoder

_PARAMETER, _OTHERS = 6, 0x0D


class SerialConverter(EmulatedBoard):
    """Answers requests addressed to its sensor's id; ignores all others, and requests with a wrong check byte.

    As on real parts, the status of a good read is 00 or 01 (here alternating), and the reply to a write has no data
    although it repeats their count. No source states the answer for a nonexistent address; this class returns status 6
    and no data.
    """

    gate = GEN3_GATE

    def __init__(self, pads: EmulatedPads, *, wrong_status: Callable[[], bool] = lambda: False) -> None:
        """Power on."""
        super().__init__(pads, wrong_status=wrong_status)
        self._decoder = FrameDecoder(wire.parse_request, stream=False)
        self._id = pads.profile.slots[0].index
        self._status = 0

    def answers(self, data: bytes, now: float) -> list[bytes]:
        """See `EmulatedBoard.answers`."""
        return [self._answer(r, now).encode() for r in self._decoder.feed(data) if r.id == self._id]

    def _answer(self, request: wire.Request, now: float) -> wire.Reply:
        if self._wrong_status():
            return wire.answer(request, status=_OTHERS)
        if request.function == wire.WRITE:
            return self._write(request, now)
        settings = self.pads.profile.settings
        memory = {
            settings.get("resultant_address", registers.CONVERTER_RESULTANT): self.pads.total(0, now).ljust(
                RESULTANT_BLOCK, b"\0"
            ),
            settings.get("address", registers.CONVERTER_TAXELS): self.pads.taxels(0, now),
            registers.CONVERTER_VERSION: version_of(self.pads.profile).ljust(registers.CONVERTER_VERSION_BYTES, b"\0"),
        }
        data = region(memory, request.address, request.count)
        if data is None:
            return wire.answer(request, status=_PARAMETER)
        self._status ^= 1
        return wire.answer(request, data, self._status)

    def _write(self, request: wire.Request, now: float) -> wire.Reply:
        if request.address != registers.CONVERTER_ZERO or request.data != b"\1":
            return wire.answer(request, status=_PARAMETER)
        self.pads.zero(now)
        return wire.answer(request)
