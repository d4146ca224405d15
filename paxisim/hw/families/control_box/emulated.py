"""Emulated GEN1 / GEN2 control box. See `paxisim.hw.families.control_box.wire` for its messages."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from paxisim.hw.emulation.pads import EmulatedPads
from paxisim.hw.families.control_box import wire as wire
from paxisim.hw.families.emulated_board import EmulatedBoard
from paxisim.hw.link.framing import FrameDecoder
from paxisim.hw.profiles.profile import Profile

VERSION_WAIT = 5e-3
"""Delay of the version reply in seconds; public drivers wait 10 ms for it."""
USB_SPEED = 165e3
"""Bytes per second over the box's USB, where the baud rate has no effect: observed replies take 2 to 3 ms for 120
taxels, and 4 to 6 ms for two pads."""
CHANGED_SUB = 0xC009
"""SUB of the reply to `SET_MODE` as the vendor's document prints it."""
PORTS = 21
"""Number of ports; public drivers use ports up to 20."""
MAX_READ = 1000
RESULTANT_BLOCK = 30
ZERO_REQUEST = bytes([3, 1])

_LENGTH, _MAIN, _SUB, _OVERFLOW, _PARAMETER, _NO_DATA, _OTHERS = 1, 3, 4, 5, 6, 7, 0x0D


class ControlBox(EmulatedBoard):
    """Answers requests one at a time and sends nothing unprompted.

    As on the real box:

    - Pads can be read once the mode matches and a port is selected. A mode takes effect at once although the vendor's
      document allows the box 2 s, since public drivers read without waiting.
    - The version names the part.
    - The reply to a new mode carries another SUB.
    - Zeroing returns an error although it works.

    No source states which error byte the real box returns for a port without a pad, a wrong mode or a nonexistent
    range; this class returns 7 (no data), 7 and 5 (overflow). It does not answer requests with a wrong check byte.
    """

    def __init__(self, pads: EmulatedPads, *, wrong_status: Callable[[], bool] = lambda: False) -> None:
        """Power on: no mode, no port."""
        super().__init__(pads, wrong_status=wrong_status)
        self._decoder = FrameDecoder(wire.parse_request, stream=False)
        self._late: deque[tuple[float, bytes]] = deque()
        self._mode = 0
        self._port: int | None = None
        settings = pads.profile.settings
        self._wanted_mode = settings.get("mode", 5)
        self._address = settings.get("address", 1038)
        self._resultant_address = settings.get("resultant_address", 1008)

    def answers(self, data: bytes, now: float) -> list[bytes]:
        """See `EmulatedBoard.answers`."""
        found = []
        for request in self._decoder.feed(data):
            reply = self._answer(request, now)
            if self._wrong_status():
                reply = wire.Reply(reply.main, reply.sub, b"", _OTHERS, reply.index)
            wait = VERSION_WAIT if (request.main, request.sub) == wire.GET_VERSION else 0.0
            if wait or self._late:
                # the box processes one request at a time
                start = self._late[-1][0] if self._late else now
                self._late.append((start + wait, reply.encode()))
            else:
                found.append(reply.encode())
        self._set_due()
        return found

    def tick(self, now: float) -> bytes:
        """See `EmulatedBoard.tick`."""
        message = self._late.popleft()[1] if now >= self.due else b""
        self._set_due()
        return message

    def _set_due(self) -> None:
        self.due = self._late[0][0] if self._late else math.inf

    def _answer(self, request: wire.Request, now: float) -> wire.Reply:
        kind = (request.main, request.sub)
        if kind == wire.GET_VERSION:
            return self._reply(request, version_of(self.pads.profile))
        if kind == wire.GET_MODE:
            return self._reply(request, bytes([self._mode]))
        if kind == wire.SET_MODE:
            return self._set_mode(request)
        if kind == wire.SELECT_PORT:
            return self._select_port(request)
        if kind == wire.READ_REGISTERS:
            return self._read(request, now)
        if kind == wire.WRITE_REGISTERS:
            return self._write(request, now)
        known = (
            wire.GET_VERSION,
            wire.GET_MODE,
            wire.SET_MODE,
            wire.SELECT_PORT,
            wire.READ_REGISTERS,
            wire.WRITE_REGISTERS,
        )
        return self._reply(request, error=_SUB if request.main in {main for main, _ in known} else _MAIN)

    def _reply(self, request: wire.Request, data: bytes = b"", error: int = 0) -> wire.Reply:
        return wire.Reply(request.main, request.sub, data, error, request.index)

    @property
    def bytes_per_second(self) -> float:
        """See `EmulatedBoard.bytes_per_second`."""
        return USB_SPEED

    def _set_mode(self, request: wire.Request) -> wire.Reply:
        if len(request.data) != 1:
            return self._reply(request, error=_LENGTH)
        self._mode = request.data[0]
        return wire.Reply(request.main, CHANGED_SUB, b"", 0, request.index)

    def _select_port(self, request: wire.Request) -> wire.Reply:
        if len(request.data) != 1:
            return self._reply(request, error=_LENGTH)
        if request.data[0] >= PORTS:
            return self._reply(request, error=_PARAMETER)
        self._port = request.data[0]
        return self._reply(request)

    def _pad(self) -> int | None:
        """Return the pad on the selected port; None if there is none or the mode is wrong."""
        ports = [slot.index for slot in self.pads.profile.slots]
        return ports.index(self._port) if self._port in ports and self._mode == self._wanted_mode else None

    def _read(self, request: wire.Request, now: float) -> wire.Reply:
        if len(request.data) != 5:
            return self._reply(request, error=_LENGTH)
        if request.data[0] != wire.READ_FUNCTION:
            return self._reply(request, error=_PARAMETER)
        pad = self._pad()
        if pad is None:
            return self._reply(request, error=_NO_DATA)
        address, count = int.from_bytes(request.data[1:3], "little"), int.from_bytes(request.data[3:5], "little")
        memory = {
            self._resultant_address: self.pads.total(pad, now).ljust(RESULTANT_BLOCK, b"\0"),
            self._address: self.pads.taxels(pad, now),
        }
        payload = region(memory, address, count)
        if payload is None or count > MAX_READ:
            return self._reply(request, error=_OVERFLOW)
        return self._reply(request, wire.Region(address, payload).encode())

    def _write(self, request: wire.Request, now: float) -> wire.Reply:
        if len(request.data) != 2:
            return self._reply(request, error=_LENGTH)
        pad = self._pad()
        if request.data == ZERO_REQUEST and pad is not None:
            self.pads.zero(now, pad)
        return self._reply(request, bytes([_PARAMETER]), error=_PARAMETER)


def version_of(profile: Profile) -> bytes:
    """Return a version that names the part, like a real one (``PAXINI PXSR-STDDP03F-v1.0.5``), in at most 100 bytes.

    The part is the profile's part code if it has one, otherwise the profile's name without the board's suffix.
    """
    part = str(profile.settings.get("part") or profile.name.replace("-box", "").replace("-serial", "").upper())
    return f"PAXISIM {part[:80]}-v1.0.0".encode("ascii", errors="replace")


def region(memory: dict[int, bytes], address: int, count: int) -> bytes | None:
    """Return `count` bytes from `address` on, across adjacent regions; None if any of them does not exist."""
    found = b""
    for start in sorted(memory):
        at = address + len(found) - start
        if 0 <= at < len(memory[start]):
            found += memory[start][at : at + count - len(found)]
    return found if count and len(found) == count else None
