"""Bytes to frames, without I/O: what the decoder of every family does with pieces, garbage and damage.

The examples come first: how to make random messages of each family, and bytes that look like the beginning of one.
"""

from __future__ import annotations

import random
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from byte_streams import accepted, box_checks, bursts, decoded, hexed, sums_to_zero
from hypothesis import given, settings
from hypothesis import strategies as st

from paxisim.hw.families.control_box import wire as control_box
from paxisim.hw.families.hand_board import wire as hand_board
from paxisim.hw.families.high_speed import wire as high_speed
from paxisim.hw.families.magnetometer_board import wire as magnetometer_board
from paxisim.hw.families.serial_converter import wire as serial_converter
from paxisim.hw.families.xela_server import wire as xela_server
from paxisim.hw.link.framing import Decoder, FrameDecoder, Parser

BYTE, WORD, ADDRESS = st.integers(0, 255), st.integers(0, 65535), st.integers(0, 2**32 - 1)
CUTS = st.lists(st.integers(1, 40), max_size=30)
repeatable = settings(derandomize=True, deadline=None, max_examples=40)


def mixed(*heads: bytes) -> st.SearchStrategy[bytes]:
    """Random bytes between heads and beginnings of frames."""
    return st.lists(st.binary(max_size=30) | st.sampled_from(heads), max_size=4).map(b"".join)


def sized(low: int, high: int, *heads: bytes) -> st.SearchStrategy[bytes]:
    """`low` to `high` bytes, with heads at any place."""
    parts = st.binary(max_size=12) | st.sampled_from([b"\0", *heads])
    return st.lists(parts, max_size=12).map(lambda parts: b"".join(parts)[:high].ljust(low, b"\1"))


@dataclass(frozen=True)
class Checked:
    """Frames of a family with a check byte.

    Attributes:
        parse: Parser of the frames that are expected.
        messages: Random messages.
        wild: Messages with heads of frames in their data.
        noise: Bytes that look like the beginning of a frame.
        good: A message with `lengths[-1]` in its length field.
        length_at: Place of the length field, which has two bytes.
        lengths: Values of the length field that are expected.
        stream: Whether frames may come unasked.
        checks: Whether a frame's check byte is right.
    """

    parse: Parser[Any]
    messages: st.SearchStrategy[Any]
    wild: st.SearchStrategy[Any]
    noise: st.SearchStrategy[bytes]
    good: Any
    length_at: int
    lengths: tuple[int, ...]
    stream: bool = True
    checks: Callable[[bytes], bool] = field(default=sums_to_zero)

    def decoder(self) -> FrameDecoder[Any]:
        return FrameDecoder(self.parse, self.stream)


# ---- control box

HEAD, TAIL = hexed("55AA7B7B"), hexed("55AA7D7D")
box_requests = st.builds(control_box.Request, BYTE, WORD, sized(0, 40, HEAD, TAIL, b"\x0e"), BYTE)
box_replies = st.builds(control_box.Reply, BYTE, WORD, sized(0, 40, HEAD, TAIL, b"\x0e"), BYTE, BYTE)
BOX = Checked(
    parse=control_box.reply_parser(range(65)),
    messages=box_replies,
    wild=box_replies,
    noise=mixed(HEAD, TAIL, HEAD + b"\x0e", hexed("55AA7B7B0E0070C00600 3C00")),
    good=control_box.Reply(*control_box.READ_REGISTERS, control_box.Region(1038, bytes(30)).encode()),
    length_at=10,
    lengths=tuple(range(65)),
    stream=False,
    checks=box_checks,
)

# ---- serial converter

CONVERTER_HEADS = b"\xaa\x55\x0d\x00\xaa\x55\x0a\x00\x03\x00\x79"
SIZES = (3, 20, 100)


def converter_reads(length: int, *heads: bytes) -> st.SearchStrategy[Any]:
    data = sized(length, length, *heads)
    status = st.sampled_from([0, 1, 7])
    read = st.just(serial_converter.READ)
    return st.builds(serial_converter.Reply, BYTE, read, ADDRESS, st.just(length), status, data)


written = st.sampled_from([0, 1, 6])
converter_replies = st.sampled_from(SIZES).flatmap(converter_reads) | st.builds(
    serial_converter.Reply, BYTE, st.just(serial_converter.WRITE), ADDRESS, st.integers(1, 16), written
)
converter_requests = st.builds(
    serial_converter.Request, BYTE, st.just(serial_converter.READ), ADDRESS, WORD
) | st.binary(min_size=1, max_size=16).flatmap(
    lambda data: st.builds(
        serial_converter.Request, BYTE, st.just(serial_converter.WRITE), ADDRESS, st.just(len(data)), st.just(data)
    )
)
CONVERTER = Checked(
    parse=serial_converter.reply_parser({0, *SIZES}),
    messages=converter_replies,
    wild=converter_reads(100, CONVERTER_HEADS),
    noise=mixed(b"\xaa", b"\x55", b"\xaa\x55", b"\x55\xaa", b"\xaa\x55\x0d\x00\x01\x00\xfb"),
    good=serial_converter.answer(serial_converter.read_request(1, 1008, 20), bytes(range(20))),
    length_at=2,
    lengths=(10, 13, 30, 110),
)

# ---- high-speed board

PUSHES = (0, 33, 90)
PUSH_HEADS = b"\xaa\x56\x00\x01\x00\xaa\x55\x00\x03\xaa\x56\x00\x22\x00"
pushes = st.sampled_from(PUSHES).flatmap(
    lambda size: st.builds(high_speed.Push, BYTE, st.binary(min_size=size, max_size=size))
)
answers = (
    st.builds(high_speed.Reply, st.just(high_speed.READ), WORD, st.binary(max_size=60))
    | st.builds(high_speed.Reply, st.sampled_from([high_speed.WRITE, high_speed.ZERO]), WORD, st.binary(max_size=2))
    | st.builds(high_speed.Reply, st.integers(0x81, 0xFF), WORD)
)
high_speed_requests = st.builds(high_speed.Request, st.just(high_speed.READ), WORD, st.integers(1, 512)) | st.binary(
    min_size=1, max_size=10
).flatmap(
    lambda data: st.builds(
        high_speed.Request,
        st.sampled_from([high_speed.WRITE, high_speed.ZERO]),
        WORD,
        st.just(len(data)),
        st.just(data),
    )
)


def high_speed_frames(parse: Parser[Any], messages: st.SearchStrategy[Any]) -> Checked:
    return Checked(
        parse=parse,
        messages=messages,
        wild=st.builds(high_speed.Push, st.just(0), sized(90, 90, PUSH_HEADS)),
        noise=mixed(b"\xaa", b"\x55", b"\x56", b"\xaa\x55\0", b"\xaa\x56\0", b"\xaa\x56\0\x5b\0\0"),
        good=high_speed.Push(0, bytes(range(90))),
        length_at=3,
        lengths=tuple(size + 1 for size in PUSHES),
    )


CHECKED = {
    "control-box": BOX,
    "serial-converter": CONVERTER,
    "high-speed, pushes": high_speed_frames(high_speed.push_parser(PUSHES), pushes),
    "high-speed, all": high_speed_frames(high_speed.incoming_parser(PUSHES), pushes | answers),
}

# ---- families without a check byte

TAGS = tuple(map(hexed, ("AAEE", "CCEE", "AAFF", "CCFF")))
blocks = st.builds(
    lambda data, state: hand_board.Block(data[:45], state, data[45:]), sized(47, 47, *TAGS), st.sampled_from([0, 1, 7])
)
rounds = st.builds(lambda *four: hand_board.Round(four), blocks, blocks, blocks, blocks)


def routine(number: int) -> xela_server.Routine:
    counts = np.random.default_rng(number).integers(0, 65536, (16, 3)).astype(np.float32)
    return xela_server.Routine(number, {3: xela_server.SensorReading("uSPa44", counts)})


def routine_values(message: xela_server.Routine) -> tuple[Any, ...]:
    return message.number, {key: reading.counts.tolist() for key, reading in message.sensors.items()}


def as_bytes(message: Any) -> bytes:
    return message.encode()


def itself(message: Any) -> Any:
    return message


def request_decoder(parse: Parser[Any]) -> Callable[[], Decoder[Any]]:
    return lambda: FrameDecoder(parse, stream=False)


SEEDS = st.integers(0, 2**32 - 1)
one_burst = st.builds(lambda seed: bursts(1, seed)[0], SEEDS)
as_text = magnetometer_board.Burst.encode_text
# decoder, messages, their bytes, what they are compared by, and the number of messages lost at the start
Plain = tuple[Callable[[], Decoder[Any]], st.SearchStrategy[Any], Callable[[Any], bytes], Callable[[Any], Any], int]
PLAIN: dict[str, Plain] = {
    **{name: (kind.decoder, kind.wild, as_bytes, itself, 0) for name, kind in CHECKED.items()},
    "hand-board": (hand_board.RoundDecoder, rounds, as_bytes, itself, 0),
    # only a line's end shows where a burst begins
    "magnetometer-board": (lambda: magnetometer_board.BurstDecoder(5), one_burst, as_bytes, as_bytes, 1),
    "magnetometer-board, text": (lambda: magnetometer_board.TextDecoder(5), one_burst, as_text, as_text, 1),
    "xela": (xela_server.RoutineDecoder, st.builds(routine, SEEDS), lambda m: m.encode(1.0), routine_values, 0),
}
REQUESTS: dict[str, Plain] = {
    "control-box, requests": (request_decoder(control_box.parse_request), box_requests, as_bytes, itself, 0),
    "converter, requests": (request_decoder(serial_converter.parse_request), converter_requests, as_bytes, itself, 0),
    "high-speed, requests": (request_decoder(high_speed.parse_request), high_speed_requests, as_bytes, itself, 0),
}


# ---- the contract of all families


@pytest.mark.parametrize("name", [*PLAIN, *REQUESTS])
@repeatable
@given(st.data())
def test_whole_frames_come_out_of_any_pieces(name, data):
    make, messages, encode, key, lost = (PLAIN | REQUESTS)[name]
    sent, decoder = data.draw(st.lists(messages, max_size=5)), make()
    found = decoded(decoder, b"".join(map(encode, sent)), data.draw(CUTS))
    assert [key(message) for message in found] == [key(message) for message in sent[lost:]]
    assert decoder.frames == len(found)
    assert decoder.skipped == sum(len(encode(message)) for message in sent[:lost])
    assert (decoder.bad_checksums, decoder.pending) == (0, 0)


@pytest.mark.parametrize("name", PLAIN)
@repeatable
@given(st.data())
def test_the_pieces_change_nothing_in_what_is_found_among_garbage(name, data):
    make, messages, encode, key, _ = PLAIN[name]
    noise = CHECKED[name].noise if name in CHECKED else st.binary(max_size=60)
    stream = b"".join(data.draw(st.lists(messages.map(encode) | noise, max_size=6)))
    outcomes = []
    for sizes in ((), data.draw(CUTS), [1] * len(stream)):
        decoder = make()
        found = [key(message) for message in decoded(decoder, stream, sizes)]
        outcomes.append((found, decoder.skipped, decoder.bad_checksums))
    assert outcomes[0] == outcomes[1] == outcomes[2]


GARBAGE = {
    "random": random.Random(1).randbytes(10_000),
    "halves": b"\xaa" * 10_000,
    "heads": b"\xaa\x55" * 5_000,
    "tags": b"\xaa\xee" * 5_000,
    "headers": hexed("55AA7B7B0E0070C006003C00 AA556E000100FB000000006400 AA56005B0000") * 300,
    "text": b"1" * 10_000,
}
MOST_HELD = {
    "control-box": 90,
    "hand-board": hand_board.DECISION_BYTES,
    "magnetometer-board": 2 * 82,
    "magnetometer-board, text": 240,
    "xela": xela_server.MAX_MESSAGE_BYTES,
}


@pytest.mark.parametrize("name", PLAIN)
def test_garbage_is_held_back_no_longer_than_the_longest_frame_and_read_in_little_time(name):
    most = MOST_HELD.get(name, 115)
    for kind, garbage in GARBAGE.items():
        for size in (1, 64, len(garbage)):
            decoder, held, start = PLAIN[name][0](), 0, time.process_time()
            for at in range(0, len(garbage), size):
                decoder.feed(garbage[at : at + size])
                held = max(held, decoder.pending)
            decoder.flush()
            assert time.process_time() - start < 5, (kind, size)
            assert held <= most, (kind, size)
            assert decoder.pending == 0


# ---- the contract of the families with a check byte


def check_nothing_lost(kind, frames, noise):
    """Check that each of `frames` is found between pieces of `noise`, unless noise forms a valid frame around it."""
    stream, spans = b"", set()
    for piece, frame in zip(noise, [*frames, b""], strict=True):
        stream += piece
        if frame:
            spans.add((len(stream), len(stream) + len(frame)))
        stream += frame
    found = accepted(kind.parse, stream, kind.stream)
    foreign = set(found) - spans
    assert all(kind.checks(stream[start:end]) for start, end in foreign)
    for start, end in spans - set(found):
        assert any(a < end and start < b for a, b in foreign), f"lost the frame at {start}"


@pytest.mark.parametrize("name", CHECKED)
@repeatable
@given(st.data())
def test_garbage_hides_no_frame_and_a_truncated_one_does_not_take_the_next_with_it(name, data):
    kind = CHECKED[name]
    pairs = data.draw(st.lists(st.tuples(kind.messages, kind.noise), max_size=4))
    check_nothing_lost(kind, [m.encode() for m, _ in pairs], [*(noise for _, noise in pairs), data.draw(kind.noise)])
    first, second = data.draw(kind.messages).encode(), data.draw(kind.messages).encode()
    check_nothing_lost(kind, [second], [first[: data.draw(st.integers(0, len(first) - 1))], b""])


@pytest.mark.parametrize("name", CHECKED)
def test_a_damaged_length_delays_nothing(name):
    kind = CHECKED[name]
    good, at = kind.good.encode(), kind.length_at
    for length in set(range(0, 65536, 31)) - set(kind.lengths):
        damaged = good[:at] + length.to_bytes(2, "little") + good[at + 2 :]
        assert kind.good in kind.decoder().feed(damaged + good), length
