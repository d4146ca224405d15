"""Driver for a GEN3 serial converter, or a GEN3 part with its own USB connection: one sensor, polled."""

from __future__ import annotations

import re
from functools import partial
from typing import ClassVar, NoReturn

import numpy as np

from paxisim.errors import DeviceTimeoutError, InvalidValueError, ProtocolError
from paxisim.hw.families import registers, taxels
from paxisim.hw.families.board import Reading
from paxisim.hw.families.errors import SERIAL_CONVERTER, error_name
from paxisim.hw.families.line import Line, LineBoard
from paxisim.hw.families.serial_converter.wire import (
    GOOD,
    MAX_READ_REQUEST,
    READ,
    Reply,
    Request,
    parse_reply,
    parse_request,
    read_request,
    reply_parser,
    version_request,
    zero_request,
)
from paxisim.hw.link.clock import Clock
from paxisim.hw.link.framing import FrameDecoder
from paxisim.hw.link.transport import Transport
from paxisim.hw.profiles.profile import Profile

POLL_SECONDS = 0.005
"""Seconds between polls, the same as in the vendor's program."""
PAUSE_BEFORE_ZERO = 0.5
REPLY_TIMEOUT = 0.15
"""Seconds after which a request is repeated; parts under load were observed to take 90 ms."""
REPLY_SILENCE = 0.02
"""Seconds of silence after the last byte before a reply counts as lost."""
START_TIMEOUT = 1.0
SCANNED = range(9)
"""Ids that the vendor's program tries."""
SCAN_ROUNDS = 3
"""Number of passes over all ids before the sensor counts as absent; a busy host may miss a whole pass."""
MAX_REFUSALS = 3
"""Number of error replies needed to accept an error; a single one may come from a request damaged in transit."""


class SerialConverter(LineBoard):
    """A GEN3 sensor that answers requests.

    The profile has one slot, whose index is the sensor's id. All settings are optional: ``resultant_address`` and
    ``address``, the addresses of the resultant and of the taxels behind it, which are read together; ``part``, e.g.
    ``"PXSR-STDDP03G"``, the part number that the sensor's version must name if it names one; ``scan``, true to look for
    the sensor under its own id and ids 0 to 8 instead of relying on the slot's index.
    """

    heard: ClassVar = {
        "replies of the family 'serial-converter', a GEN3 converter or USB sensor": partial(FrameDecoder, parse_reply),
        "echoes of the host's own requests (serial-converter)": partial(FrameDecoder, parse_request),
    }
    questions = (b"".join(version_request(i).encode() for i in SCANNED),)

    def __init__(self, transport: Transport, profile: Profile, clock: Clock) -> None:
        """Store the arguments; no I/O.

        Raises:
            InvalidValueError: The profile has more than one slot, its index is not an id, the taxels do not follow the
                resultant, or an address or the number of bytes exceeds what a request can express.
        """
        super().__init__(transport, profile, clock)
        if len(profile.slots) != 1:
            raise InvalidValueError(f"slots must list one pad: a serial converter has only one, got {profile.slots}")
        slot, settings = profile.slots[0], profile.settings
        if not 0 <= slot.index <= 0xFF:
            raise InvalidValueError(
                f"slots: index of {slot.name!r} must be the sensor's id, from 0 to 255, got {slot.index}"
            )
        self._id = slot.index
        self._start = int(settings.get("resultant_address", registers.CONVERTER_RESULTANT))
        address = int(settings.get("address", registers.CONVERTER_TAXELS))
        if self._start < 0 or address > 0xFFFFFFFF:
            raise InvalidValueError(
                f"resultant_address and address must be from 0 to {0xFFFFFFFF}, got {self._start} and {address}"
            )
        self._offset = address - self._start
        if self._offset < taxels.BYTES_PER_TAXEL:
            raise InvalidValueError("address must be at least 3 above resultant_address, behind the resultant")
        self._count = self._offset + taxels.BYTES_PER_TAXEL * profile.wire_layout.taxels
        if self._count > MAX_READ_REQUEST:
            raise InvalidValueError(
                f"a reply from resultant_address {self._start} to the last taxel must have at most {MAX_READ_REQUEST} "
                f"bytes, got {self._count}: is address {address} right?"
            )
        # 0: the reply to a write, or a refusal; 3: a resultant alone
        lengths = {0, taxels.BYTES_PER_TAXEL, registers.CONVERTER_VERSION_BYTES, self._count}
        self._decoder = FrameDecoder(reply_parser(lengths), stream=False)
        self._line: Line[Reply] = Line(transport, clock, self._decoder)
        self._ready = clock.monotonic()
        self._repeated = False
        self._arrival = 0.0

    @property
    def id(self) -> int:
        """The id under which the sensor answers."""
        return self._id

    def start(self) -> None:
        """See `Board.start`."""
        self._line.recent = b""
        if self.profile.settings.get("scan", False):
            self._scan()
        self._check_part(self.version())
        if self._ask(self._everything(), START_TIMEOUT) is None:
            self._fail()

    def read(self, timeout: float) -> Reading:
        """See `Board.read`."""
        reply = self._ask(self._everything(), timeout)
        if reply is None:
            raise DeviceTimeoutError(f"no reading came from id {self._id} within {timeout:g} s")
        counts = taxels.to_counts(reply.data[self._offset :])
        return Reading(
            counts=counts[np.newaxis],
            resultant=taxels.to_counts(reply.data[: taxels.BYTES_PER_TAXEL]),
            status=(0 if reply.status in GOOD else reply.status,),
            time=self._arrival,
        )

    def zero(self) -> None:
        """See `Board.zero`. Waits half a second first, as the sensor requires."""
        self.clock.sleep(PAUSE_BEFORE_ZERO)
        if self._ask(zero_request(self._id), START_TIMEOUT) is None:
            raise DeviceTimeoutError(f"id {self._id} did not acknowledge zeroing within {START_TIMEOUT:g} s")

    def version(self) -> str:
        """Return the version string that the sensor reports; empty if it reports none."""
        try:
            reply = self._ask(version_request(self._id), 4 * REPLY_TIMEOUT)
        except ProtocolError:
            reply = None
        return "" if reply is None else reply.data.replace(b"\0", b"").decode("ascii", errors="replace").strip()

    def _everything(self) -> Request:
        """Return the request for the resultant and the taxels together."""
        return read_request(self._id, self._start, self._count)

    def _scan(self) -> None:
        """Find the id that answers, trying the profile's own id first."""
        index = self.profile.slots[0].index
        for candidate in SCAN_ROUNDS * (index, *(i for i in SCANNED if i != index)):
            # every part has a resultant, but some may lack a version
            if self._ask(read_request(candidate, self._start, taxels.BYTES_PER_TAXEL), REPLY_TIMEOUT) is not None:
                self._id = candidate
                return
        self._fail(f"ids {SCANNED[0]} to {SCANNED[-1]}")

    def _check_part(self, version: str) -> None:
        expected = str(self.profile.settings.get("part", ""))
        named = re.search(r"PXSR-[A-Z0-9]+", version.upper())
        if expected and named and named[0] != expected.upper():
            raise ProtocolError(
                f"profile {self.profile.name!r} is for part {expected}, but the sensor reports part {named[0]} "
                f"({version!r}); choose the profile of that part"
            )

    def _ask(self, request: Request, timeout: float) -> Reply | None:
        """Return the reply to `request`, which is repeated until `timeout`; None if there is none.

        The last repetition may end up to `REPLY_TIMEOUT` after it.

        Raises:
            ProtocolError: The sensor refuses.
        """
        deadline = self.clock.monotonic() + timeout
        refusals = 0
        if self._repeated:
            # replies to the original and the repeated request look alike; a late one must not pass as the next reading
            self._line.collect(lambda _: False, REPLY_SILENCE)
            self._repeated = False
        while True:
            pause = self._ready - self.clock.monotonic()
            if pause > 0:
                self.clock.sleep(pause)
            # a late reply may be followed immediately by the reply to the repeated request
            self._decoder.stream = self._repeated
            replies, suspended = self._line.ask(
                request.encode(), lambda reply: reply.answers(request), REPLY_TIMEOUT, REPLY_SILENCE
            )
            deadline += suspended
            self._ready = self.clock.monotonic() + POLL_SECONDS
            for arrival, reply in replies:
                if (len(reply.data) == reply.count) if request.function == READ else (reply.status in GOOD):
                    self._arrival = arrival
                    return reply
                refusals += 1
                if refusals == MAX_REFUSALS:
                    raise ProtocolError(
                        f"id {self._id} refuses function {request.function:02X} at {request.address} "
                        f"({request.count} bytes): {error_name(reply.status, SERIAL_CONVERTER)}"
                    )
            self._repeated = True
            if self.clock.monotonic() >= deadline:
                return None

    def _fail(self, who: str = "") -> NoReturn:
        """Raise an error that says why there is no reading: silence, or bytes that do not fit."""
        who = who or f"id {self._id}"
        if not self._line.recent:
            raise DeviceTimeoutError(
                f"nothing answers as {who}: is the sensor powered, is that its id (setting scan = true tries all), and "
                f"is {self.profile.baud} baud right?"
            )
        from paxisim.hw.link.recognise import describe

        raise ProtocolError(
            f"profile {self.profile.name!r} expects a GEN3 serial converter that answers as {who} with {self._count} "
            f"bytes, but the bytes received do not fit: {describe(self._line.recent)}"
        )
