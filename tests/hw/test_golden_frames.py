"""Frames of the four PaXini families as their documents print them, in both directions, and what is no frame."""

import random
import re

import numpy as np
import pytest
from byte_streams import hexed, parsed, sums_to_zero

from paxisim import InvalidValueError
from paxisim.hw.families.control_box import wire as box
from paxisim.hw.families.errors import CONTROL_BOX, SERIAL_CONVERTER, error_name
from paxisim.hw.families.hand_board import wire as hand_board
from paxisim.hw.families.high_speed import wire as high_speed
from paxisim.hw.families.high_speed.stream_layout import active_bitmap, active_modules
from paxisim.hw.families.serial_converter import wire as converter
from paxisim.hw.families.taxels import to_bytes, to_counts
from paxisim.hw.link.recognise import describe

# example frames from the vendor's documents, and frames derived from them
GOLDEN = {
    box.parse_request: {
        "55AA7B7B 0E0060A0010000 F1 55AA7D7D": box.version_request(),
        "55AA7B7B 0E0070C00C0100 01B4 55AA7D7D": box.set_mode_request(1),
        "55AA7B7B 0E0070C00C0100 02B3 55AA7D7D": box.set_mode_request(2),
        "55AA7B7B 0E0070C00C0100 05B0 55AA7D7D": box.set_mode_request(5),
        "55AA7B7B 0E0070C00D0000 B5 55AA7D7D": box.get_mode_request(),
        "55AA7B7B 0E0070B10A0100 00C6 55AA7D7D": box.select_port_request(0),
        "55AA7B7B 0E0070B10A0100 02C4 55AA7D7D": box.select_port_request(2),
        "55AA7B7B 0E0070C0060500 7B0E041E00 0C 55AA7D7D": box.read_request(1038, 30),
        "55AA7B7B 0E0070B0020200 0301 CA 55AA7D7D": box.write_request(3, 1),
        "55AA7B7B 0E0070C0060500 7B0E046801 C1 55AA7D7D": box.read_request(1038, 360),
        "55AA7B7B 0E0070C0060500 7BF0038601 C2 55AA7D7D": box.read_request(1008, 390),
    },
    box.parse_reply: {
        "55AA7B7B 0E0070B10A000000 C7 55AA7D7D": box.Reply(0x70, 0xB10A),
        "55AA7B7B 0E0070C006000900 007B0E040300 05FB2A F9 55AA7D7D": box.Reply(
            0x70, 0xC006, box.Region(1038, hexed("05FB2A")).encode()
        ),
    },
    converter.parse_request: {
        "55AA09000100FBF0030000030006": converter.read_request(1, 1008, 3),
        "55AA0A000100790300000001000178": converter.zero_request(1),
        "55AA0A000300790300000001000176": converter.zero_request(3),
        "55AA09000100FB0E040000E70003": converter.read_request(1, 1038, 231),
        "55AA09000000FBD41700006400AE": converter.version_request(0),
        "55AA09000300FBF00300007B008C": converter.read_request(3, 1008, 123),
    },
    converter.parse_reply: {
        "AA550A000300790300000001000077": converter.Reply(3, converter.WRITE, 3, 1),
        "AA550D000100FBF00300000300000AFE1FDB": converter.Reply(1, converter.READ, 1008, 3, 0, bytes([10, 254, 31])),
    },
    high_speed.parse_request: {
        "55AA000300000F00EF": high_speed.version_request(),
        "55AA00101700010001D8": high_speed.push_request(True),
        "55AA00101700010000D9": high_speed.push_request(False),
        "55AA00170200010001E6": high_speed.zero_request(),
    },
    high_speed.parse_reply: {
        "AA55000334120200414233": high_speed.Reply(high_speed.READ, 0x1234, b"AB"),
        "AA5500833412000038": high_speed.Reply(0x83, 0x1234),
    },
    high_speed.parse_push: {
        "AA560003000058594C": high_speed.Push(0, b"XY"),
        "AA5600010007F8": high_speed.Push(7),
    },
}
GOLDEN[high_speed.parse_incoming] = GOLDEN[high_speed.parse_reply] | GOLDEN[high_speed.parse_push]


@pytest.mark.parametrize("parse", GOLDEN)
def test_frames_are_the_documents_bytes_in_both_directions(parse):
    for text, message in GOLDEN[parse].items():
        assert message.encode() == hexed(text)
        assert parsed(parse, hexed(text)) == [message], text


def test_a_round_of_the_hand_board_as_bytes():
    tags = ("AAEE", "CCEE", "AAFF", "CCFF")
    taxels = [bytes(range(first, first + 45)) for first in (0, 45, 90, 135)]
    states, rests = (1, 0, 1, 7), (b"ab", b"cd", b"ef", b"gh")
    one = hand_board.Round(tuple(hand_board.Block(taxels[i], states[i], rests[i]) for i in range(4)))
    expected = b"".join(hexed(tags[i]) + bytes([states[i]]) + taxels[i] + rests[i] for i in range(4))
    assert len(expected) == 200
    assert one.encode() == expected
    assert hand_board.RoundDecoder().feed(expected) == [one]


def test_errors_are_told_by_number_and_name():
    assert high_speed.Reply(0x83, 0x1234).error == 3
    assert high_speed.Push(7).error == 7
    assert high_speed.Reply(high_speed.READ, 0x1234, b"AB").error == high_speed.Push(0, b"XY").error == 0
    for table in (CONTROL_BOX, SERIAL_CONVERTER):
        assert error_name(7, table) == "error 0x07 (no data)"
        assert error_name(0x63, table) == "error 0x63 (unknown)"


# ---- what a frame contains


def test_taxels_in_a_region_wrap_no_sign():
    (reply,) = parsed(box.parse_reply, hexed(list(GOLDEN[box.parse_reply])[1]))
    region = box.parse_region(reply.data)
    assert region == box.Region(1038, hexed("05FB2A"))
    np.testing.assert_array_equal(to_counts(region.payload), [[5, -5, 42]])
    counts = np.array([[-128, 127, 255], [0, -1, 128]])
    np.testing.assert_array_equal(to_counts(to_bytes(counts)), counts)
    np.testing.assert_array_equal(to_counts(to_bytes(counts), signed_normal=True)[:, 2], [-1, -128])


def test_what_is_no_region():
    for data in ("", "00", "007B0E0403", "007C0E0400 00", "007B0E040300 05FB", "007B0E040100 05FB"):
        assert box.parse_region(hexed(data)) is None, data


def test_modules_of_the_bitmap_both_ways():
    assert active_modules(hexed("05000000")) == (0, 2)
    assert active_modules(hexed("000000F8")) == (27,)  # bits beyond module 27 are ignored
    assert active_modules(hexed("00800110")) == (15, 16)
    assert active_bitmap((0, 2, 27)) == hexed("05000008")
    for modules in [(), (27,), tuple(range(28))]:
        assert active_modules(active_bitmap(modules)) == modules


# ---- what must not be sent


BLOCK = hand_board.Block(bytes(45))
READ, WRITE, ZERO = high_speed.READ, high_speed.WRITE, high_speed.ZERO


@pytest.mark.parametrize(
    ("message", "says"),
    [
        (box.Reply(0x70, 0xC006, bytes(65536)), "65535"),
        (converter.Request(1, converter.READ, 0, 1, b"\0"), "data"),
        (converter.Request(1, converter.WRITE, 0, 2, b"\0"), "data"),
        (converter.Request(1, converter.WRITE, 0, 17, bytes(17)), "data"),
        (high_speed.Request(READ, 0, 0), "count"),
        (high_speed.Request(READ, 0, 513), "count"),
        (high_speed.Request(READ, 0, 1, b"\0"), "data"),
        (high_speed.Request(WRITE, 0, 11, bytes(11)), r"count|data"),
        (high_speed.Request(WRITE, 0, 2, b"\0"), r"count|data"),
        (high_speed.Request(WRITE, 0, 0), r"count|data"),
        (hand_board.Round((BLOCK, BLOCK, hand_board.Block(bytes(44)), BLOCK)), "block 2"),
        (hand_board.Round((BLOCK,)), "4 blocks"),
    ],
)
def test_what_a_board_does_not_take_is_not_encoded(message, says):
    with pytest.raises(InvalidValueError, match=says):
        message.encode()


def check_functions(frame, at, known, parse, make, says):
    """Check that no function but the known ones can be sent or is recognised; `at` is its place in `frame`."""
    for function in set(range(256)) - known:
        with pytest.raises(InvalidValueError, match=says):
            make(function).encode()
        data = bytearray(frame.encode())
        data[at], data[-1] = function, data[-1] + data[at] - function & 0xFF
        assert sums_to_zero(data)
        assert parsed(parse, bytes(data)) == [], function


def test_no_other_function_leaves_the_house_or_is_recognised():
    known = {converter.READ, converter.WRITE}
    make = lambda function: converter.Request(1, function, 0, 1, b"\0")  # noqa: E731
    check_functions(converter.zero_request(1), 6, known, converter.parse_request, make, "firmware")
    make = lambda function: high_speed.Request(function, 0, 1, b"\0")  # noqa: E731
    check_functions(high_speed.push_request(True), 3, {READ, WRITE, ZERO}, high_speed.parse_request, make, "function")


def test_the_longest_reply_of_a_converter_can_be_said():
    longest = converter.MAX_READ_REQUEST
    reply = converter.answer(converter.Request(255, converter.READ, 0, longest), bytes(longest))
    assert parsed(converter.reply_parser({longest}), reply.encode()) == [reply]


# ---- recognising the family that is connected


@pytest.mark.parametrize(
    ("stream", "words"),
    [
        (b"", "nothing arrived"),
        (box.Reply(0x70, 0xB10A).encode() * 3 + b"\1\2", "3 replies of the family 'control-box'.*51 of 53 bytes"),
        (box.version_request().encode() * 2, r"own requests.*control-box"),
        (hexed("AA550D000100FBF00300000300000AFE1FDB") * 2, "2 replies of the family 'serial-converter'"),
        (hexed("55AA09000100FBF0030000030006"), r"own requests.*serial-converter"),
        (hexed("AA55000334120200414233"), "1 replies of the family 'high-speed'"),
        (hexed("AA560003000058594C") * 4, "4 pushes of the family 'high-speed'"),
        (hexed("55AA00101700010001D8"), r"own requests.*high-speed"),
        (
            hand_board.Round((BLOCK,) * 4).encode() * 3 + b"\1",
            r"^3 rounds of the family 'hand-board', an older GEN1 hand board \(in 600 of 601 bytes\)$",
        ),
        (random.Random(4).randbytes(5000), "4096 bytes that fit no family, as with a wrong baud rate"),
        (b"\1\2", "2 bytes that fit no family.*: 01 02$"),
        (b'{"hello": 1}\n', r"^text of no family: '\{\"hello\": 1\}\\n'$"),
    ],
)
def test_what_arrives_is_recognised(stream, words):
    assert re.search(words, describe(stream)), describe(stream)
