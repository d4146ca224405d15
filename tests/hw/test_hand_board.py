"""The older GEN1 hand board: finding rounds without a checksum, and the driver over a pseudo-terminal."""

import random
import time
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from paxisim.errors import DeviceTimeoutError, InvalidValueError, ProtocolError, UnsupportedError
from paxisim.hw.families.control_box.wire import Reply, parse_request
from paxisim.hw.families.hand_board import wire as wire
from paxisim.hw.families.hand_board.driver import HandBoard
from paxisim.hw.families.hand_board.wire import Block, Round, RoundDecoder
from paxisim.hw.families.taxels import to_bytes
from paxisim.hw.link.clock import SystemClock
from paxisim.hw.link.recognise import describe
from paxisim.hw.link.transport import Transport, open_transport

pytest.importorskip("pty", reason="no pseudo-terminals here")

from gen3_peer import Peer, cuts, in_pieces, make_profile, repeatable

TAGS = ("AAEE", "CCEE", "AAFF", "CCFF")
# data of a round without tags: all bytes are below those of a tag
calm_bytes = st.binary(min_size=47, max_size=47).map(lambda data: bytes(b & 0x7F for b in data))
# data with tags and halves of tags at arbitrary places
wild_bytes = st.lists(
    st.binary(max_size=6) | st.sampled_from([bytes.fromhex(tag) for tag in TAGS] + [b"\xaa"]), min_size=10, max_size=47
).map(lambda parts: b"".join(parts)[:47].ljust(47, b"\xaa"))


def rounds_of(data, states=None):
    block = st.builds(
        lambda data, state: Block(data[:45], state, data[45:]), data, states or st.sampled_from([0, 1, 7])
    )
    return st.builds(lambda *blocks: Round(blocks), block, block, block, block)


calm = rounds_of(calm_bytes)
wild = rounds_of(wild_bytes)


def decode(data, sizes=()):
    """Return the rounds in `data` and the decoder after the line went silent."""
    decoder = RoundDecoder()
    found = [message for piece in in_pieces(data, sizes) for message in decoder.feed(piece)]
    return found + decoder.flush(), decoder


def numbered(number):
    """A round that is unique to `number`."""
    first, *others = (Block(bytes([number, i, 3] * 15)) for i in range(4))
    return Round((first, *others))


def stream(rounds):
    return b"".join(found.encode() for found in rounds)


# rounds as bytes


def test_a_round_as_bytes():
    taxels = [bytes(range(first, first + 45)) for first in (0, 45, 90, 135)]
    states, rests = (1, 0, 1, 7), (b"ab", b"cd", b"ef", b"gh")
    one = Round(tuple(Block(taxels[i], states[i], rests[i]) for i in range(4)))
    expected = b"".join(bytes.fromhex(TAGS[i]) + bytes([states[i]]) + taxels[i] + rests[i] for i in range(4))
    assert len(expected) == 200
    assert one.encode() == expected
    assert decode(expected)[0] == [one]


def test_a_block_that_does_not_fit_is_not_encoded():
    with pytest.raises(InvalidValueError, match="block 2"):
        Round((Block(bytes(45)), Block(bytes(45)), Block(bytes(44)), Block(bytes(45)))).encode()
    with pytest.raises(InvalidValueError, match="4 blocks"):
        Round((Block(bytes(45)),)).encode()


@repeatable
@given(st.lists(calm, max_size=4))
def test_calm_rounds_come_at_once(sent):
    decoder = RoundDecoder()
    for one in sent:
        assert decoder.feed(one.encode()) == [one]
    assert (decoder.pending, decoder.skipped, decoder.frames) == (0, 0, len(sent))


@repeatable
@given(st.lists(wild | st.binary(max_size=60), max_size=5), cuts)
def test_chunking_changes_nothing_once_the_line_is_silent(parts, sizes):
    data = b"".join(part if isinstance(part, bytes) else part.encode() for part in parts)
    decoder = RoundDecoder()
    found = [message for piece in in_pieces(data, sizes) for message in decoder.feed(piece)]
    by_byte = RoundDecoder()
    singly = [message for i in range(len(data)) for message in by_byte.feed(data[i : i + 1])]
    found += decoder.flush()
    singly += by_byte.flush()
    assert found == singly
    assert decoder.skipped == by_byte.skipped == len(data) - 200 * len(found)


@repeatable
@given(st.lists(wild, max_size=5), cuts)
def test_tags_inside_data_are_data(sent, sizes):
    found, decoder = decode(stream(sent), sizes)
    assert found == sent
    assert decoder.skipped == 0


@repeatable
@given(st.lists(calm, min_size=2, max_size=5, unique_by=lambda found: found.encode()), st.data())
def test_a_stream_met_in_the_middle(sent, data):
    start = data.draw(st.integers(1, 199))
    found, decoder = decode(stream(sent)[start:])
    assert found == sent[1:]
    assert decoder.skipped == 200 - start


@repeatable
@given(st.lists(st.tuples(st.binary(max_size=60), calm), max_size=4), st.binary(max_size=60))
def test_garbage_between_rounds_hides_none(pairs, last):
    # garbage that contains whole tags is identified only by the bytes after it; see the tests below
    clean = [(noise.replace(b"\xaa", b"\xab"), one) for noise, one in pairs]
    data = b"".join(noise + one.encode() for noise, one in clean) + last.replace(b"\xaa", b"\xab")
    assert decode(data)[0] == [one for _, one in pairs]


@repeatable
@given(st.binary(max_size=150), st.lists(calm, min_size=3, max_size=3))
def test_garbage_before_a_stream_delays_but_hides_nothing(noise, sent):
    assert decode(noise + stream(sent))[0] == sent


@repeatable
@given(st.integers(1, 900), st.integers(1, 49))
def test_lost_bytes_cost_the_rounds_they_were_in(at, lost):
    sent = [numbered(i) for i in range(6)]
    data = stream(sent)
    found, _ = decode(data[:at] + data[at + lost :])
    first, last = at // 200, (at + lost - 1) // 200
    if at % 200 >= 152 and last > first:
        # losing the end of a round and the tag that would reveal it is the only undetectable loss
        assert found.pop(first) not in sent
    assert found == sent[:first] + sent[last + 1 :]


@pytest.mark.parametrize("lost", range(1, 49))
def test_a_last_block_cut_short_is_noticed(lost):
    # the only loss that leaves all four tags in place
    sent = [numbered(i) for i in range(4)]
    data = stream(sent)
    for size in (1, 37, 200, len(data)):
        cut = data[: 400 - lost] + data[400:]
        assert decode(cut, [size] * (len(cut) // size))[0] == [sent[0], sent[2], sent[3]]


def test_a_last_block_cut_short_is_noticed_where_the_next_round_is_damaged_too():
    sent = [numbered(i) for i in range(4)]
    data = stream(sent)
    cut = data[:390] + data[400:470] + data[471:]
    assert decode(cut)[0] == [sent[0], sent[3]]


@repeatable
@given(st.integers(0, 999), st.integers(1, 255))
def test_a_flipped_tag_costs_one_round_and_no_other_is_touched(at, flip):
    sent = [numbered(i) for i in range(5)]
    data = bytearray(stream(sent))
    data[at] ^= flip
    found, _ = decode(bytes(data))
    if at % 50 < 2:
        assert found == [one for i, one in enumerate(sent) if i != at // 200]
    else:  # no checksum: the round is passed on as received
        assert [one for i, one in enumerate(found) if i != at // 200] == [
            one for i, one in enumerate(sent) if i != at // 200
        ]


# rounds in which all four tags occur at two places


def twofold(number, at=20):
    """A round, unique to `number`, whose data repeat all four tags `at` bytes after the real ones."""
    blocks = []
    for tag in TAGS:
        data = bytearray([number % 100] * 47)
        data[at - 3 : at - 1] = bytes.fromhex(tag)
        data[at - 1] = 0
        blocks.append(Block(bytes(data[:45]), wire.VALID, bytes(data[45:])))
    return Round(tuple(blocks))


@pytest.mark.parametrize("start", range(0, 200, 7))
def test_the_right_alignment_wins_as_soon_as_the_data_move(start):
    # the pattern lasts for only two rounds
    sent = [twofold(1), twofold(2), *(numbered(i) for i in range(4))]
    found, _ = decode(stream(sent)[start:], [13] * 90)
    assert found == (sent if start == 0 else sent[1:])


@pytest.mark.parametrize("start", range(0, 200, 7))
def test_a_pattern_held_for_ever_is_told_by_the_states(start):
    sent = [twofold(i) for i in range(8)]
    found, _ = decode(stream(sent)[start:], [64] * 24)
    assert found == (sent if start == 0 else sent[1:])


def test_a_wrong_choice_is_left_once_the_data_move():
    right = [twofold(1)] * 4
    # the false tags are followed by a valid state too, and decoding starts between the two places
    data = bytearray(stream(right))
    for i in range(0, len(data), 50):
        data[i + 22] = 1
    after = [numbered(i) for i in range(3)]
    found, _ = decode(bytes(data[10:]) + stream(after))
    assert found[-3:] == after


def test_in_step_a_tag_in_the_last_block_waits_for_two_bytes():
    decoder = RoundDecoder()
    calm_round, doubtful = numbered(1), Round((*numbered(2).blocks[:3], Block(b"\xaa\xee" + bytes(43))))
    assert decoder.feed(calm_round.encode()) == [calm_round]
    assert decoder.feed(doubtful.encode()) == []
    assert decoder.feed(b"\xaa") == []
    assert decoder.feed(b"\xee") == [doubtful]
    assert decoder.pending == 2


@pytest.mark.parametrize(
    "garbage",
    [
        random.Random(1).randbytes(100_000),
        b"\xaa\xee" * 50_000,
        b"\xaa" * 100_000,
        b"\xaa\xee".ljust(50, b"\0") * 2_000,
        stream([twofold(1)]) * 500,
    ],
    ids=["random", "tags", "halves", "first blocks", "rounds"],
)
@pytest.mark.parametrize("size", [1, 64, 100_000])
def test_garbage_costs_few_looks_and_holds_back_little(garbage, size, monkeypatch):
    calls, held = 0, 0
    real = wire._tags

    def counted(buffer, at):
        nonlocal calls
        calls += 1
        return real(buffer, at)

    monkeypatch.setattr(wire, "_tags", counted)
    decoder = RoundDecoder()
    for at in range(0, len(garbage), size):
        decoder.feed(garbage[at : at + size])
        held = max(held, decoder.pending)
    pieces = -(-len(garbage) // size)
    assert calls <= 3 * len(garbage) + 10 * pieces
    assert held < wire.DECISION_BYTES
    decoder.flush()
    assert decoder.pending == 0


# the driver


NO_LINE = cast(Transport, None)


class Conversation:
    """Context manager: the driver on a pseudo-terminal whose other end sends the bytes that `idle` returns."""

    def __init__(self, idle, slots=None, taxels=15, **options):
        pytest.importorskip("serial")
        self.profile = make_profile("hand-board", taxels, slots or {"tip": 1, "pulp": 0}, **options)
        self.peer = Peer(parse_request, lambda request: b"", idle)

    def __enter__(self):
        self.peer.__enter__()
        self.transport = open_transport(self.peer.port, 460800)
        self.board = HandBoard(self.transport, self.profile, SystemClock())
        return self.board

    def __exit__(self, *error):
        self.transport.close()
        self.peer.__exit__(*error)


def sender(make):
    """Return an `idle` function that sends rounds 0, 1, 2 ... in pieces that are not whole rounds."""
    number = iter(range(10**6))
    waiting = bytearray()

    def idle():
        time.sleep(1e-3)
        if len(waiting) < 130:
            waiting.extend(make(next(number)))
        piece = bytes(waiting[:130])
        del waiting[:130]
        return piece

    return idle


def test_blocks_are_read_by_slot_and_every_round_once():
    with Conversation(sender(lambda i: numbered(i % 100).encode())) as board:
        board.start()
        readings = [board.read(20) for _ in range(20)]
        assert board.version() == ""
        assert board.skipped < 200
        with pytest.raises(UnsupportedError, match="software"):
            board.zero()
        board.stop()
    first = readings[0].counts[0, 0, 0]
    for i, reading in enumerate(readings):
        assert reading.counts.shape == (2, 15, 3)
        assert reading.counts.dtype == np.int16
        np.testing.assert_array_equal(reading.counts[:, :, 0], (first + i) % 100)
        np.testing.assert_array_equal(reading.counts[:, 0, 1], [1, 0])
        assert (reading.status, reading.resultant) == ((0, 0), None)
    times = [reading.time for reading in readings]
    assert times == sorted(times)


@pytest.mark.parametrize("signed", [False, True])
def test_signs_and_states(signed):
    counts = np.array([[-128 + i, 127 - i, -i if signed else 255 - i] for i in range(15)])
    blocks = [Block(to_bytes(counts), state) for state in (0, 7, 1, 1)]
    frame = Round(tuple(blocks)).encode()
    slots = {"a": 3, "b": 0, "c": 1}
    with Conversation(sender(lambda i: frame), slots, signed_normal=signed) as board:
        board.start()
        reading = board.read(20)
    for pad in reading.counts:
        np.testing.assert_array_equal(pad, counts)
    assert reading.status == (0, 255, 7)


def test_silence():
    with Conversation(None) as board:
        with pytest.raises(DeviceTimeoutError, match="nothing came"):
            board.start()
        with pytest.raises(DeviceTimeoutError, match=r"within 0\.1 s"):
            board.read(0.1)


def test_another_family_is_named():
    talk = sender(lambda i: Reply(0x70, 0xC006, bytes(40)).encode() * 4)
    with Conversation(talk) as board, pytest.raises(ProtocolError, match=r"GEN1 hand board.*family 'control-box'"):
        board.start()


@pytest.mark.parametrize(("slots", "taxels", "match"), [({"a": 4}, 15, "0 to 3"), ({"a": 0}, 16, "15 taxels.* 16")])
def test_profiles_that_no_hand_board_can_have(slots, taxels, match):
    with pytest.raises(InvalidValueError, match=match):
        HandBoard(NO_LINE, make_profile("hand-board", taxels, slots), SystemClock())


def test_rounds_are_recognised():
    text = describe(stream([numbered(i) for i in range(3)]) + b"\1")
    assert text == "3 rounds of the family 'hand-board', an older GEN1 hand board (in 600 of 601 bytes)"
