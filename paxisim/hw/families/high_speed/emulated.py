"""Emulated GEN3 high-speed board. See `wire` and `stream_layout`."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from paxisim.hw.emulation.pads import GEN3_GATE, EmulatedPads
from paxisim.hw.families import registers, taxels
from paxisim.hw.families.control_box.emulated import region
from paxisim.hw.families.high_speed import stream_layout
from paxisim.hw.families.high_speed import wire as wire
from paxisim.hw.families.streaming import StreamingBoard
from paxisim.hw.link.framing import FrameDecoder

DEFAULT_RATE = 83.0
"""Default push rate (Hz) if the profile states none: the lowest rate observed."""
FIRMWARE_VERSION = b"PAXISIM-EMU-1.0"
RESET = 0x0022
ERROR = 0x0023
RESULTANTS_ADDRESS = 0x0500
FIRST_TAXELS, TAXELS_STEP = 0x1000, 0x200
FIRST_PALM_TAXELS, PALM_TAXELS_STEP = 0x3800, 0x100
DONE = b"\0"
_STREAM_ERROR = 7


class HighSpeedBoard(StreamingBoard):
    """Has registers, and streams all active modules once the stream is switched on.

    The taxel counts of the palm modules are stored at both places that sources name, behind those of the fingers and
    from register 0066 on, because a host may read either. Register 0066 belongs to both: it holds the count of module
    20 if the profile's ``palm_counts`` setting is ``"0066"`` or there is no module 27, otherwise that of module 27.

    A read during the stream collides with it: the reply appears inside the next push, which is lost. Writes do not
    collide. The board does not answer requests with a wrong check byte.
    """

    stream_rate = DEFAULT_RATE
    gate = GEN3_GATE

    def __init__(
        self, pads: EmulatedPads, *, rate: float | None = DEFAULT_RATE, wrong_status: Callable[[], bool] = lambda: False
    ) -> None:
        """Power on: all modules active, resultants and taxels selected, stream off.

        Args:
            pads: The pads connected to the board; a slot's index is its module.
            rate: Push rate (Hz); None: one push whenever `tick` is called.
            wrong_status: See `EmulatedBoard`.
        """
        super().__init__(pads, rate=rate, wrong_status=wrong_status)
        self._decoder = FrameDecoder(wire.parse_request, stream=False)
        self._modules = {slot.index: pad for pad, slot in enumerate(pads.profile.slots)}
        self._palms_apart = pads.profile.settings.get("palm_counts") == "0066"
        self._reset()

    def _reset(self) -> None:
        self.due = math.inf
        self._active = tuple(sorted(self._modules))
        self._data_type = stream_layout.RESULTANTS | stream_layout.TAXELS
        self._collided = b""

    @property
    def _pushes(self) -> bool:
        return self.due < math.inf

    def answers(self, data: bytes, now: float) -> list[bytes]:
        """See `EmulatedBoard.answers`."""
        return [answer for r in self._decoder.feed(data) if (answer := self._answer(r, now))]

    def _message(self, now: float) -> bytes:
        push = wire.Push(_STREAM_ERROR) if self._wrong_status() else wire.Push(0, self._stream_data(now))
        message, collided = push.encode(), self._collided
        self._collided = b""
        middle = len(message) // 2
        return message[:middle] + collided + message[middle:]

    def _stream_data(self, now: float) -> bytes:
        counts = self.pads.counts(now)
        totals = self.pads.totals(now)
        which = [self._modules[module] for module in self._active]
        layout = stream_layout.StreamLayout(self._active, (counts.shape[1],) * len(which), self._data_type)
        return layout.encode(list(totals[which]), list(counts[which]))

    def _answer(self, request: wire.Request, now: float) -> bytes:
        if self._wrong_status():
            return self._refused(request)
        if request.function == wire.READ:
            answer = self._read(request, now)
            if not self._pushes:
                return answer
            self._collided += answer
            return b""
        if request.function == wire.ZERO:
            if (request.register, request.data) != (registers.HIGH_SPEED_ZERO, b"\1"):
                return self._refused(request)
            self.pads.zero(now)
            return wire.Reply(wire.ZERO, request.register, DONE).encode()
        return self._write(request, now)

    def _refused(self, request: wire.Request) -> bytes:
        return wire.Reply(wire.ERROR_BIT | request.function, request.register).encode()

    def _read(self, request: wire.Request, now: float) -> bytes:
        data = region(self._memory(now), request.register, request.count)
        return self._refused(request) if data is None else wire.Reply(wire.READ, request.register, data).encode()

    def _write(self, request: wire.Request, now: float) -> bytes:
        register, data = request.register, request.data
        if register == registers.HIGH_SPEED_PUSH and len(data) == 1:
            self.due = (now if data == b"\1" else math.inf) if bool(data[0]) != self._pushes else self.due
            return wire.Push().encode()
        if register == RESET and data == b"\1":
            self._reset()
            return b""
        if register == registers.HIGH_SPEED_DATA_TYPE and len(data) == 1 and data[0] in (1, 2, 3):
            self._data_type = data[0]
        elif register == registers.HIGH_SPEED_ACTIVE and len(data) == registers.HIGH_SPEED_ACTIVE_BYTES:
            self._active = tuple(m for m in stream_layout.active_modules(data) if m in self._modules)
        else:
            return self._refused(request)
        return wire.Reply(wire.WRITE, register, DONE).encode()

    def _memory(self, now: float) -> dict[int, bytes]:
        """Return the readable data by first register."""
        pads, size = self.pads, registers.HIGH_SPEED_MODULES
        counts = np.zeros(size, dtype="<u2")
        totals = np.zeros((size, 3), dtype="<i2")
        memory = {}
        for module, pad in self._modules.items():
            counts[module] = pads.profile.wire_layout.taxels
            totals[module] = pads.totals(now)[pad]
            palm = module - registers.HIGH_SPEED_FIRST_PALM
            at = FIRST_TAXELS + TAXELS_STEP * module if palm < 0 else FIRST_PALM_TAXELS + PALM_TAXELS_STEP * palm
            memory[at] = taxels.to_bytes(pads.counts(now)[pad])
        palms = counts[registers.HIGH_SPEED_FIRST_PALM :]
        shared = palms[:1] if self._palms_apart or not counts[-1] else counts[-1:]
        return memory | {
            registers.HIGH_SPEED_VERSION: FIRMWARE_VERSION,
            registers.HIGH_SPEED_ACTIVE: stream_layout.active_bitmap(self._active),
            registers.HIGH_SPEED_DATA_TYPE: bytes([self._data_type]),
            registers.HIGH_SPEED_PUSH: bytes([self._pushes]),
            ERROR: b"\0",
            registers.HIGH_SPEED_COUNTS: np.concatenate([counts[:-1], shared, palms[1:]]).tobytes(),
            RESULTANTS_ADDRESS: totals.tobytes(),
        }
