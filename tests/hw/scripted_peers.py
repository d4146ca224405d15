"""The other end of the line of each serial family, scripted independently of the emulator."""

import os
import select
import threading
import time
from typing import Any, ClassVar

import numpy as np
import pytest

from paxisim import Profile, Slot, TaxelLayout
from paxisim.hw.families.control_box import wire as box
from paxisim.hw.families.hand_board.wire import Block, Round
from paxisim.hw.families.high_speed import wire as high_speed
from paxisim.hw.families.high_speed.stream_layout import StreamLayout, active_bitmap
from paxisim.hw.families.load import board_class
from paxisim.hw.families.serial_converter import wire as converter
from paxisim.hw.families.taxels import to_bytes
from paxisim.hw.link.clock import SystemClock
from paxisim.hw.link.framing import FrameDecoder
from paxisim.hw.link.transport import open_transport

pytest.importorskip("serial")
pytest.importorskip("pty", reason="no pseudo-terminals here")

import pty
import tty


class Peer:
    """The board's end of a pseudo-terminal, in a thread; `answer` returns the bytes to send for each request."""

    def __init__(self, parse_request, answer, idle=None):
        """Create the peer; `idle`, if given, is called between requests and may return bytes to send."""
        self.requests = []
        self._decoder, self._answer, self._idle = FrameDecoder(parse_request, stream=False), answer, idle
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stopped.set()
        self._thread.join(10)
        os.close(self._master)
        os.close(self._slave)

    def send(self, data):
        while data and not self._stopped.is_set():
            if select.select([], [self._master], [], 0.05)[1]:
                data = data[os.write(self._master, data) :]

    def _run(self):
        os.set_blocking(self._master, False)
        while not self._stopped.is_set():
            ready = select.select([self._master], [], [], 0.005)[0]
            for request in self._decoder.feed(os.read(self._master, 4096)) if ready else []:
                self.requests.append(request)
                self.send(self._answer(request))
            if self._idle is not None:
                self.send(self._idle())


class Script:
    """A scripted board; `change(request, reply)`, if given, returns the bytes to send in place of a reply."""

    family: str = ""
    slots: ClassVar[dict[str, int]] = {}
    taxels: int = 0
    settings: ClassVar[dict[str, object]] = {}
    idle: Any = None

    def __init__(self, change=None):
        self.change = change or (lambda request, reply: reply.encode())

    def answer(self, request):
        return self.change(request, self.reply(request))

    def reply(self, request):
        raise NotImplementedError

    def check(self, reading, number):
        """Check that a reading is the one with this number, where readings have numbers."""
        raise NotImplementedError


class Box(Script):
    """A control box with pads on ports 2 and 5; it takes its mode after `slow` questions."""

    family, slots, taxels, settings = "control-box", {"left": 2, "right": 5}, 20, {"mode": 5}
    pads: ClassVar = {
        2: np.array([[i - 4, 4 - i, 12 * i] for i in range(20)], dtype=np.int16),
        5: np.array([[-i, i, 255 - i] for i in range(20)], dtype=np.int16),
    }
    totals: ClassVar = {2: [[-7, 8, 200]], 5: [[1, -2, 3]]}

    def __init__(self, change=None, slow=0):
        super().__init__(change)
        self.slow, self.wanted, self.port, self.zeroed = slow, b"\xff", -1, []

    def reply(self, request):
        kind = (request.main, request.sub)
        if kind == box.GET_VERSION:
            return box.Reply(*kind, b"BOX V1.5\0")
        if kind == box.SET_MODE:
            self.wanted = request.data
            return box.Reply(0x70, 0xC009)
        if kind == box.GET_MODE:
            self.slow -= 1
            return box.Reply(*kind, b"\0" if self.slow >= 0 else self.wanted)
        if kind == box.SELECT_PORT:
            self.port = request.data[0]
            return box.Reply(*kind)
        if kind == box.WRITE_REGISTERS:
            self.zeroed.append((self.port, request.data))
            return box.Reply(*kind, b"\6", 6)
        if self.wanted != b"\5" or self.port not in self.pads:
            return box.Reply(*kind, b"", 7)
        address, count = (int.from_bytes(request.data[i : i + 2], "little") for i in (1, 3))
        memory = to_bytes(np.array(self.totals[self.port])) + bytes(27) + to_bytes(self.pads[self.port])
        return box.Reply(*kind, box.Region(address, memory[address - 1008 :][:count]).encode())

    def check(self, reading, number=0):
        np.testing.assert_array_equal(reading.counts, np.stack([self.pads[2], self.pads[5]]))


class Converter(Script):
    """A sensor on a serial converter."""

    family, slots, taxels = "serial-converter", {"pad": 1}, 9
    counts = np.array([[i - 4, 4 - i, 20 * i] for i in range(9)], dtype=np.int16)
    resultant = np.array([[-7, 8, 200]], dtype=np.int16)
    block = to_bytes(resultant) + bytes(27) + to_bytes(counts)

    def __init__(self, change=None, id=1, version="PAXINI PXSR-STDMC03A-v1.0.5"):
        super().__init__(change)
        self.id, self.version = id, version

    def answer(self, request):
        return super().answer(request) if request.id == self.id else b""

    def reply(self, request):
        if request.function == converter.WRITE:
            return converter.answer(request)
        if request.address == 6100:
            return converter.answer(request, self.version.encode().ljust(100, b"\0"), 1)
        return converter.answer(request, (self.block + bytes(4096))[request.address - 1008 :][: request.count], 1)

    def check(self, reading, number=0):
        np.testing.assert_array_equal(reading.counts, self.counts[np.newaxis])
        np.testing.assert_array_equal(reading.resultant, self.resultant)


def numbered_counts(seed, taxels=9):
    """Random ``(taxels, 3)`` counts."""
    return np.random.default_rng(seed).integers([-128, -128, 1], [128, 128, 256], (taxels, 3)).astype(np.int16)


class HighSpeed(Script):
    """A high-speed board that streams `frames` numbered frames once switched on, `at_once` in one write."""

    family, slots, taxels = "high-speed", {"left": 0, "right": 2}, 9

    def __init__(self, change=None, modules=None, frames=10**6, at_once=1):
        super().__init__(change)
        self.modules = {0: 9, 2: 9} if modules is None else modules
        self.remaining, self.at_once = frames, at_once
        self.registers = bytearray(0x100)
        self.registers[0x00:0x0F] = b"HS-1.2.3".ljust(15, b"\0")
        self.registers[0x10:0x14] = active_bitmap(sorted(self.modules))
        for module, taxels in self.modules.items():
            self.registers[0x30 + 2 * module] = taxels
        self.registers[0x16] = 1
        self.number, self.due, self.zeroed = 0, 0.0, 0

    def reply(self, request):
        at = request.register
        if request.function == high_speed.ZERO:
            self.zeroed += 1
            return high_speed.Reply(high_speed.ZERO, at, b"\0")
        if request.function == high_speed.WRITE:
            self.registers[at : at + request.count] = request.data
            return high_speed.Push() if at == 0x17 else high_speed.Reply(high_speed.WRITE, at, b"\0")
        return high_speed.Reply(high_speed.READ, at, bytes(self.registers[at : at + request.count]))

    def push(self, number):
        modules = sorted(self.modules)
        layout = StreamLayout(tuple(modules), tuple(self.modules[m] for m in modules), self.registers[0x16])
        readings = [numbered_counts(100 * number + module, self.modules[module]) for module in modules]
        # the high bytes of a resultant carry no information
        resultants = [np.array([-5 - module, 7, 200 + number % 50 - 512]) for module in modules]
        return high_speed.Push(0, layout.encode(resultants, readings)).encode()

    def idle(self):
        if not self.registers[0x17] or not self.remaining or time.monotonic() < self.due:
            return b""
        self.due = time.monotonic() + 0.02
        count = min(self.at_once, self.remaining)
        data = b"".join(self.push(self.number + i) for i in range(count))
        self.number += count
        self.remaining -= count
        return data

    def check(self, reading, number, modules=(0, 2)):
        np.testing.assert_array_equal(reading.counts, [numbered_counts(100 * number + module) for module in modules])
        np.testing.assert_array_equal(reading.resultant, [[-5 - module, 7, 200 + number % 50] for module in modules])


def numbered_round(number):
    """A round of the hand board that is unique to `number`."""
    first, *others = (Block(bytes([number, i, 3] * 15)) for i in range(4))
    return Round((first, *others))


class HandBoard(Script):
    """A hand board that sends rounds 0, 1, 2 ... in pieces that are not whole; `make(number)` makes their bytes."""

    family, slots, taxels = "hand-board", {"tip": 1, "pulp": 0}, 15

    def __init__(self, make=lambda number: numbered_round(number % 100).encode()):
        super().__init__()
        self.make, self.number, self.waiting = make, 0, b""

    def answer(self, request):
        return b""

    def idle(self):
        time.sleep(1e-3)
        if len(self.waiting) < 130:
            self.waiting += self.make(self.number)
            self.number += 1
        piece, self.waiting = self.waiting[:130], self.waiting[130:]
        return piece

    def check(self, reading, number):
        np.testing.assert_array_equal(reading.counts[:, :, 0], number % 100)
        np.testing.assert_array_equal(reading.counts[:, 0, 1], [1, 0])


PARSE_REQUEST = {
    "control-box": box.parse_request,
    "serial-converter": converter.parse_request,
    "high-speed": high_speed.parse_request,
    "hand-board": box.parse_request,
}


def make_profile(family, taxels, slots, settings=None):
    """A profile of pads with the given number of taxels."""
    layout = TaxelLayout(1, taxels, (1e-3, 1e-3))
    named = tuple(Slot(name, index) for name, index in slots.items())
    return Profile(f"test-{family}", family, layout, named, baud=460800, settings=settings or {})


class Conversation:
    """Context manager: the driver on a pseudo-terminal with a script at its other end."""

    def __init__(self, script, slots=None, taxels=None, **settings):
        family = script.family
        self.script = script
        self.profile = make_profile(
            family, taxels or script.taxels, slots or script.slots, {**script.settings, **settings}
        )
        self.peer = Peer(PARSE_REQUEST[family], script.answer, script.idle)

    def __enter__(self):
        self.peer.__enter__()
        self.transport = open_transport(self.peer.port, self.profile.baud)
        return board_class(self.profile.family)(self.transport, self.profile, SystemClock())

    def __exit__(self, *error):
        self.transport.close()
        self.peer.__exit__(*error)
