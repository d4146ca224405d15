"""The GEN3 high-speed board: its frames in both directions, and the driver over a pseudo-terminal."""

import random
import time

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
from paxisim.hw.families.high_speed import wire as frames
from paxisim.hw.families.high_speed.driver import HighSpeed
from paxisim.hw.families.high_speed.stream_layout import StreamLayout, active_bitmap, active_modules
from paxisim.hw.families.high_speed.wire import READ, WRITE, ZERO, Push, Reply, Request
from paxisim.hw.link.clock import SystemClock
from paxisim.hw.link.framing import FrameDecoder
from paxisim.hw.link.transport import open_transport
from paxisim.logs.schemas import NO_TAXELS

REQUESTS = {
    "55AA000300000F00EF": frames.version_request(),
    "55AA00101700010001D8": frames.push_request(True),
    "55AA00101700010000D9": frames.push_request(False),
    "55AA00170200010001E6": frames.zero_request(),
}
INCOMING = {
    "AA55000334120200414233": Reply(READ, 0x1234, b"AB"),
    "AA5500833412000038": Reply(0x83, 0x1234),
    "AA560003000058594C": Push(0, b"XY"),
    "AA5600010007F8": Push(7),
}
LENGTHS = {0, 33, 90}
parse_pushes = frames.push_parser(LENGTHS)
parse_both = frames.incoming_parser(LENGTHS)

byte = st.integers(0, 255)
numbers = st.integers(0, 65535)
pushes = st.sampled_from(sorted(LENGTHS)).flatmap(
    lambda size: st.builds(Push, byte, st.binary(min_size=size, max_size=size))
)
replies = (
    st.builds(Reply, st.just(READ), numbers, st.binary(max_size=60))
    | st.builds(Reply, st.sampled_from([WRITE, ZERO]), numbers, st.binary(max_size=2))
    | st.builds(Reply, st.integers(0x81, 0xFF), numbers)
)
requests = st.builds(Request, st.just(READ), numbers, st.integers(1, 512)) | st.binary(min_size=1, max_size=10).flatmap(
    lambda data: st.builds(Request, st.sampled_from([WRITE, ZERO]), numbers, st.just(len(data)), st.just(data))
)
# misleading bytes: heads, beginnings of frames, and random bytes
misleading = st.lists(
    st.sampled_from([b"\xaa", b"\x55", b"\x56", b"\xaa\x55\x00", b"\xaa\x56\x00", b"\xaa\x56\x00\x5b\x00\x00"])
    | (pushes | replies).map(lambda message: message.encode()[:-3])
    | st.binary(max_size=30),
    max_size=4,
).map(b"".join)


@pytest.mark.parametrize("frame", REQUESTS)
def test_golden_requests_both_ways(frame):
    assert REQUESTS[frame].encode() == hexed(frame)
    assert decode(frames.parse_request, hexed(frame))[0] == [REQUESTS[frame]]


@pytest.mark.parametrize("frame", INCOMING)
def test_golden_answers_both_ways(frame):
    message = INCOMING[frame]
    assert message.encode() == hexed(frame)
    parse = frames.parse_push if isinstance(message, Push) else frames.parse_reply
    assert decode(parse, hexed(frame))[0] == [message]
    assert decode(frames.parse_incoming, hexed(frame))[0] == [message]
    assert message.error == {"AA5500833412000038": 3, "AA5600010007F8": 7}.get(frame, 0)


@pytest.mark.parametrize("function", sorted(set(range(256)) - {READ, WRITE, ZERO}))
def test_no_other_function_leaves_the_house_or_is_recognised(function):
    with pytest.raises(InvalidValueError, match="function"):
        Request(function, 0, 1, b"\0").encode()
    frame = bytearray(frames.push_request(True).encode())
    frame[3], frame[-1] = function, frame[-1] + WRITE - function & 0xFF
    assert sums_to_zero(frame)
    assert decode(frames.parse_request, bytes(frame))[0] == []


@pytest.mark.parametrize(
    "request_",
    [
        Request(READ, 0, 0),
        Request(READ, 0, 513),
        Request(READ, 0, 1, b"\0"),
        Request(WRITE, 0, 11, bytes(11)),
        Request(WRITE, 0, 2, b"\0"),
        Request(WRITE, 0, 0),
    ],
)
def test_a_request_that_the_board_does_not_take_is_not_encoded(request_):
    with pytest.raises(InvalidValueError, match=r"count|data"):
        request_.encode()


@repeatable
@given(st.lists(requests, max_size=4), cuts)
def test_requests_survive_any_chunking(sent, sizes):
    found, decoder = decode(frames.parse_request, b"".join(request.encode() for request in sent), sizes)
    assert found == sent
    assert decoder.skipped == decoder.bad_checksums == 0


@repeatable
@given(st.lists(pushes | replies, max_size=6))
def test_several_frames_in_one_read_are_all_returned(sent):
    decoder = FrameDecoder(parse_both)
    data = b"".join(message.encode() for message in sent)
    found = decoder.feed(data)
    # the last may be held back if a head may begin inside it or at its end
    assert len(found) >= len(sent) - (b"\xaa" in data)
    assert found + decoder.flush() == sent
    assert decoder.pending == decoder.skipped == 0


@repeatable
@given(st.lists(pushes | replies | misleading, max_size=6), cuts)
@pytest.mark.parametrize("parse", [parse_both, parse_pushes, frames.parse_reply], ids=["both", "pushes", "replies"])
def test_chunking_changes_nothing(parse, parts, sizes):
    data = b"".join(part if isinstance(part, bytes) else part.encode() for part in parts)
    whole, all_at_once = decode(parse, data)
    found, decoder = decode(parse, data, sizes)
    assert found == whole
    assert (decoder.skipped, decoder.bad_checksums) == (all_at_once.skipped, all_at_once.bad_checksums)


@repeatable
@given(st.lists(st.tuples(pushes | replies, misleading), max_size=4), misleading)
def test_garbage_hides_no_frame(pairs, last):
    sent = [message.encode() for message, _ in pairs]
    check_nothing_lost(parse_both, sent, [*(noise for _, noise in pairs), last])


@repeatable
@given(st.lists(st.tuples(pushes, misleading), max_size=4), misleading)
def test_garbage_hides_no_push(pairs, last):
    check_nothing_lost(parse_pushes, [push.encode() for push, _ in pairs], [*(noise for _, noise in pairs), last])


@repeatable
@given(st.binary(min_size=90, max_size=90), st.integers(0, 70))
def test_heads_inside_data_are_data(data, at):
    inside = data[:at] + b"\xaa\x56\x00\x01\x00\xaa\x55\x00\x03\xaa\x56\x00\x22\x00" + data[at + 14 :]
    found, decoder = decode(parse_pushes, Push(0, inside).encode() * 3)
    assert found == [Push(0, inside)] * 3
    assert decoder.skipped == 0


@repeatable
@given(pushes, pushes, st.data())
def test_a_truncated_push_does_not_take_the_next_with_it(first, second, data):
    cut = data.draw(st.integers(0, len(first.encode()) - 1))
    check_nothing_lost(parse_pushes, [second.encode()], [first.encode()[:cut], b""])


@repeatable
@given(
    st.lists(pushes | replies, min_size=1, max_size=3),
    st.lists(st.tuples(st.integers(0, 300), byte), min_size=1, max_size=5),
)
def test_a_damaged_frame_is_accepted_only_where_its_check_byte_collides(sent, damage):
    data = bytearray(b"".join(message.encode() for message in sent))
    for at, value in damage:
        data[at % len(data)] = value
    for (start, end), message in accepted(parse_both, bytes(data)).items():
        assert message in sent or sums_to_zero(data[start:end])


@repeatable
@given(st.binary(min_size=90, max_size=90), st.data())
def test_one_wrong_byte_is_always_noticed(payload, data):
    frame = bytearray(Push(0, payload).encode())
    at = data.draw(st.integers(0, len(frame) - 1))
    frame[at] = data.draw(byte.filter(lambda value: value != frame[at]))
    # one allowed length only: with a wrong length, the beginning may pass as a frame by chance
    assert decode(frames.push_parser({90}), bytes(frame))[0] == []


def test_a_damaged_length_delays_nothing():
    good = Push(0, bytes(range(90))).encode()
    for length in set(range(0, 65536, 7)) - {size + 1 for size in LENGTHS}:
        decoder = FrameDecoder(parse_pushes)
        assert decoder.feed(good[:3] + length.to_bytes(2, "little") + good[5:] + good) == [Push(0, bytes(range(90)))]


def test_lost_bytes_cost_one_push():
    good = Push(0, bytes(range(90))).encode()
    decoder = FrameDecoder(parse_pushes)
    assert len(decoder.feed(good[:20] + good[25:] + good)) == 1
    assert decoder.bad_checksums == 1


@pytest.mark.parametrize("size", [1, 64, 100_000])
@pytest.mark.parametrize(
    "garbage",
    [random.Random(1).randbytes(100_000), b"\xaa\x56\x00" * 33_334, hexed("AA56005B0000") * 16_667],
    ids=["random", "heads", "headers"],
)
def test_garbage_costs_one_look_a_byte_and_a_piece(garbage, size):
    calls, held = count_calls(parse_pushes, garbage, size)
    assert calls <= len(garbage) + -(-len(garbage) // size) + 97
    assert held < 97


# contents of a push


def test_modules_of_the_bitmap():
    assert active_modules(hexed("05000000")) == (0, 2)
    assert active_modules(hexed("000000F8")) == (27,)
    assert active_modules(hexed("00800110")) == (15, 16)  # bits beyond module 27 are ignored
    assert active_bitmap((0, 2, 27)) == hexed("05000008")


@repeatable
@given(st.sets(st.integers(0, 27)))
def test_the_bitmap_both_ways(modules):
    assert active_modules(active_bitmap(sorted(modules))) == tuple(sorted(modules))


@st.composite
def streams(draw):
    """A layout, and resultants and taxel counts that fit it."""
    modules = sorted(draw(st.sets(st.integers(0, 27), min_size=1, max_size=4)))
    taxels = [draw(st.sampled_from([9, 25, 31])) for _ in modules]
    rng = np.random.default_rng(draw(st.integers(0, 1000)))
    random_counts = [rng.integers([-128, -128, 0], [128, 128, 256], (n + 1, 3)).astype(np.int16) for n in taxels]
    layout = StreamLayout(tuple(modules), tuple(taxels), draw(st.sampled_from([1, 2, 3])))
    return layout, [counts[0] for counts in random_counts], [counts[1:] for counts in random_counts]


@repeatable
@given(streams())
def test_paxini_sdk_reads_the_same_from_a_stream(stream):
    sdk = pytest.importorskip("paxini_sdk.boards.high_speed")
    names = pytest.importorskip("paxini_sdk.registers").MODULE_NAMES
    layout, resultants, readings = stream
    data = layout.encode(resultants, readings)
    assert len(data) == layout.size
    config = sdk.AutoPushConfig(
        active_modules=list(layout.modules),
        has_resultant=bool(layout.data_type & 1),
        has_distributed=bool(layout.data_type & 2),
        point_counts=dict(zip(layout.modules, layout.taxels, strict=True)),
    )
    frame = sdk.AutoPushFrame(config=config, error_code=0, valid_data=data, raw=b"")
    for module, resultant, reading in zip(layout.modules, resultants, readings, strict=True):
        if config.has_resultant:
            assert frame.resultant_forces[names[module]] == tuple(resultant.tolist())
        if config.has_distributed:
            assert frame.distributed_forces[names[module]] == [tuple(taxel) for taxel in reading.tolist()]


@repeatable
@given(numbers, st.integers(1, 512), st.binary(min_size=1, max_size=10))
def test_requests_are_those_of_paxini_sdk(register, count, data):
    sdk = pytest.importorskip("paxini_sdk.protocol")
    pairs = [
        (frames.read_request(register, count), sdk.build_simple_request(READ, register, data_len=count)),
        (frames.write_request(register, data), sdk.build_simple_request(WRITE, register, data=data)),
        (Request(ZERO, register, len(data), data), sdk.build_simple_request(ZERO, register, data=data)),
    ]
    for mine, theirs in pairs:
        assert mine.encode() == theirs
        assert decode(frames.parse_request, theirs)[0] == [mine]


@repeatable
@given(replies | pushes)
def test_paxini_sdk_reads_our_answers(message):
    sdk = pytest.importorskip("paxini_sdk.protocol")
    errors = pytest.importorskip("paxini_sdk.exceptions")
    if isinstance(message, Push):
        theirs = sdk.parse_auto_push(message.encode())
        assert (theirs.error_code, theirs.valid_data) == (message.error, message.data)
    elif message.error:
        with pytest.raises(errors.DeviceError) as caught:
            sdk.parse_simple_response(message.encode())
        assert caught.value.code == message.error
    else:
        theirs = sdk.parse_simple_response(message.encode())
        assert (theirs.func_code, theirs.reg_addr, theirs.data) == (message.function, message.register, message.data)


# the driver against a scripted board

TAXELS = 9


def counts(seed, taxels=TAXELS):
    return np.random.default_rng(seed).integers([-128, -128, 1], [128, 128, 256], (taxels, 3)).astype(np.int16)


class Board:
    """A scripted board that streams `frames` numbered frames once switched on, `at_once` in one write."""

    def __init__(self, modules=None, frames=10**6, interval=0.02, at_once=1, bitmap=None):
        self.modules = {0: 9, 2: 9} if modules is None else modules
        self.remaining, self.interval, self.at_once = frames, interval, at_once
        self.registers = bytearray(0x100)
        self.registers[0x00:0x0F] = b"HS-1.2.3".ljust(15, b"\0")
        self.registers[0x10:0x14] = bitmap or active_bitmap(sorted(self.modules))
        for module, taxels in self.modules.items():
            self.registers[0x30 + 2 * module] = taxels
        self.registers[0x16] = 1
        self.number, self.due, self.zeroed = 0, 0.0, 0

    def answer(self, request):
        if request.function == ZERO:
            self.zeroed += 1
            return Reply(ZERO, request.register, b"\0").encode()
        at = request.register
        if request.function == WRITE:
            self.registers[at : at + request.count] = request.data
            return (Push() if at == 0x17 else Reply(WRITE, at, b"\0")).encode()
        return Reply(READ, at, bytes(self.registers[at : at + request.count])).encode()

    def payload(self, number):
        modules = sorted(self.modules)
        layout = StreamLayout(tuple(modules), tuple(self.modules[m] for m in modules), self.registers[0x16])
        readings = [counts(100 * number + module, self.modules[module]) for module in modules]
        # the high bytes of a resultant carry no information
        resultants = [np.array([-5 - module, 7, 200 + number % 50 - 512]) for module in modules]
        return layout.encode(resultants, readings)

    def push(self, number):
        return Push(0, self.payload(number)).encode()

    def idle(self):
        if not self.registers[0x17] or not self.remaining or time.monotonic() < self.due:
            return b""
        self.due = time.monotonic() + self.interval
        data = b""
        for _ in range(min(self.at_once, self.remaining)):
            data += self.push(self.number)
            self.number += 1
            self.remaining -= 1
        return data


class Conversation:
    """Context manager: the driver on a pseudo-terminal with a scripted board at its other end."""

    def __init__(self, script, slots=None, taxels=TAXELS, **options):
        pytest.importorskip("serial")
        self.peer = Peer(frames.parse_request, script.answer, script.idle)
        self.transport = open_transport(self.peer.port, 921600)
        profile = make_profile("high-speed", taxels, slots or {"left": 0, "right": 2}, **options)
        self.board = HighSpeed(self.transport, profile, SystemClock())

    def __enter__(self):
        self.peer.__enter__()
        return self.board

    def __exit__(self, *error):
        self.transport.close()
        self.peer.__exit__(*error)


def check_reading(reading, number, modules=(0, 2)):
    np.testing.assert_array_equal(reading.counts, [counts(100 * number + module) for module in modules])
    np.testing.assert_array_equal(reading.resultant, [[-5 - module, 7, 200 + number % 50] for module in modules])


@pytest.mark.parametrize("at_once", [1, 4])
def test_every_frame_is_read_in_order(at_once):
    with Conversation(Board(at_once=at_once)) as board:
        board.start()
        times = []
        for number in range(12):
            reading = board.read(10)
            check_reading(reading, number)
            assert reading.counts.dtype == reading.resultant.dtype == np.int16
            assert reading.status == (0, 0)
            times.append(reading.time)
        assert times == sorted(times)
        assert board.version() == "HS-1.2.3"
        assert board.bad_checksums == 0
        board.stop()


def test_pads_come_in_the_order_of_the_slots_and_other_modules_are_skipped():
    script = Board({0: 9, 1: 31, 2: 9, 20: 25})
    with Conversation(script, {"right": 2, "left": 0}) as board:
        board.start()
        check_reading(board.read(10), 0, modules=(2, 0))


def test_stop_leaves_the_board_silent_and_start_finds_one_that_streams():
    script = Board()
    script.registers[0x17] = 1
    with Conversation(script) as board:
        board.start()
        board.read(10)
        board.stop()
        deadline = time.monotonic() + 30
        while script.registers[0x17] and time.monotonic() < deadline:
            time.sleep(0.01)
        assert script.registers[0x17] == 0
        board.stop()
        board.start()
        board.read(10)
        assert script.registers[0x16] == 3


def test_zeroing_pauses_the_stream():
    script = Board(at_once=3)
    with Conversation(script) as board:
        board.start()
        for number in range(4):
            check_reading(board.read(10), number)
        board.zero()
        assert script.zeroed == 1
        assert script.registers[0x17] == 1
        first = board.read(10)
        assert first.status == (0, 0)
        np.testing.assert_array_equal(first.counts[0], counts(100 * (int(first.resultant[0, 2]) - 200)))


def test_zeroing_that_fails_says_so_and_the_stream_goes_on():
    script = Board()
    answer = script.answer
    script.answer = lambda request: Reply(ZERO, 2, b"\x05").encode() if request.function == ZERO else answer(request)
    with Conversation(script) as board:
        board.start()
        with pytest.raises(ProtocolError, match="05"):
            board.zero()
        board.read(10)


def test_a_refusal_names_the_error():
    script = Board()
    script.answer = lambda request: Reply(request.function | 0x80, request.register).encode()
    with Conversation(script) as board, pytest.raises(ProtocolError, match="error 3"):
        board.start()


def test_an_all_zero_block_of_taxels_with_a_live_resultant_is_marked():
    script = Board({0: 9, 2: 9})
    layout = StreamLayout((0, 2), (9, 9))
    nothing = np.zeros((9, 3), dtype=np.int16)
    script.push = lambda number: Push(
        0x11 if number else 0, layout.encode([np.array([0, 0, 30]), nothing[0]], [nothing, nothing])
    ).encode()
    with Conversation(script) as board:
        board.start()
        reading = board.read(10)
        assert reading.status == (NO_TAXELS, 0)
        assert not reading.counts.any()
        assert reading.resultant.tolist() == [[0, 0, 30], [0, 0, 0]]
        assert board.read(10).status == (NO_TAXELS | 0x11, 0x11)


def test_an_error_without_data_is_passed_on_with_the_next_reading():
    script = Board()
    push = script.push
    script.push = lambda number: (Push(7).encode() if number == 1 else b"") + push(number)
    with Conversation(script) as board:
        board.start()
        assert [board.read(10).status for _ in range(3)] == [(0, 0), (7, 7), (0, 0)]


def test_a_frame_that_comes_in_two_parts_is_whole():
    script = Board()
    idle, rest = script.idle, []

    def halves():
        if rest:
            return rest.pop()
        data = idle()
        rest.append(data[len(data) // 2 :])
        return data[: len(data) // 2]

    script.idle = halves
    with Conversation(script) as board:
        board.start()
        for number in range(6):
            check_reading(board.read(10), number)


def test_damaged_frames_are_skipped_and_the_others_delivered():
    script = Board()
    push = script.push

    def damaged(number):
        frame = push(number)
        if number % 4 == 1:
            return frame[:30] + bytes([frame[30] ^ 0x40]) + frame[31:]
        if number % 4 == 2:
            return frame[:-9]
        return b"\xaa\x56\x00\xff\xff" + frame

    script.push = damaged
    with Conversation(script) as board:
        board.start()
        for number in (0, 3, 4, 7, 8):
            check_reading(board.read(10), number)
        assert board.bad_checksums >= 2
        assert board.skipped > 0


def test_a_stream_that_ends():
    with Conversation(Board(frames=2)) as board:
        board.start()
        board.read(10)
        board.read(10)
        with pytest.raises(DeviceTimeoutError, match="66 bytes"):
            board.read(0.1)


def test_lost_requests_are_repeated():
    script = Board()
    answer, number = script.answer, iter(range(10**6))
    script.answer = lambda request: b"" if next(number) % 3 == 2 else answer(request)
    with Conversation(script) as board:
        board.start()
        board.read(10)


def test_nobody_answers():
    script = Board()
    script.answer = lambda request: b""
    with Conversation(script) as board, pytest.raises(DeviceTimeoutError, match="high-speed board"):
        board.start()


def test_a_board_that_streams_nothing():
    with Conversation(Board(frames=0)) as board, pytest.raises(DeviceTimeoutError, match="streams nothing"):
        board.start()


def test_a_port_that_talks_on_is_described():
    script = Board()
    script.answer = lambda request: b""
    script.idle = lambda: random.Random(3).randbytes(50)
    with Conversation(script) as board, pytest.raises(ProtocolError, match="high-speed board, but"):
        board.start()


def test_an_inactive_module_is_named():
    with Conversation(Board({4: 9, 6: 31})) as board, pytest.raises(ProtocolError) as caught:
        board.start()
    assert "0 (left), 2 (right)" in str(caught.value)
    assert "4 (9 taxels), 6 (31 taxels)" in str(caught.value)


def test_another_number_of_taxels_is_named():
    with Conversation(Board({0: 9, 2: 52})) as board, pytest.raises(ProtocolError, match=r"9 taxels.*right.*52"):
        board.start()


def test_counts_of_palm_modules_by_either_source():
    script = Board({0: 9, 21: 9})
    script.registers[0x30 + 42] = 0
    script.registers[0x66 + 2] = 9
    with Conversation(script, {"finger": 0, "palm": 21}, palm_counts="0066") as board:
        board.start()
        check_reading(board.read(10), 0, modules=(0, 21))
    with Conversation(Board({0: 9, 21: 9}), {"finger": 0, "palm": 21}) as board:
        board.start()
        check_reading(board.read(10), 0, modules=(0, 21))


def test_frames_of_another_length_point_at_the_palm_counts():
    script = Board({0: 9, 21: 31})
    script.registers[0x30 + 42] = 0
    with Conversation(script, {"finger": 0}) as board, pytest.raises(ProtocolError, match="palm_counts"):
        board.start()


def test_settings_and_slots_that_cannot_be():
    with pytest.raises(InvalidValueError, match="palm_counts"):
        HighSpeed(None, make_profile("high-speed", 9, {"pad": 0}, palm_counts="elsewhere"), SystemClock())
    with pytest.raises(InvalidValueError, match=r"0\.\.27"):
        HighSpeed(None, make_profile("high-speed", 9, {"pad": 28}), SystemClock())
