"""The GEN3 serial converter: its frames in both directions, and the driver over a pseudo-terminal."""

import random

import numpy as np
import pytest
from gen3_peer import (
    Peer,
    accepted,
    check_nothing_lost,
    count_calls,
    cuts,
    decode,
    hexed,
    make_profile,
    repeatable,
    sums_to_zero,
)
from hypothesis import given
from hypothesis import strategies as st

from paxisim.errors import DeviceTimeoutError, InvalidValueError, ProtocolError
from paxisim.hw.families.errors import SERIAL_CONVERTER, error_name
from paxisim.hw.families.serial_converter import wire as frames
from paxisim.hw.families.serial_converter.driver import SerialConverter
from paxisim.hw.families.serial_converter.wire import READ, WRITE, Reply, Request, answer
from paxisim.hw.families.taxels import to_bytes
from paxisim.hw.link.clock import SystemClock
from paxisim.hw.link.framing import FrameDecoder
from paxisim.hw.link.transport import open_transport

REQUESTS = {
    "55AA09000100FBF0030000030006": frames.read_request(1, 1008, 3),
    "55AA0A000100790300000001000178": frames.zero_request(1),
    "55AA0A000300790300000001000176": frames.zero_request(3),
    "55AA09000100FB0E040000E70003": frames.read_request(1, 1038, 231),
    "55AA09000000FBD41700006400AE": frames.version_request(0),
    "55AA09000300FBF00300007B008C": frames.read_request(3, 1008, 123),
}
REPLIES = {
    "AA550A000300790300000001000077": Reply(3, WRITE, 3, 1),
    "AA550D000100FBF00300000300000AFE1FDB": Reply(1, READ, 1008, 3, 0, bytes([10, 254, 31])),
}
HEADS = b"\xaa\x55\x0d\x00\xaa\x55\x0a\x00\x03\x00\x79"
LENGTHS = {0, 3, 20, 100}
parse = frames.reply_parser(LENGTHS)

byte = st.integers(0, 255)
addresses = st.integers(0, 2**32 - 1)


def read_replies(length):
    status = st.sampled_from([0, 1, 7])
    data = st.binary(min_size=length, max_size=length)
    return st.builds(Reply, byte, st.just(READ), addresses, st.just(length), status, data)


replies = st.sampled_from(sorted(LENGTHS - {0})).flatmap(read_replies) | st.builds(
    Reply, byte, st.just(WRITE), addresses, st.integers(1, 16), st.sampled_from([0, 1, 6])
)
requests = st.builds(Request, byte, st.just(READ), addresses, st.integers(0, 65535)) | st.binary(
    min_size=1, max_size=16
).flatmap(lambda data: st.builds(Request, byte, st.just(WRITE), addresses, st.just(len(data)), st.just(data)))
# misleading bytes: heads, beginnings of frames, and random bytes
misleading = st.lists(
    st.sampled_from([b"\xaa", b"\x55", b"\xaa\x55", b"\x55\xaa", b"\xaa\x55\x0d\x00\x01\x00\xfb"])
    | replies.map(lambda reply: reply.encode()[:-4])
    | st.binary(max_size=30),
    max_size=4,
).map(b"".join)


@pytest.mark.parametrize("frame", REQUESTS)
def test_golden_requests_both_ways(frame):
    assert REQUESTS[frame].encode() == hexed(frame)
    assert decode(frames.parse_request, hexed(frame))[0] == [REQUESTS[frame]]


@pytest.mark.parametrize("frame", REPLIES)
def test_golden_replies_both_ways(frame):
    assert REPLIES[frame].encode() == hexed(frame)
    assert decode(frames.parse_reply, hexed(frame))[0] == [REPLIES[frame]]


@pytest.mark.parametrize("function", sorted(set(range(256)) - {READ, WRITE}))
def test_no_other_function_leaves_the_house_or_is_recognised(function):
    with pytest.raises(InvalidValueError, match="firmware"):
        Request(1, function, 0, 1, b"\0").encode()
    frame = bytearray(frames.zero_request(1).encode())
    frame[6], frame[-1] = function, frame[-1] + 0x79 - function & 0xFF
    assert sums_to_zero(frame)
    assert decode(frames.parse_request, bytes(frame))[0] == []


@pytest.mark.parametrize(
    "request_", [Request(1, READ, 0, 1, b"\0"), Request(1, WRITE, 0, 2, b"\0"), Request(1, WRITE, 0, 17, bytes(17))]
)
def test_a_request_whose_data_do_not_fit_its_count_is_not_encoded(request_):
    with pytest.raises(InvalidValueError, match="data"):
        request_.encode()


def test_errors_have_names():
    assert error_name(7, SERIAL_CONVERTER) == "error 0x07 (no data)"
    assert error_name(0x63, SERIAL_CONVERTER) == "error 0x63 (unknown)"


@repeatable
@given(st.lists(requests, max_size=4), cuts)
def test_requests_survive_any_chunking(sent, sizes):
    data = b"".join(request.encode() for request in sent)
    found, decoder = decode(frames.parse_request, data, sizes)
    assert found == sent
    assert decoder.skipped == decoder.bad_checksums == 0


@repeatable
@given(st.lists(replies | misleading, max_size=6), cuts)
def test_chunking_changes_nothing(parts, sizes):
    data = b"".join(part if isinstance(part, bytes) else part.encode() for part in parts)
    whole, all_at_once = decode(parse, data)
    found, decoder = decode(parse, data, sizes)
    assert found == whole
    assert (decoder.skipped, decoder.bad_checksums) == (all_at_once.skipped, all_at_once.bad_checksums)


@repeatable
@given(st.lists(st.tuples(replies, misleading), max_size=4), misleading)
def test_garbage_hides_no_reply(pairs, last):
    check_nothing_lost(parse, [reply.encode() for reply, _ in pairs], [*(noise for _, noise in pairs), last])


@repeatable
@given(read_replies(100).map(lambda reply: reply.encode()), st.integers(0, 80))
def test_heads_inside_data_are_data(frame, at):
    inside = bytearray(frame)
    inside[14 + at : 14 + at + len(HEADS)] = HEADS
    inside[-1] = -sum(inside[:-1]) % 256
    found, decoder = decode(parse, bytes(inside) * 3)
    assert len(found) == 3
    assert decoder.skipped == 0


@repeatable
@given(replies, replies, st.data())
def test_a_truncated_reply_does_not_take_the_next_with_it(first, second, data):
    cut = data.draw(st.integers(0, len(first.encode()) - 1))
    check_nothing_lost(parse, [second.encode()], [first.encode()[:cut], b""])


@repeatable
@given(
    st.lists(replies, min_size=1, max_size=3), st.lists(st.tuples(st.integers(0, 400), byte), min_size=1, max_size=5)
)
def test_a_damaged_reply_is_accepted_only_where_its_check_byte_collides(sent, damage):
    data = bytearray(b"".join(reply.encode() for reply in sent))
    for at, value in damage:
        data[at % len(data)] = value
    for (start, end), message in accepted(parse, bytes(data)).items():
        assert message in sent or sums_to_zero(data[start:end])


@repeatable
@given(replies, st.data())
def test_one_wrong_byte_is_always_noticed(reply, data):
    frame = bytearray(reply.encode())
    at = data.draw(st.integers(0, len(frame) - 1))
    frame[at] = data.draw(byte.filter(lambda value: value != frame[at]))
    assert decode(parse, bytes(frame))[0] == []


def test_a_damaged_length_delays_nothing():
    good = answer(frames.read_request(1, 1008, 20), bytes(range(20))).encode()
    for length in set(range(0, 65536, 7)) - {count + 10 for count in LENGTHS}:
        decoder = FrameDecoder(parse)
        assert decoder.feed(good[:2] + length.to_bytes(2, "little") + good[4:] + good) != []
    # an expected length that contradicts the count is rejected from the header alone
    decoder = FrameDecoder(parse)
    assert len(decoder.feed(good[:2] + (100 + 10).to_bytes(2, "little") + good[4:] + good)) == 1


def test_lost_bytes_cost_one_reply():
    good = answer(frames.read_request(1, 1008, 20), bytes(range(20))).encode()
    decoder = FrameDecoder(parse)
    assert len(decoder.feed(good[:20] + good[25:] + good)) == 1
    assert decoder.bad_checksums == 1


@pytest.mark.parametrize("size", [1, 64, 100_000])
@pytest.mark.parametrize(
    "garbage",
    [
        random.Random(1).randbytes(100_000),
        b"\xaa\x55" * 50_000,
        hexed("AA556E000100FB000000006400") * 7_700,
    ],
    ids=["random", "heads", "headers"],
)
def test_garbage_costs_one_look_a_byte_and_a_piece(garbage, size):
    calls, held = count_calls(parse, garbage, size)
    assert calls <= len(garbage) + -(-len(garbage) // size) + 115
    assert held < 115


# paxini-sdk as an oracle


@repeatable
@given(byte, addresses, st.integers(0, 65535), st.binary(min_size=1, max_size=16))
def test_requests_are_those_of_paxini_sdk(id, address, count, data):
    sdk = pytest.importorskip("paxini_sdk.protocol")
    theirs = sdk.build_fin_request(sdk.FIN_FUNC_FORCE, address, read=True, data_len=count, device_id=id)
    mine = frames.read_request(id, address, count)
    assert mine.encode() == theirs
    assert decode(frames.parse_request, theirs)[0] == [mine]
    theirs = sdk.build_fin_request(sdk.FIN_FUNC_CALIBRATION, address, read=False, data=data, device_id=id)
    mine = Request(id, WRITE, address, len(data), data)
    assert mine.encode() == theirs
    assert decode(frames.parse_request, theirs)[0] == [mine]


@repeatable
@given(replies)
def test_paxini_sdk_reads_our_replies(reply):
    sdk = pytest.importorskip("paxini_sdk.protocol")
    theirs = sdk.parse_fin_response(reply.encode())
    assert (theirs.device_id, theirs.func_code, theirs.addr) == (reply.id, reply.function, reply.address)
    assert (theirs.data_len, theirs.status, theirs.data) == (reply.count, reply.status, reply.data)


# the driver against a scripted sensor

TAXELS = 9
COUNTS = np.array([[i - 4, 4 - i, 20 * i] for i in range(TAXELS)], dtype=np.int16)
RESULTANT = np.array([[-7, 8, 200]], dtype=np.int16)
BLOCK = to_bytes(RESULTANT) + bytes(27) + to_bytes(COUNTS)


class Sensor:
    """A scripted sensor; `change` can replace the answer to a request."""

    def __init__(self, id=1, version="PAXINI PXSR-STDMC03A-v1.0.5", change=lambda request, reply: reply.encode()):
        self.id, self.version, self.change = id, version, change

    def __call__(self, request):
        if request.id != self.id:
            return b""
        if request.function == WRITE:
            return self.change(request, answer(request))
        if request.address == 6100:
            return self.change(request, answer(request, self.version.encode().ljust(100, b"\0"), 1))
        return self.change(
            request, answer(request, (BLOCK + bytes(4096))[request.address - 1008 :][: request.count], 1)
        )


class Conversation:
    """Context manager: the driver on a pseudo-terminal with a scripted sensor at its other end."""

    def __init__(self, sensor, id=1, taxels=TAXELS, **options):
        pytest.importorskip("serial")
        self.peer = Peer(frames.parse_request, sensor)
        self.transport = open_transport(self.peer.port, 921600)
        profile = make_profile("serial-converter", taxels, {"pad": id}, **options)
        self.board = SerialConverter(self.transport, profile, SystemClock())

    def __enter__(self):
        self.peer.__enter__()
        return self.board

    def __exit__(self, *error):
        self.transport.close()
        self.peer.__exit__(*error)


def test_a_reading_is_resultant_and_taxels_in_one_request():
    with Conversation(Sensor()) as board:
        board.start()
        assert board.version() == "PAXINI PXSR-STDMC03A-v1.0.5"
        for _ in range(3):
            reading = board.read(10)
            np.testing.assert_array_equal(reading.counts, COUNTS[np.newaxis])
            np.testing.assert_array_equal(reading.resultant, RESULTANT)
            assert reading.counts.dtype == reading.resultant.dtype == np.int16
            assert reading.status == (0,)
        assert board.bad_checksums == 0
        board.stop()


def test_reads_at_1008_and_zeroes_at_3():
    conversation = Conversation(Sensor())
    with conversation as board:
        board.start()
        board.zero()
    assert frames.read_request(1, 1008, 30 + 27) in conversation.peer.requests
    assert conversation.peer.requests[-1] == frames.zero_request(1)


@pytest.mark.parametrize("part", ["PXSR-STDMC03A", "pxsr-stdmc03a", ""])
def test_the_part_that_the_profile_names_is_accepted(part):
    with Conversation(Sensor(), part=part) as board:
        board.start()


def test_another_part_is_named():
    with (
        Conversation(Sensor(), part="PXSR-STDDP03G") as board,
        pytest.raises(ProtocolError, match=r"PXSR-STDDP03G.*PXSR-STDMC03A"),
    ):
        board.start()


@pytest.mark.parametrize("version", ["", "something else"])
def test_a_version_that_names_no_part_is_accepted(version):
    with Conversation(Sensor(version=version), part="PXSR-STDDP03G") as board:
        board.start()
        assert board.version() == version


def test_a_sensor_without_a_version_is_accepted():
    silent = Sensor(change=lambda request, reply: b"" if request.address == 6100 else reply.encode())
    with Conversation(silent, part="PXSR-STDDP03G") as board:
        board.start()
        assert board.version() == ""
        assert board.read(10).status == (0,)


def test_a_scan_finds_the_sensor_under_another_id():
    with Conversation(Sensor(id=3), id=0, scan=True) as board:
        board.start()
        assert board.id == 3
        np.testing.assert_array_equal(board.read(10).counts[0], COUNTS)


def test_nobody_answers():
    with Conversation(Sensor(id=3), id=1) as board, pytest.raises(DeviceTimeoutError, match="id 1"):
        board.start()


def test_a_reading_that_never_comes():
    with Conversation(Sensor(id=3), id=1) as board, pytest.raises(DeviceTimeoutError, match=r"0\.1 s"):
        board.read(0.1)


def test_bytes_that_never_fit_are_described():
    noise = random.Random(2).randbytes(200)
    babble = Sensor(change=lambda request, reply: noise)
    with Conversation(babble) as board, pytest.raises(ProtocolError, match="do not fit"):
        board.start()


def test_lost_split_and_damaged_replies_are_asked_for_again():
    number = iter(range(10**6))

    def change(request, reply):
        frame = reply.encode()
        kind = next(number) % 5
        if kind == 1:
            return b""
        if kind == 2:
            return frame[:40] + b"\x99" + frame[41:]
        if kind == 3:
            return frame[:-3]
        if kind == 4:
            return b"\xaa\x55\x00garbage" + frame
        return frame

    with Conversation(Sensor(change=change)) as board:
        board.start()
        for _ in range(10):
            np.testing.assert_array_equal(board.read(10).counts[0], COUNTS)
        assert board.bad_checksums > 0
        assert board.skipped > 0


def test_a_reply_to_something_else_is_not_taken():
    def change(request, reply):
        others = [
            Reply(2, reply.function, reply.address, reply.count, 0, bytes(len(reply.data))),
            Reply(1, reply.function, reply.address + 1, reply.count, 0, bytes(len(reply.data))),
        ]
        return b"".join(other.encode() for other in others) + reply.encode()

    with Conversation(Sensor(change=change)) as board:
        board.start()
        np.testing.assert_array_equal(board.read(10).counts[0], COUNTS)


def test_a_late_reply_is_not_taken_for_the_next_reading():
    numbers, late = iter(range(1, 100)), []

    def change(request, reply):
        if request.count != len(BLOCK):
            return reply.encode()
        number = next(numbers)
        frame = answer(request, bytes([number]) + BLOCK[1:]).encode()
        if number == 2:
            late.append(frame)
            return b""  # arrives together with the answer to the repeated request
        return late.pop() + frame if late else frame

    with Conversation(Sensor(change=change)) as board:
        board.start()
        read = [int(board.read(10).resultant[0, 0]) for _ in range(4)]
    # replies 2 and 3 arrive together and 2 is the answer; 3 would be outdated as the next reading
    assert 3 not in read
    assert read == sorted(set(read))


def test_a_status_that_is_not_good_is_passed_on_with_its_data():
    def change(request, reply):
        return answer(request, reply.data, 7 if request.count == len(BLOCK) else 0).encode()

    with Conversation(Sensor(change=change)) as board:
        board.start()
        assert board.read(10).status == (7,)


def test_a_refusal_names_the_error():
    def change(request, reply):
        return answer(request, b"", 6).encode() if request.function == WRITE else reply.encode()

    with Conversation(Sensor(change=change)) as board:
        board.start()
        with pytest.raises(ProtocolError, match=r"error 0x06 \(parameter\)"):
            board.zero()


def test_a_profile_with_two_pads_is_refused():
    profile = make_profile("serial-converter", 9, {"left": 1, "right": 2})
    with pytest.raises(InvalidValueError, match="slots"):
        SerialConverter(None, profile, SystemClock())


def test_taxels_must_follow_the_resultant():
    profile = make_profile("serial-converter", 9, {"pad": 1}, address=1008)
    with pytest.raises(InvalidValueError, match="address"):
        SerialConverter(None, profile, SystemClock())


@pytest.mark.parametrize(
    ("index", "settings", "says"),
    [
        (300, {}, "index of 'pad' must be the sensor's id, from 0 to 255, got 300"),
        (1, {"resultant_address": -10}, "resultant_address and address must be from 0 to 4294967295, got -10"),
        (1, {"resultant_address": 2**33, "address": 2**33 + 30}, "must be from 0 to 4294967295"),
        (1, {"resultant_address": 0, "address": 65536}, "at most 65525 bytes, got 65563: is address 65536 right"),
    ],
)
def test_what_a_request_cannot_say_is_refused(index, settings, says):
    profile = make_profile("serial-converter", 9, {"pad": index}, **settings)
    with pytest.raises(InvalidValueError, match=says):
        SerialConverter(None, profile, SystemClock())


def test_the_longest_reply_can_be_said():
    profile = make_profile("serial-converter", 9, {"pad": 255}, resultant_address=0, address=65525 - 27)
    SerialConverter(None, profile, SystemClock())
    request = Request(255, READ, 0, frames.MAX_READ_REQUEST)
    reply = answer(request, bytes(frames.MAX_READ_REQUEST))
    assert decode(frames.reply_parser({frames.MAX_READ_REQUEST}), reply.encode())[0] == [reply]
