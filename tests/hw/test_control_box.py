"""The GEN1 / GEN2 control box: its frames as bytes, and the driver over a pseudo-terminal."""

import functools
import random
import re
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paxisim.errors import DeviceTimeoutError, InvalidValueError, ProtocolError
from paxisim.hw.families.control_box import wire as wire
from paxisim.hw.families.control_box.driver import ControlBox
from paxisim.hw.families.control_box.wire import Region, Reply, Request, parse_reply, parse_request, reply_parser
from paxisim.hw.families.errors import CONTROL_BOX, error_name
from paxisim.hw.families.taxels import to_bytes, to_counts
from paxisim.hw.link.clock import SystemClock
from paxisim.hw.link.framing import FrameDecoder
from paxisim.hw.link.recognise import describe
from paxisim.hw.link.transport import Transport, open_transport

pytest.importorskip("pty", reason="no pseudo-terminals here")

import gen3_peer
from gen3_peer import Peer, count_calls, cuts, hexed, joined, make_profile, repeatable

# request and reply alternate, so the decoder does not wait for the bytes that follow a message
decode = functools.partial(gen3_peer.decode, stream=False)
accepted = functools.partial(gen3_peer.accepted, stream=False)

HEAD, TAIL = hexed("55AA7B7B"), hexed("55AA7D7D")
byte = st.integers(0, 255)
numbers = st.integers(0, 0xFFFF)
data = st.binary(max_size=40) | st.lists(st.sampled_from([HEAD, TAIL, b"\x0e", b"\0"]), max_size=8).map(b"".join)
requests = st.builds(Request, byte, numbers, data, byte)
replies = st.builds(Reply, byte, numbers, data, byte, byte)
# misleading bytes: heads, tails, and headers that announce more data than follows
misleading = st.lists(
    st.binary(max_size=20) | st.sampled_from([HEAD, TAIL, HEAD + b"\x0e", hexed("55AA7B7B0E0070C00600 3C00")]),
    max_size=5,
).map(b"".join)
SHORT = reply_parser(range(65))


# example frames from the vendor's document, and frames derived from them

REQUESTS = {
    "55AA7B7B 0E0060A0010000 F1 55AA7D7D": wire.version_request(),
    "55AA7B7B 0E0070C00C0100 01B4 55AA7D7D": wire.set_mode_request(1),
    "55AA7B7B 0E0070C00C0100 02B3 55AA7D7D": wire.set_mode_request(2),
    "55AA7B7B 0E0070C00C0100 05B0 55AA7D7D": wire.set_mode_request(5),
    "55AA7B7B 0E0070C00D0000 B5 55AA7D7D": wire.get_mode_request(),
    "55AA7B7B 0E0070B10A0100 00C6 55AA7D7D": wire.select_port_request(0),
    "55AA7B7B 0E0070B10A0100 01C5 55AA7D7D": wire.select_port_request(1),
    "55AA7B7B 0E0070B10A0100 02C4 55AA7D7D": wire.select_port_request(2),
    "55AA7B7B 0E0070C0060500 7B0E041E00 0C 55AA7D7D": wire.read_request(1038, 30),
    "55AA7B7B 0E0070B0020200 0301 CA 55AA7D7D": wire.write_request(3, 1),
    "55AA7B7B 0E0070C0060500 7B0E046801 C1 55AA7D7D": wire.read_request(1038, 360),
    "55AA7B7B 0E0070C0060500 7BF0038601 C2 55AA7D7D": wire.read_request(1008, 390),
}
REPLIES = {
    "55AA7B7B 0E0070B10A000000 C7 55AA7D7D": Reply(0x70, 0xB10A),
    "55AA7B7B 0E0070C006000900 007B0E040300 05FB2A F9 55AA7D7D": Reply(
        0x70, 0xC006, Region(1038, hexed("05FB2A")).encode()
    ),
}


@pytest.mark.parametrize("frame", REQUESTS)
def test_requests_are_the_documents_bytes(frame):
    assert REQUESTS[frame].encode() == hexed(frame)
    assert decode(parse_request, hexed(frame))[0] == [REQUESTS[frame]]


@pytest.mark.parametrize("frame", REPLIES)
def test_replies_as_bytes(frame):
    assert REPLIES[frame].encode() == hexed(frame)
    assert decode(parse_reply, hexed(frame))[0] == [REPLIES[frame]]


def test_one_taxel():
    reply = decode(parse_reply, hexed(list(REPLIES)[1]))[0][0]
    region = wire.parse_region(reply.data)
    assert region is not None
    assert region == Region(1038, hexed("05FB2A"))
    np.testing.assert_array_equal(to_counts(region.payload), [[5, -5, 42]])


@pytest.mark.parametrize("data", ["", "00", "007B0E0403", "007C0E0400 00", "007B0E040300 05FB", "007B0E040100 05FB"])
def test_what_is_no_region(data):
    assert wire.parse_region(hexed(data)) is None


def test_taxels_wrap_no_sign():
    counts = np.array([[-128, 127, 255], [0, -1, 128]])
    np.testing.assert_array_equal(to_counts(to_bytes(counts)), counts)
    np.testing.assert_array_equal(to_counts(to_bytes(counts), signed_normal=True)[:, 2], [-1, -128])


def test_errors_have_names():
    assert error_name(7, CONTROL_BOX) == "error 0x07 (no data)"
    assert error_name(0x63, CONTROL_BOX) == "error 0x63 (unknown)"


def test_data_too_long_to_encode():
    with pytest.raises(InvalidValueError, match="65535"):
        Reply(0x70, 0xC006, bytes(65536)).encode()


# arbitrary bytes in arbitrary pieces


def checks(frame):
    """Whether head, tail and check byte are right by their definition, independent of the code under test."""
    return frame.startswith(HEAD) and frame.endswith(TAIL) and sum(frame[4:-4]) % 256 == 0


def check_nothing_lost(frames, noise, parse=SHORT):
    """Check that each of `frames` is found between pieces of `noise`, unless noise forms a valid frame around it."""
    chunks = [chunk for pair in zip(noise, [*frames, b""], strict=True) for chunk in pair]
    stream, spans = joined(chunks)
    sent = {span for span, index in spans.items() if index % 2 and span[0] < span[1]}
    found = accepted(parse, stream)
    foreign = set(found) - sent
    assert all(checks(stream[start:end]) for start, end in foreign)
    for start, end in sent - set(found):
        assert any(a < end and start < b for a, b in foreign), f"lost the frame at {start}"


@repeatable
@given(st.lists(requests, max_size=4), cuts)
def test_requests_survive_any_chunking(sent, sizes):
    found, decoder = decode(parse_request, b"".join(request.encode() for request in sent), sizes)
    assert found == sent
    assert decoder.skipped == decoder.bad_checksums == 0


@repeatable
@given(st.lists(replies | misleading, max_size=6), cuts)
def test_chunking_changes_nothing(parts, sizes):
    stream = b"".join(part if isinstance(part, bytes) else part.encode() for part in parts)
    whole, at_once = decode(SHORT, stream)
    found, decoder = decode(SHORT, stream, sizes)
    assert found == whole
    assert (decoder.skipped, decoder.bad_checksums) == (at_once.skipped, at_once.bad_checksums)


@repeatable
@given(st.lists(replies, max_size=4))
def test_whole_replies_need_no_flush(sent):
    assert FrameDecoder(SHORT, stream=False).feed(b"".join(reply.encode() for reply in sent)) == sent


@repeatable
@given(st.lists(st.tuples(replies, misleading), max_size=4), misleading)
def test_garbage_hides_no_reply(pairs, last):
    check_nothing_lost([reply.encode() for reply, _ in pairs], [*(noise for _, noise in pairs), last])


@repeatable
@given(replies, replies, st.data())
def test_a_truncated_reply_does_not_take_the_next_with_it(first, second, choose):
    cut = choose.draw(st.integers(0, len(first.encode()) - 1))
    check_nothing_lost([second.encode()], [first.encode()[:cut], b""])


@repeatable
@given(
    st.lists(replies, min_size=1, max_size=3), st.lists(st.tuples(st.integers(0, 200), byte), min_size=1, max_size=5)
)
def test_a_damaged_reply_is_accepted_only_where_its_check_byte_collides(sent, damage):
    stream = bytearray(b"".join(reply.encode() for reply in sent))
    for at, value in damage:
        stream[at % len(stream)] = value
    for (start, end), message in accepted(SHORT, bytes(stream)).items():
        assert message in sent or checks(bytes(stream[start:end]))


@repeatable
@given(st.binary(max_size=40), st.data())
def test_one_wrong_byte_is_noticed(content, choose):
    # no tail inside the data, so a damaged LEN cannot end at a second tail
    frame = bytearray(Reply(0x70, 0xC006, content.replace(TAIL[:2], b"")).encode())
    at = choose.draw(st.integers(0, len(frame) - 1))
    frame[at] = choose.draw(byte.filter(lambda value: value != frame[at]))
    assert decode(SHORT, bytes(frame))[0] == []


def test_a_damaged_length_delays_nothing():
    good = Reply(*wire.READ_REGISTERS, Region(1038, bytes(30)).encode()).encode()
    expected = {0, 1, 36}
    for length in set(range(0, 65536, 7)) - expected:
        decoder = FrameDecoder(reply_parser(expected))
        assert len(decoder.feed(good[:10] + length.to_bytes(2, "little") + good[12:] + good)) == 1


@pytest.mark.parametrize("size", [1, 64, 100_000])
@pytest.mark.parametrize(
    "garbage",
    [
        random.Random(1).randbytes(100_000),
        HEAD * 25_000,
        hexed("55AA7B7B0E0070C006000004") * 8_400,
        b"\x55" * 100_000,
    ],
    ids=["random", "heads", "headers", "beginnings"],
)
def test_garbage_costs_one_look_a_byte_and_a_piece(garbage, size):
    longest = wire.MAX_REPLY_DATA + wire.REPLY_OVERHEAD
    calls, held = count_calls(parse_reply, garbage, size)
    assert calls <= len(garbage) + -(-len(garbage) // size) + longest
    assert held < longest


# the driver against a scripted box

TAXELS = 20
PADS = {
    2: np.array([[i - 4, 4 - i, 12 * i] for i in range(TAXELS)], dtype=np.int16),
    5: np.array([[-i, i, 255 - i] for i in range(TAXELS)], dtype=np.int16),
}
TOTALS = {2: [[-7, 8, 200]], 5: [[1, -2, 3]]}


class Box:
    """A scripted box; `change` can replace the bytes of a reply."""

    def __init__(self, change=lambda request, reply: reply.encode(), taxels=TAXELS, mode=5, slow=0):
        self.change, self.taxels, self.mode, self.slow = change, taxels, mode, slow
        self.wanted, self.port = b"\xff", -1
        self.zeroed = []

    def __call__(self, request):
        return self.change(request, self.reply(request))

    def reply(self, request):
        kind = (request.main, request.sub)
        if kind == wire.GET_VERSION:
            return Reply(*kind, b"BOX V1.5\0")
        if kind == wire.SET_MODE:
            self.wanted = request.data
            return Reply(0x70, 0xC009)
        if kind == wire.GET_MODE:
            self.slow -= 1
            return Reply(*kind, b"\0" if self.slow >= 0 else self.wanted)
        if kind == wire.SELECT_PORT:
            self.port = request.data[0]
            return Reply(*kind)
        if kind == wire.WRITE_REGISTERS:
            self.zeroed.append((self.port, request.data))
            return Reply(*kind, b"\6", 6)
        if self.wanted != bytes([self.mode]) or self.port not in PADS:
            return Reply(*kind, b"", 7)
        address, count = (int.from_bytes(request.data[i : i + 2], "little") for i in (1, 3))
        memory = to_bytes(np.array(TOTALS[self.port])) + bytes(27) + to_bytes(PADS[self.port][: self.taxels])
        return Reply(*kind, Region(address, memory[address - 1008 :][:count]).encode())


class Conversation:
    """Context manager: the driver on a pseudo-terminal with a scripted box at its other end."""

    def __init__(self, box, slots=None, taxels=TAXELS, idle=None, **options):
        pytest.importorskip("serial")
        self.profile = make_profile("control-box", taxels, slots or {"left": 2, "right": 5}, mode=5, **options)
        self.peer = Peer(parse_request, box, idle)

    def __enter__(self):
        self.peer.__enter__()
        self.transport = open_transport(self.peer.port, 460800)
        self.board = ControlBox(self.transport, self.profile, SystemClock())
        return self.board

    def __exit__(self, *error):
        self.transport.close()
        self.peer.__exit__(*error)


def check(reading, status=(0, 0)):
    np.testing.assert_array_equal(reading.counts, np.stack([PADS[2], PADS[5]]))
    assert reading.counts.dtype == np.int16
    assert reading.status == status


def test_power_up_and_readings():
    box = Box(slow=3)
    talk = Conversation(box)
    with talk as board:
        board.start()
        first, second = board.read(20), board.read(20)
        assert board.version() == "BOX V1.5"
        assert (board.skipped, board.bad_checksums) == (0, 0)
    check(first)
    check(second)
    assert second.time > first.time
    assert first.resultant is None
    kinds = [(request.main, request.sub) for request in talk.peer.requests]
    assert kinds[:2] == [wire.GET_VERSION, wire.SET_MODE]
    assert set(kinds[2:6]) == {wire.GET_MODE}
    assert kinds[6:10] == [wire.SELECT_PORT, wire.READ_REGISTERS] * 2


def test_the_resultant_comes_in_the_same_request():
    with Conversation(Box(), resultant_address=1008) as board:
        board.start()
        reading = board.read(20)
    check(reading)
    assert reading.resultant is not None
    np.testing.assert_array_equal(reading.resultant, np.concatenate([TOTALS[2], TOTALS[5]]))


def test_zeroing_succeeds_with_error_6_on_every_port():
    box = Box()
    with Conversation(box) as board:
        board.start()
        board.zero()
    assert box.zeroed == [(2, b"\3\1"), (5, b"\3\1")]


def test_zeroing_refused():
    def change(request, reply):
        return Reply(reply.main, reply.sub, b"", 0x11).encode() if reply.sub == 0xB002 else reply.encode()

    with Conversation(Box(change)) as board:
        board.start()
        with pytest.raises(ProtocolError, match=r"port 2 \(left\) refuses zeroing: error 0x11 \(execute\)"):
            board.zero()


def test_lost_split_late_and_damaged_replies_are_asked_for_again():
    number = iter(range(10**6))
    late = []

    def change(request, reply):
        frame = reply.encode()
        kind = next(number) % 11
        if kind == 1:
            return b""
        if kind == 2:
            return frame[:9] + frame[10:]
        if kind == 3:
            return bytes([*frame[:8], frame[8] ^ 1, *frame[9:]])
        if kind == 4:
            return b"\xff\x55\xaa" + frame + b"\x55\xaa\x7b"
        if kind in (5, 8):  # arrives together with the answer to the next request
            late.append(frame)
            return b""
        answers = b"".join(late) + frame
        late.clear()
        return answers

    with Conversation(Box(change)) as board:
        board.start()
        for _ in range(15):
            check(board.read(20))
        assert board.bad_checksums
        assert board.skipped


def test_a_reading_of_another_region_is_not_taken():
    stranger = Reply(*wire.READ_REGISTERS, Region(1008, bytes(3 * TAXELS)).encode()).encode()
    shorter = Reply(*wire.READ_REGISTERS, Region(1038, bytes(30)).encode()).encode()

    def change(request, reply):
        return (stranger + shorter if reply.sub == 0xC006 else b"") + reply.encode()

    with Conversation(Box(change)) as board:
        board.start()
        check(board.read(20))


def test_the_boxs_status_is_passed_on():
    def change(request, reply):
        if reply.sub != 0xC006:
            return reply.encode()
        return Reply(reply.main, reply.sub, b"\x0d" + reply.data[1:]).encode()

    with Conversation(Box(change)) as board:
        board.start()
        check(board.read(20), status=(0x0D, 0x0D))


def test_a_pad_that_fails_later_does_not_silence_the_others():
    box = Box()
    failing = []

    def change(request, reply):
        return (Reply(*wire.READ_REGISTERS, b"", 7) if reply.sub == 0xC006 and box.port in failing else reply).encode()

    box.change = change
    with Conversation(box) as board:
        board.start()
        failing.append(5)
        reading = board.read(20)
        assert reading.status == (0, 7)
        np.testing.assert_array_equal(reading.counts, np.stack([PADS[2], np.zeros_like(PADS[5])]))
        failing.append(2)
        with pytest.raises(ProtocolError, match=r"2 \(left\): error 0x07 \(no data\)"):
            board.read(20)


def test_a_port_without_a_pad_is_named():
    with (
        Conversation(Box(), slots={"left": 2, "right": 3}) as board,
        pytest.raises(ProtocolError, match=r"3 \(right\)"),
    ):
        board.start()


def test_another_number_of_taxels_is_named():
    # the box sends its 20 taxels regardless of the number requested
    with Conversation(Box(), taxels=24) as board, pytest.raises(ProtocolError, match=r"72 bytes for 24 .* 60"):
        board.start()


def test_a_mode_that_is_not_taken():
    with Conversation(Box(slow=10**6)) as board, pytest.raises(ProtocolError, match="mode 5"):
        board.start()


def test_silence():
    with Conversation(lambda request: b"") as board, pytest.raises(DeviceTimeoutError, match="nothing came"):
        board.start()


def test_a_box_that_falls_silent():
    box = Box(lambda request, reply: b"" if reply.sub == 0xC006 else reply.encode())
    with Conversation(box) as board:
        with pytest.raises(DeviceTimeoutError, match=r"reading port 2 \(left\)"):
            board.start()
        with pytest.raises(DeviceTimeoutError, match=r"within 0\.2 s"):
            board.read(0.2)


def test_bytes_that_fit_no_family():
    noise = random.Random(5).randbytes(300)
    with Conversation(lambda request: noise) as board, pytest.raises(ProtocolError, match="wrong baud rate"):
        board.start()


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"resultant_address": 1038}, "address"),
        ({"address": 70000}, "address"),
        ({"slots": {"a": 256}}, "slots"),
    ],
)
def test_profiles_that_no_box_can_have(options, match):
    slots = options.pop("slots", {"a": 0})
    profile = make_profile("control-box", TAXELS, slots, **options)
    with pytest.raises(InvalidValueError, match=match):
        ControlBox(cast(Transport, None), profile, SystemClock())


# recognising the family that is connected


@pytest.mark.parametrize(
    ("stream", "words"),
    [
        (b"", "nothing arrived"),
        (Reply(0x70, 0xB10A).encode() * 3 + b"\1\2", "3 replies of the family 'control-box'.*51 of 53 bytes"),
        (wire.version_request().encode() * 2, r"own requests.*control-box"),
        (hexed("AA550D000100FBF00300000300000AFE1FDB") * 2, "2 replies of the family 'serial-converter'"),
        (hexed("55AA09000100FBF0030000030006"), r"own requests.*serial-converter"),
        (hexed("AA55000334120200414233"), "1 replies of the family 'high-speed'"),
        (hexed("AA560003000058594C") * 4, "4 pushes of the family 'high-speed'"),
        (hexed("55AA00101700010001D8"), r"own requests.*high-speed"),
        (random.Random(4).randbytes(5000), "4096 bytes that fit no family, as with a wrong baud rate"),
        (b"\1\2", "2 bytes that fit no family.*: 01 02$"),
    ],
)
def test_what_arrives_is_recognised(stream, words):
    assert re.search(words, describe(stream)), describe(stream)
