"""Driver for a GEN3 high-speed board: up to 28 modules, streamed together."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import ClassVar, NoReturn

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import DeviceError, DeviceTimeoutError, InvalidValueError, ProtocolError
from paxisim.hw.families import registers, taxels
from paxisim.hw.families.board import Reading
from paxisim.hw.families.high_speed.stream_layout import RESULTANTS, TAXELS, StreamLayout, active_modules
from paxisim.hw.families.high_speed.wire import (
    Push,
    Reply,
    Request,
    incoming_parser,
    parse_incoming,
    parse_push,
    parse_reply,
    parse_request,
    push_parser,
    push_request,
    read_request,
    version_request,
    write_request,
    zero_request,
)
from paxisim.hw.families.line import Line, LineBoard, with_behind
from paxisim.hw.link.clock import Clock
from paxisim.hw.link.framing import FrameDecoder
from paxisim.hw.link.transport import Transport
from paxisim.hw.profiles.profile import Profile
from paxisim.logs.schemas import NO_TAXELS

REPLY_TIMEOUT = 0.15
"""Seconds after which a request is repeated."""
ANSWER_TIMEOUT = 2.0
"""Seconds after which an unanswered request fails."""
STREAM_TIMEOUT = 0.5
"""Seconds within which the stream starts or stops after the command."""
STREAM_SILENCE = 0.06
"""Seconds of silence after which the stream counts as stopped; its frames are 11 to 12 ms apart."""
ATTEMPTS = 4
"""Number of attempts to switch the stream, and number of error replies needed to accept an error."""


class HighSpeed(LineBoard):
    """A GEN3 high-speed board.

    A slot's index is the module's number, 0 to 27. Optional setting: ``palm_counts``, where the board keeps the taxel
    counts of modules 20 to 27: ``"contiguous"`` (default), behind those of the fingers, or ``"0066"``, from register
    0066 on.

    A pad's `Reading.status` is the stream's error code, combined with `NO_TAXELS` if the pad reports a resultant but
    all its taxels are zero.
    """

    heard: ClassVar = {
        "replies of the family 'high-speed', a GEN3 high-speed board": partial(FrameDecoder, parse_reply),
        "pushes of the family 'high-speed', a GEN3 high-speed board": partial(FrameDecoder, parse_push),
        "echoes of the host's own requests (high-speed)": partial(FrameDecoder, parse_request),
    }
    questions = (version_request().encode(),)

    def __init__(self, transport: Transport, profile: Profile, clock: Clock) -> None:
        """Store the arguments; no I/O.

        Raises:
            InvalidValueError: A slot's index is not a module, or ``palm_counts`` is neither of the two values.
        """
        super().__init__(transport, profile, clock)
        for slot in profile.slots:
            if not 0 <= slot.index < registers.HIGH_SPEED_MODULES:
                raise InvalidValueError(
                    f"slots: index of {slot.name!r} must be a module number in 0..{registers.HIGH_SPEED_MODULES - 1}, "
                    f"got {slot.index}"
                )
        self._palm_counts = profile.settings.get("palm_counts", "contiguous")
        if self._palm_counts not in ("contiguous", "0066"):
            raise InvalidValueError(f"palm_counts must be 'contiguous' or '0066', got {self._palm_counts!r}")
        self._decoder: FrameDecoder[Reply | Push] = FrameDecoder(parse_incoming)
        self._line = Line(transport, clock, self._decoder)
        self._version = ""
        self._streaming = False
        self._waiting: deque[tuple[float, int, Push]] = deque()
        self._reported = 0
        self._use(StreamLayout((), ()))

    def start(self) -> None:
        """See `Board.start`. Also starts the stream."""
        self._line.recent = b""
        self._use(StreamLayout((), ()))
        self._waiting.clear()
        self._reported = 0
        self._decoder.parse = parse_incoming
        self._hush()
        self._version = self._ask(version_request()).replace(b"\0", b"").decode("ascii", errors="replace").strip()
        modules = active_modules(self._read(registers.HIGH_SPEED_ACTIVE, registers.HIGH_SPEED_ACTIVE_BYTES))
        counts = {module: self._count(module) for module in modules}
        self._check(counts)
        self._ask(write_request(registers.HIGH_SPEED_DATA_TYPE, bytes([RESULTANTS | TAXELS])))
        data_type = self._read(registers.HIGH_SPEED_DATA_TYPE, 1)[0]
        if not data_type & TAXELS:
            raise ProtocolError(
                f"the board was told to stream resultants and taxels (data type 3) but keeps {data_type}"
            )
        self._use(StreamLayout(modules, tuple(counts.values()), data_type))
        try:
            self._begin()
        except BaseException:
            self.stop()
            raise

    def read(self, timeout: float) -> Reading:
        """See `Board.read`. Readings that arrive together are returned one by one; none is lost."""
        if not self._waiting:
            self._keep(self._line.collect(self._is_reading, timeout))
        if not self._waiting:
            code = f"; the stream reports error {self._reported}" if self._reported else ""
            raise DeviceTimeoutError(f"no frame of {self._layout.size} bytes came within {timeout:g} s{code}")
        return self._reading(*self._waiting.popleft())

    def zero(self) -> None:
        """See `Board.zero`. Pauses the stream and zeroes all modules of the board, even those without a pad."""
        with self._paused():
            done = self._ask(zero_request())
            # readings measured before would be mistaken for zeroed ones
            self._waiting.clear()
        if any(done):
            raise ProtocolError(f"the board could not zero its modules: it answers {done.hex()}")

    def version(self) -> str:
        """Return the version that the board reported at start; querying it again would interrupt the stream."""
        return self._version

    def stop(self) -> None:
        """Stop the stream."""
        if self._streaming:
            self._streaming = False
            # nothing more can be done for a board that is gone or keeps streaming
            with suppress(DeviceError):
                self._hush()

    def _use(self, layout: StreamLayout) -> None:
        """Set the layout of the pushes to expect."""
        self._layout = layout
        self._lengths = frozenset({0, layout.size})
        slots = self.profile.slots if layout.modules else ()
        places = np.arange(layout.size)
        self._taxel_places = [places[layout.taxels_at(slot.index)] for slot in slots]
        # the low bytes of three 16-bit numbers
        self._resultant_places = [places[layout.resultant_at(slot.index)][::2] for slot in slots]

    def _reading(self, time: float, behind: int, push: Push) -> Reading:
        data = np.frombuffer(push.data, dtype=np.uint8)
        counts = self._counts(data, self._taxel_places).reshape(len(self.profile.slots), -1, 3)
        resultant = self._counts(data, self._resultant_places) if self._layout.data_type & RESULTANTS else None
        error = push.error or self._reported
        self._reported = 0
        status = np.full(len(counts), error)
        if resultant is not None:
            status[resultant.any(axis=1) & ~counts.any(axis=(1, 2))] |= NO_TAXELS
        return Reading(counts, resultant, tuple(status.tolist()), time, behind)

    @staticmethod
    def _counts(data: NDArray[np.uint8], places: list[NDArray[np.intp]]) -> NDArray[np.int16]:
        return taxels.to_counts(data[np.concatenate(places)].tobytes())

    def _is_reading(self, message: Reply | Push) -> bool:
        return isinstance(message, Push) and len(message.data) == self._layout.size > 0

    def _keep(self, heard: list[tuple[float, Reply | Push]]) -> None:
        """Queue readings for `read`, and store an error that came without a reading."""
        pushes = [(time, message) for time, message in heard if isinstance(message, Push)]
        self._waiting.extend(with_behind([(time, push) for time, push in pushes if self._is_reading(push)]))
        for _, push in pushes:
            if push.error and not push.data:
                self._reported = push.error

    def _read(self, register: int, count: int) -> bytes:
        return self._ask(read_request(register, count))

    def _ask(self, request: Request) -> bytes:
        """Return the data of the reply to `request`, which is repeated if no reply comes."""
        deadline = self.clock.monotonic() + ANSWER_TIMEOUT
        errors = 0
        while True:
            self.transport.write(request.encode())
            heard = self._line.collect(
                lambda message: isinstance(message, Reply) and message.answers(request), REPLY_TIMEOUT, STREAM_SILENCE
            )
            self._keep(heard)
            for _, message in heard:
                if not isinstance(message, Reply) or not message.answers(request):
                    continue
                if not message.error:
                    return message.data
                errors += 1
                if errors == ATTEMPTS:
                    raise ProtocolError(
                        f"the board refuses function {request.function:02X} at register {request.register:04X} "
                        f"({request.count} bytes): error {message.error}"
                    )
            if self.clock.monotonic() >= deadline:
                self._fail(f"the board does not answer at register {request.register:04X}")

    def _hush(self) -> None:
        """Stop the stream, whether or not it is running, and collect what is still in transit."""
        self._decoder.parse = incoming_parser(self._lengths) if self._layout.modules else parse_incoming
        for _ in range(ATTEMPTS):
            self.transport.write(push_request(False).encode())
            self._keep(self._line.collect(lambda _: False, STREAM_TIMEOUT, STREAM_SILENCE))
            if self._line.silent:
                return
        self._fail("the port keeps sending after the command to stop")

    def _begin(self) -> None:
        """Start the stream and wait for its first reading."""
        self._decoder.parse = push_parser(self._lengths)
        self._streaming = True
        for _ in range(ATTEMPTS):
            self.transport.write(push_request(True).encode())
            self._keep(self._line.collect(self._is_reading, STREAM_TIMEOUT))
            if self._waiting:
                return
        self._fail_stream()

    @contextmanager
    def _paused(self) -> Iterator[None]:
        """Pause the stream if it is running, since replies would be lost in it."""
        if not self._streaming:
            yield
            return
        self._hush()
        try:
            yield
        finally:
            self._begin()

    def _count(self, module: int) -> int:
        """Return the number of taxels that the board reports for a module."""
        register = registers.HIGH_SPEED_COUNTS + 2 * module
        if module >= registers.HIGH_SPEED_FIRST_PALM and self._palm_counts == "0066":
            register = registers.HIGH_SPEED_PALM_COUNTS + 2 * (module - registers.HIGH_SPEED_FIRST_PALM)
        return int.from_bytes(self._read(register, 2), "little")

    def _check(self, counts: dict[int, int]) -> None:
        """Check the active modules and their numbers of taxels against the profile."""
        name, expected = self.profile.name, self.profile.wire_layout.taxels
        listed = ", ".join(f"{module} ({count} taxels)" for module, count in counts.items()) or "none"
        absent = [f"{slot.index} ({slot.name})" for slot in self.profile.slots if slot.index not in counts]
        if absent:
            raise ProtocolError(
                f"profile {name!r} reads module {', '.join(absent)}, which is not active; active modules: {listed}. "
                "Correct the index of its slots, or the wiring"
            )
        others = [slot for slot in self.profile.slots if counts[slot.index] != expected]
        if others:
            raise ProtocolError(
                f"profile {name!r} expects {expected} taxels, but module {others[0].index} ({others[0].name}) has "
                f"{counts[others[0].index]}; active modules: {listed}. Choose the profile of that part"
            )

    def _fail(self, what: str) -> NoReturn:
        """Raise an error that says why there is no answer: silence, or bytes that do not fit."""
        if not self._line.recent:
            raise DeviceTimeoutError(
                f"{what}: nothing came; is it a GEN3 high-speed board, is it powered, and is {self.profile.baud} baud "
                "right?"
            )
        from paxisim.hw.link.recognise import describe

        raise ProtocolError(
            f"profile {self.profile.name!r} expects a GEN3 high-speed board, but {what}: {describe(self._line.recent)}"
        )

    def _fail_stream(self) -> NoReturn:
        """Raise an error that says why there are no readings: no push at all, or pushes of another length."""
        decoder = FrameDecoder(parse_push)
        pushes = decoder.feed(self._line.recent) + decoder.flush()
        sizes = sorted({len(push.data) for push in pushes if push.data})
        if not sizes:
            code = f"; it reports error {self._reported}" if self._reported else ""
            raise DeviceTimeoutError(f"the board answers but streams nothing{code}; try power-cycling it")
        raise ProtocolError(
            f"the board's modules {list(self._layout.modules)} with {list(self._layout.taxels)} taxels make frames of "
            f"{self._layout.size} bytes, but frames of {sizes} bytes came; if palm modules are in use, try the other "
            "palm_counts setting in the profile"
        )
