"""Driver for a GEN1 or GEN2 control box: several pads, one request at a time."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import ClassVar, NoReturn

import numpy as np

from paxisim.errors import DeviceTimeoutError, InvalidValueError, ProtocolError
from paxisim.hw.families import registers, taxels
from paxisim.hw.families.board import Reading
from paxisim.hw.families.control_box import wire as wire
from paxisim.hw.families.errors import CONTROL_BOX, error_name
from paxisim.hw.families.line import SUSPENDED_AFTER, Line, LineBoard
from paxisim.hw.link.clock import Clock
from paxisim.hw.link.framing import FrameDecoder
from paxisim.hw.link.transport import Transport
from paxisim.hw.profiles.profile import Profile, Slot

REPLY_TIMEOUT = 0.1
"""Seconds after which a request is repeated; observed replies take 3 ms for 120 taxels and 10 ms for a version."""
REPLY_SILENCE = 0.03
"""Seconds of silence after the last byte before a reply counts as lost."""
START_TIMEOUT = 1.0
MODE_TIMEOUT = 2.0
"""Seconds that the box may take to change its mode, according to the vendor's document."""
POLL_SECONDS = 0.05
"""Seconds between polls while the box completes a slow operation."""
MAX_REFUSALS = 3
"""Number of error replies needed to accept an error; a single one may come from a request damaged in transit."""
DEFAULT_MODE = 5
MAX_ANSWER_BYTES = 128
"""Maximum number of data bytes in a reply that is not a reading; the longest such reply is the version."""


class ControlBox(LineBoard):
    """A control box; each slot is one of its ports.

    All settings are optional: ``mode``, which selects the kind of parts connected (default 5, most GEN2 parts);
    ``address``, the address of the taxels (default 1038); ``resultant_address``, the address of the resultant block in
    front of the taxels, which is read together with them. Without ``resultant_address``, only the taxels are read.

    If a pad answers with an error while others can be read, its status is that error and its counts are zero.
    """

    heard: ClassVar = {
        "replies of the family 'control-box', a GEN1 or GEN2 control box": partial(FrameDecoder, wire.parse_reply),
        "echoes of the host's own requests (control-box)": partial(FrameDecoder, wire.parse_request),
    }
    questions = (wire.version_request().encode(),)

    def __init__(self, transport: Transport, profile: Profile, clock: Clock) -> None:
        """Store the arguments; no I/O.

        Raises:
            InvalidValueError: A slot is not a port, the mode is not a byte, the taxels do not follow the resultant, or
                the address range exceeds 16 bits.
        """
        super().__init__(transport, profile, clock)
        settings = profile.settings
        self._mode = int(settings.get("mode", DEFAULT_MODE))
        if not 0 <= self._mode <= 0xFF:
            raise InvalidValueError(f"mode must be a byte, got {self._mode}")
        ports = [slot.index for slot in profile.slots]
        if not all(0 <= port <= 0xFF for port in ports):
            raise InvalidValueError(f"slots of a control box must have a port number as their index, got {ports}")
        address = int(settings.get("address", registers.CONTROL_BOX_TAXELS))
        self._has_resultant = "resultant_address" in settings
        self._address = int(settings.get("resultant_address", address))
        self._offset = address - self._address
        if self._has_resultant and self._offset < taxels.BYTES_PER_TAXEL:
            raise InvalidValueError("address must be at least 3 above resultant_address, behind the resultant")
        self._count = self._offset + taxels.BYTES_PER_TAXEL * profile.wire_layout.taxels
        if not 0 <= address <= 0xFFFF or self._address < 0 or self._count > 0xFFFF:
            raise InvalidValueError(f"address and the {self._count} bytes read must fit 16 bits, got {address}")
        lengths = frozenset(range(MAX_ANSWER_BYTES + 1)) | {wire.REGION_OVERHEAD + self._count}
        self._expected = wire.reply_parser(lengths)
        self._decoder = FrameDecoder(self._expected, stream=False)
        self._line: Line[wire.Reply] = Line(transport, clock, self._decoder)
        self._repeated = self._stopped = False
        self._first_arrival = self._arrival = 0.0

    def start(self) -> None:
        """See `Board.start`. Queries the version, sets the mode and reads it back, then reads each port once."""
        self._line.recent = b""
        # accept any length: a box may report more or fewer taxels than the profile has
        self._decoder.parse = wire.parse_reply
        try:
            if self._ask(wire.version_request(), _is(wire.GET_VERSION), START_TIMEOUT) is None:
                self._fail("the request for its version")
            self._set_mode()
            for slot in self.profile.slots:
                self._check_port(slot)
        finally:
            self._decoder.parse = self._expected

    def read(self, timeout: float) -> Reading:
        """See `Board.read`.

        Raises:
            ProtocolError: No port gives a reading; the box answers with an error for each.
            DeviceTimeoutError: A port gave no complete reply within `timeout` seconds.
            PortNotFoundError: The port disappeared.
        """
        replies = self._read_ports(timeout)
        if self._stopped or self._arrival - self._first_arrival > len(replies) * (REPLY_TIMEOUT + SUSPENDED_AFTER):
            # this program was suspended between pads, so the first reading is much older than the last
            replies = self._read_ports(timeout)
        payloads, status, errors = [], [], []
        for slot, reply in zip(self.profile.slots, replies, strict=True):
            region = wire.parse_region(reply.data)
            if region is None:
                errors.append(f"port {_port(slot)}: {error_name(reply.error, CONTROL_BOX)}")
            payloads.append(bytes(self._count) if region is None else region.payload)
            status.append(reply.error or (region.status if region else 0))
        if len(errors) == len(self.profile.slots):
            raise ProtocolError(f"the control box gives no reading; {', '.join(errors)}")
        counts = np.stack([taxels.to_counts(payload[self._offset :]) for payload in payloads])
        resultant = None
        if self._has_resultant:
            resultant = np.concatenate([taxels.to_counts(p[: taxels.BYTES_PER_TAXEL]) for p in payloads])
        return Reading(counts, resultant, tuple(status), self._arrival)

    def zero(self) -> None:
        """See `Board.zero`. Error 6 counts as success: the box returns it although zeroing works.

        Raises:
            ProtocolError: The box refuses with another error.
            DeviceTimeoutError: The box does not answer.
        """
        request = wire.write_request(registers.CONTROL_BOX_ZERO, 1)
        for slot in self.profile.slots:
            reply = self._select(slot, START_TIMEOUT)
            if reply is not None and not reply.error:
                reply = self._ask(request, _is(wire.WRITE_REGISTERS), START_TIMEOUT, good=wire.ZERO_GOOD)
            if reply is None:
                raise DeviceTimeoutError(f"port {_port(slot)} did not acknowledge zeroing within {START_TIMEOUT:g} s")
            if reply.error not in wire.ZERO_GOOD:
                raise ProtocolError(f"port {_port(slot)} refuses zeroing: {error_name(reply.error, CONTROL_BOX)}")

    def version(self) -> str:
        """Return the version string that the box reports; empty if it reports none."""
        reply = self._ask(wire.version_request(), _is(wire.GET_VERSION), START_TIMEOUT)
        return "" if reply is None else reply.data.replace(b"\0", b"").decode("ascii", errors="replace").strip()

    def _set_mode(self) -> None:
        """Set the mode and wait until the box reports it."""
        deadline = self.clock.monotonic() + MODE_TIMEOUT
        reply = self._ask(wire.set_mode_request(self._mode), _may_acknowledge_mode, MODE_TIMEOUT)
        if reply is None:
            self._fail(f"the request to set mode {self._mode}")
        if reply.error:
            raise ProtocolError(f"the control box refuses mode {self._mode}: {error_name(reply.error, CONTROL_BOX)}")
        while True:
            left = max(deadline - self.clock.monotonic(), REPLY_TIMEOUT)
            reply = self._ask(wire.get_mode_request(), _is(wire.GET_MODE), left)
            if reply is None:
                self._fail("the request for its mode")
            if reply.data == bytes([self._mode]):
                return
            if self.clock.monotonic() >= deadline:
                raise ProtocolError(
                    f"the control box did not switch to mode {self._mode} within {MODE_TIMEOUT:g} s: it answers "
                    f"{reply.data.hex().upper() or 'nothing'}, {error_name(reply.error, CONTROL_BOX)}; "
                    "check the profile's mode"
                )
            self.clock.sleep(POLL_SECONDS)

    def _check_port(self, slot: Slot) -> None:
        """Check a port's reading against the profile; a pad may need some time after a change of mode."""
        deadline = self.clock.monotonic() + START_TIMEOUT
        while True:
            reply = self._read_port(slot, self.clock.monotonic() + START_TIMEOUT)
            if reply is None:
                self._fail(f"the request for reading port {_port(slot)}")
            if wire.parse_region(reply.data) is not None:
                return
            if self.clock.monotonic() >= deadline:
                raise ProtocolError(
                    f"port {_port(slot)} gives no reading of {self._count} bytes in mode {self._mode}: "
                    f"{error_name(reply.error, CONTROL_BOX)}; is a pad connected to that port, and do mode and part "
                    "match it?"
                )
            self.clock.sleep(POLL_SECONDS)

    def _read_ports(self, timeout: float) -> list[wire.Reply]:
        """Return the reply of each pad."""
        deadline = self.clock.monotonic() + timeout
        self._stopped, replies = False, []
        for slot in self.profile.slots:
            reply = self._read_port(slot, deadline)
            if reply is None:
                raise DeviceTimeoutError(f"no reading came from port {_port(slot)} within {timeout:g} s")
            if not replies:
                self._first_arrival = self._arrival
            replies.append(reply)
        return replies

    def _read_port(self, slot: Slot, deadline: float) -> wire.Reply | None:
        """Return a port's reply with a region or an error; None if there is none before `deadline`."""
        selected = self._select(slot, deadline - self.clock.monotonic())
        if selected is None or selected.error:
            return selected
        request = wire.read_request(self._address, self._count)
        return self._ask(request, self._is_reading, deadline - self.clock.monotonic())

    def _select(self, slot: Slot, timeout: float) -> wire.Reply | None:
        return self._ask(wire.select_port_request(slot.index), _is(wire.SELECT_PORT), timeout)

    def _is_reading(self, reply: wire.Reply) -> bool:
        if (reply.main, reply.sub) != wire.READ_REGISTERS:
            return False
        region = wire.parse_region(reply.data)
        if region is None:
            return reply.error != 0
        return region.address == self._address and len(region.payload) == self._count

    def _ask(
        self, request: wire.Request, fits: Callable[[wire.Reply], bool], timeout: float, good: tuple[int, ...] = (0,)
    ) -> wire.Reply | None:
        """Return the reply to `request`, which is repeated until `timeout`; None if there is none.

        The last repetition may end up to `REPLY_TIMEOUT` after it. A reply with an error and no region is returned only
        after `MAX_REFUSALS` of them, or as the last one before the timeout.
        """
        deadline = self.clock.monotonic() + timeout
        refusals = 0
        if self._repeated:
            # replies do not name their port, so a late one must not be mistaken for the next port's
            self._line.collect(lambda _: False, REPLY_SILENCE)
            self._repeated = False
        while True:
            replies, suspended = self._line.ask(request.encode(), fits, REPLY_TIMEOUT, REPLY_SILENCE)
            deadline += suspended
            self._stopped |= suspended > 0
            arrival, reply = replies[0] if replies else (0.0, None)
            if reply is not None:
                refusals += reply.error not in good
                if reply.error in good or refusals == MAX_REFUSALS or wire.parse_region(reply.data) is not None:
                    self._arrival = arrival
                    return reply
            self._repeated = True
            if self.clock.monotonic() >= deadline:
                return reply

    def _fail(self, what: str) -> NoReturn:
        """Raise an error that says why `what` got no answer: silence, or bytes that do not fit."""
        if not self._line.recent:
            raise DeviceTimeoutError(
                f"nothing came: is it a GEN1 or GEN2 control box, is it powered, and is {self.profile.baud} baud right?"
            )
        decoder = FrameDecoder(wire.parse_reply)
        replies = decoder.feed(self._line.recent) + decoder.flush()
        regions = [wire.parse_region(reply.data) for reply in replies if (reply.main, reply.sub) == wire.READ_REGISTERS]
        counts = {len(region.payload) for region in regions if region and region.address == self._address}
        if counts - {self._count}:
            raise ProtocolError(
                f"profile {self.profile.name!r} expects {self._count} bytes for "
                f"{self.profile.wire_layout.taxels} taxels, but the box sends "
                f"{', '.join(str(count) for count in sorted(counts))}; choose the profile of that part"
            )
        if replies:
            raise DeviceTimeoutError(f"the control box responds, but not to {what}; try power-cycling it")
        from paxisim.hw.link.recognise import describe

        raise ProtocolError(
            f"profile {self.profile.name!r} expects a GEN1 or GEN2 control box, but the bytes received do not fit: "
            f"{describe(self._line.recent)}"
        )


def _port(slot: Slot) -> str:
    return f"{slot.index} ({slot.name})"


def _is(kind: tuple[int, int]) -> Callable[[wire.Reply], bool]:
    return lambda reply: (reply.main, reply.sub) == kind


def _may_acknowledge_mode(reply: wire.Reply) -> bool:
    """Whether `reply` can acknowledge a new mode; in the vendor's document its SUB differs from the request's."""
    others = (wire.GET_MODE, wire.SELECT_PORT, wire.READ_REGISTERS, wire.WRITE_REGISTERS)
    return reply.main == wire.SET_MODE[0] and (reply.main, reply.sub) not in others
