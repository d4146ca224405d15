"""Drivers of the serial families against scripted boards on a pseudo-terminal: what all of them do.

Tables say what differs: the script, and the salient words of the message.
"""

import itertools
import random
from typing import cast

import numpy as np
import pytest
from scripted_peers import Box, Conversation, Converter, HandBoard, HighSpeed, make_profile

from paxisim import DeviceTimeoutError, InvalidValueError, ProtocolError, UnsupportedError
from paxisim.hw.families.control_box import wire as box
from paxisim.hw.families.high_speed import wire as high_speed
from paxisim.hw.families.load import board_class
from paxisim.hw.families.serial_converter import wire as converter
from paxisim.hw.link.clock import SystemClock
from paxisim.hw.link.transport import Transport

SCRIPTS = {script.family: script for script in (Box, Converter, HighSpeed, HandBoard)}
VERSIONS = {
    "control-box": "BOX V1.5",
    "serial-converter": "PAXINI PXSR-STDMC03A-v1.0.5",
    "high-speed": "HS-1.2.3",
    "hand-board": "",
}


@pytest.mark.parametrize("family", SCRIPTS)
def test_readings_come_in_order_with_their_times_and_the_version(family):
    script = SCRIPTS[family]()
    with Conversation(script) as board:
        board.start()
        readings = [board.read(20) for _ in range(12)]
        assert board.version() == VERSIONS[family]
        assert board.bad_checksums == 0
        assert board.skipped < 200 * (family == "hand-board") + 1
        board.stop()
    first = int(readings[0].counts[0, 0, 0]) if family == "hand-board" else 0
    for number, reading in enumerate(readings, first):
        script.check(reading, number)
        assert reading.counts.shape == (len(script.slots), script.taxels, 3)
        assert reading.counts.dtype == np.int16
        assert reading.status == (0,) * len(script.slots)
        assert (reading.resultant is None) == (family in ("control-box", "hand-board"))
        assert reading.resultant is None or reading.resultant.dtype == np.int16
    times = [reading.time for reading in readings]
    assert times == sorted(times)
    assert times[-1] > times[0]


# ---- a board that is not the profile's, or none


def noise(size, seed=2):
    data = random.Random(seed).randbytes(size)
    return lambda request, reply: data


def nothing(request, reply):
    return b""


def refusal(request, reply):
    return high_speed.Reply(request.function | 0x80, request.register).encode()


def no_readings(request, reply):
    return b"" if reply.sub == 0xC006 else reply.encode()


class Babbling(HighSpeed):
    """Answers nothing and never stops sending."""

    def idle(self):
        return random.Random(3).randbytes(50)


class Silent(HandBoard):
    """Sends nothing."""

    def idle(self):
        return b""


def foreign(number):
    return box.Reply(0x70, 0xC006, bytes(40)).encode() * 4


ELSEWHERE = HighSpeed(modules={4: 9, 6: 31})
PALM_ELSEWHERE = HighSpeed(modules={0: 9, 21: 31})
PALM_ELSEWHERE.registers[0x30 + 42] = 0


@pytest.mark.parametrize(
    ("script", "options", "error", "says"),
    [
        (Box(nothing), {}, DeviceTimeoutError, "nothing came"),
        (Box(noise(300)), {}, ProtocolError, "wrong baud rate"),
        (Box(slow=10**6), {}, ProtocolError, "mode 5"),
        (Box(no_readings), {}, DeviceTimeoutError, r"reading port 2 \(left\)"),
        (Box(), {"slots": {"left": 2, "right": 3}}, ProtocolError, r"3 \(right\)"),
        # the box sends its 20 taxels regardless of the number requested
        (Box(), {"taxels": 24}, ProtocolError, "72 bytes for 24 .* 60"),
        (Converter(id=3), {}, DeviceTimeoutError, "id 1"),
        (Converter(noise(200)), {}, ProtocolError, "do not fit"),
        (Converter(), {"part": "PXSR-STDDP03G"}, ProtocolError, "PXSR-STDDP03G.*PXSR-STDMC03A"),
        (HighSpeed(nothing), {}, DeviceTimeoutError, "high-speed board"),
        (HighSpeed(refusal), {}, ProtocolError, "error 3"),
        (HighSpeed(frames=0), {}, DeviceTimeoutError, "streams nothing"),
        (Babbling(nothing), {}, ProtocolError, "high-speed board, but"),
        (ELSEWHERE, {}, ProtocolError, r"0 \(left\), 2 \(right\).*4 \(9 taxels\), 6 \(31 taxels\)"),
        (HighSpeed(modules={0: 9, 2: 52}), {}, ProtocolError, "9 taxels.*right.*52"),
        (PALM_ELSEWHERE, {"slots": {"finger": 0}}, ProtocolError, "palm_counts"),
        (Silent(), {}, DeviceTimeoutError, "nothing came"),
        (HandBoard(foreign), {}, ProtocolError, "GEN1 hand board.*family 'control-box'"),
    ],
    ids=lambda value: value.family if hasattr(value, "family") else None,
)
def test_a_board_that_is_not_the_profiles_is_named_at_the_start(script, options, error, says):
    with Conversation(script, **options) as board, pytest.raises(error, match=rf"(?s){says}"):
        board.start()


@pytest.mark.parametrize(
    ("script", "says"),
    [
        (Box(no_readings), r"within 0\.1 s"),
        (Converter(id=3), r"0\.1 s"),
        (Silent(), r"within 0\.1 s"),
    ],
    ids=["control-box", "serial-converter", "hand-board"],
)
def test_a_reading_that_never_comes(script, says):
    with Conversation(script) as board, pytest.raises(DeviceTimeoutError, match=says):
        board.read(0.1)


@pytest.mark.parametrize(
    ("family", "slots", "taxels", "settings", "says"),
    [
        ("control-box", {"a": 0}, 20, {"resultant_address": 1038}, "address"),
        ("control-box", {"a": 0}, 20, {"address": 70000}, "address"),
        ("control-box", {"a": 256}, 20, {}, "slots"),
        ("hand-board", {"a": 4}, 15, {}, "0 to 3"),
        ("hand-board", {"a": 0}, 16, {}, "15 taxels.* 16"),
        ("high-speed", {"pad": 0}, 9, {"palm_counts": "elsewhere"}, "palm_counts"),
        ("high-speed", {"pad": 28}, 9, {}, r"0\.\.27"),
        ("serial-converter", {"left": 1, "right": 2}, 9, {}, "slots"),
        ("serial-converter", {"pad": 1}, 9, {"address": 1008}, "address"),
        ("serial-converter", {"pad": 300}, 9, {}, "index of 'pad' must be the sensor's id, from 0 to 255, got 300"),
        ("serial-converter", {"pad": 1}, 9, {"resultant_address": -10}, "from 0 to 4294967295, got -10"),
        ("serial-converter", {"pad": 1}, 9, {"resultant_address": 2**33, "address": 2**33 + 30}, "4294967295"),
        ("serial-converter", {"pad": 1}, 9, {"resultant_address": 0, "address": 65536}, "65525 bytes, got 65563"),
    ],
)
def test_profiles_that_no_board_can_have_are_refused(family, slots, taxels, settings, says):
    profile = make_profile(family, taxels, slots, settings)
    with pytest.raises(InvalidValueError, match=says):
        board_class(family)(cast(Transport, None), profile, SystemClock())


def test_the_longest_request_of_a_converter_is_not_refused():
    settings = {"resultant_address": 0, "address": 65525 - 27}
    profile = make_profile("serial-converter", 9, {"pad": 255}, settings)
    board_class("serial-converter")(cast(Transport, None), profile, SystemClock())


# ---- a line that loses and damages


def damaging(cycle):
    """A `change` that treats each reply by the next word of `cycle`."""
    words, late = itertools.cycle(cycle), []

    def change(request, reply):
        frame, word = reply.encode(), next(words)
        if word == "lost":
            return b""
        if word == "short":
            return frame[:9] + frame[10:]
        if word == "cut":
            return frame[:-3]
        if word == "flipped":
            return frame[:8] + bytes([frame[8] ^ 1]) + frame[9:]
        if word == "noisy":
            return b"\xff\x55\xaa" + frame + b"\x55\xaa\x7b"
        if word == "late":  # arrives together with the answer to the next request
            late.append(frame)
            return b""
        answers = b"".join(late) + frame
        late.clear()
        return answers

    return change


@pytest.mark.parametrize(
    "script",
    [
        Box(damaging(["good", "lost", "short", "flipped", "noisy", "late", "good", "good", "late", "good", "good"])),
        Converter(damaging(["good", "lost", "flipped", "cut", "noisy"])),
    ],
    ids=lambda script: script.family,
)
def test_lost_split_late_and_damaged_replies_are_asked_for_again(script):
    with Conversation(script) as board:
        board.start()
        for number in range(12):
            script.check(board.read(20), number)
        assert board.bad_checksums > 0
        assert board.skipped > 0


class DamagedPushes(HighSpeed):
    """Flips a byte of every fourth push, cuts the next one short, and sends the others after noise."""

    def push(self, number):
        frame = super().push(number)
        if number % 4 == 1:
            return frame[:30] + bytes([frame[30] ^ 0x40]) + frame[31:]
        return frame[:-9] if number % 4 == 2 else b"\xaa\x56\x00\xff\xff" + frame


class HalvedPushes(HighSpeed):
    """Sends each push in two parts, and loses every third reply."""

    def __init__(self):
        numbers = itertools.count()
        super().__init__(lambda request, reply: b"" if next(numbers) % 3 == 2 else reply.encode())
        self.rest = []

    def idle(self):
        if self.rest:
            return self.rest.pop()
        data = super().idle()
        self.rest.append(data[len(data) // 2 :])
        return data[: len(data) // 2]


def test_damaged_pushes_are_skipped_and_the_others_delivered_whole():
    script = DamagedPushes()
    with Conversation(script) as board:
        board.start()
        for number in (0, 3, 4, 7, 8):
            script.check(board.read(10), number)
        assert board.bad_checksums >= 2
        assert board.skipped > 0
    script = HalvedPushes()
    with Conversation(script) as board:
        board.start()
        for number in range(6):
            script.check(board.read(10), number)


def box_strangers(request, reply):
    regions = [box.Region(1008, bytes(60)), box.Region(1038, bytes(30))]
    others = [box.Reply(*box.READ_REGISTERS, region.encode()) for region in regions if reply.sub == 0xC006]
    return b"".join(other.encode() for other in (*others, reply))


def converter_strangers(request, reply):
    others = [
        converter.Reply(id, reply.function, address, reply.count, 0, bytes(len(reply.data)))
        for id, address in ((2, reply.address), (1, reply.address + 1))
    ]
    return b"".join(other.encode() for other in (*others, reply))


@pytest.mark.parametrize(
    "script", [Box(box_strangers), Converter(converter_strangers)], ids=lambda script: script.family
)
def test_a_reply_to_something_else_is_not_taken(script):
    with Conversation(script) as board:
        board.start()
        script.check(board.read(20), 0)


# ---- status and zero


def box_status(request, reply):
    if reply.sub != 0xC006:
        return reply.encode()
    return box.Reply(reply.main, reply.sub, b"\x0d" + reply.data[1:]).encode()


def converter_status(request, reply):
    return converter.answer(request, reply.data, 7 if request.count == len(Converter.block) else 0).encode()


class ErrorBetween(HighSpeed):
    """Sends an error without data before push 1."""

    def push(self, number):
        return (high_speed.Push(7).encode() if number == 1 else b"") + super().push(number)


@pytest.mark.parametrize(
    ("script", "statuses"),
    [
        (Box(box_status), [(0x0D, 0x0D)] * 2),
        (Converter(converter_status), [(7,)] * 2),
        (ErrorBetween(), [(0, 0), (7, 7), (0, 0)]),
    ],
    ids=["control-box", "serial-converter", "high-speed"],
)
def test_a_status_that_is_not_good_is_passed_on_with_its_data(script, statuses):
    with Conversation(script) as board:
        board.start()
        for number, status in enumerate(statuses):
            reading = board.read(20)
            assert reading.status == status
            script.check(reading, number)


def box_zero_refused(request, reply):
    return box.Reply(reply.main, reply.sub, b"", 0x11).encode() if reply.sub == 0xB002 else reply.encode()


def converter_zero_refused(request, reply):
    return converter.answer(request, b"", 6).encode() if request.function == converter.WRITE else reply.encode()


def push_zero_refused(request, reply):
    refused = high_speed.Reply(high_speed.ZERO, 2, b"\x05")
    return (refused if request.function == high_speed.ZERO else reply).encode()


@pytest.mark.parametrize(
    ("script", "error", "says"),
    [
        (Box(box_zero_refused), ProtocolError, r"port 2 \(left\) refuses zeroing: error 0x11 \(execute\)"),
        (Converter(converter_zero_refused), ProtocolError, r"error 0x06 \(parameter\)"),
        (HighSpeed(push_zero_refused), ProtocolError, "05"),
        (HandBoard(), UnsupportedError, "software"),
    ],
    ids=lambda value: value.family if hasattr(value, "family") else None,
)
def test_zeroing_that_is_refused_says_so_and_readings_go_on(script, error, says):
    with Conversation(script) as board:
        board.start()
        with pytest.raises(error, match=says):
            board.zero()
        assert not any(board.read(20).status)
