"""The older GEN1 hand board: finding rounds that have no check byte, and signs and states of its blocks."""

import numpy as np
import pytest
from byte_streams import decoded
from hypothesis import given, settings
from hypothesis import strategies as st
from scripted_peers import Conversation, HandBoard, numbered_round

from paxisim.hw.families.hand_board import wire
from paxisim.hw.families.hand_board.wire import Block, Round, RoundDecoder
from paxisim.hw.families.taxels import to_bytes

TAGS = tuple(map(bytes.fromhex, ("AAEE", "CCEE", "AAFF", "CCFF")))
SENT = [numbered_round(i) for i in range(6)]
repeatable = settings(derandomize=True, deadline=None, max_examples=100)


def stream(rounds):
    return b"".join(found.encode() for found in rounds)


def rounds_in(data, sizes=()):
    return decoded(RoundDecoder(), data, sizes)


# ---- joining, garbage and loss


@repeatable
@given(st.integers(1, 900), st.integers(1, 49))
def test_lost_bytes_cost_the_rounds_they_were_in(at, lost):
    data = stream(SENT)
    found = rounds_in(data[:at] + data[at + lost :])
    first, last = at // 200, (at + lost - 1) // 200
    if at % 200 >= 152 and last > first:
        # losing the end of a round and the tag that would reveal it is the only undetectable loss
        assert found.pop(first) not in SENT
    assert found == SENT[:first] + SENT[last + 1 :]


def test_a_last_block_cut_short_is_noticed():
    # the only loss that leaves all four tags in place
    data = stream(SENT)
    for lost in range(1, 49):
        cut = data[: 400 - lost] + data[400:]
        for size in (37, 200, len(data)):
            assert rounds_in(cut, [size] * (len(cut) // size)) == [SENT[0], *SENT[2:]], (lost, size)
    # where the next round is damaged too
    assert rounds_in(data[:390] + data[400:470] + data[471:]) == [SENT[0], *SENT[3:]]


# ---- rounds in which all four tags occur at two places


def twofold(number, at=20):
    """A round, unique to `number`, whose data repeat all four tags `at` bytes after the real ones."""
    blocks = []
    for tag in TAGS:
        data = bytearray([number % 100] * 47)
        data[at - 3 : at - 1] = tag
        data[at - 1] = 0
        blocks.append(Block(bytes(data[:45]), wire.VALID, bytes(data[45:])))
    return Round(tuple(blocks))


def test_the_right_alignment_wins_by_data_that_move_or_by_the_states():
    moving = [twofold(1), twofold(2), *SENT[:4]]  # the pattern lasts for only two rounds
    held = [twofold(i) for i in range(8)]
    for sent, size in ((moving, 13), (held, 64)):
        for start in range(0, 200, 7):
            found = rounds_in(stream(sent)[start:], [size] * 90)
            assert found == (sent if start == 0 else sent[1:]), (size, start)


def test_a_wrong_choice_is_left_once_the_data_move():
    # the false tags are followed by a valid state too, and decoding starts between the two places
    data = bytearray(stream([twofold(1)] * 4))
    for i in range(0, len(data), 50):
        data[i + 22] = 1
    assert rounds_in(bytes(data[10:]) + stream(SENT))[-len(SENT) :] == SENT


def test_in_step_a_tag_in_the_last_block_waits_for_two_bytes():
    decoder = RoundDecoder()
    doubtful = Round((*SENT[2].blocks[:3], Block(b"\xaa\xee" + bytes(43))))
    assert decoder.feed(SENT[1].encode()) == [SENT[1]]
    assert decoder.feed(doubtful.encode()) == []
    assert decoder.feed(b"\xaa") == []
    assert decoder.feed(b"\xee") == [doubtful]
    assert decoder.pending == 2


# ---- the driver


@pytest.mark.parametrize("signed", [False, True])
def test_signs_and_states(signed):
    counts = np.array([[-128 + i, 127 - i, -i if signed else 255 - i] for i in range(15)])
    blocks = [Block(to_bytes(counts), state) for state in (0, 7, 1, 1)]
    frame = Round(tuple(blocks)).encode()
    with Conversation(HandBoard(lambda _: frame), {"a": 3, "b": 0, "c": 1}, signed_normal=signed) as board:
        board.start()
        reading = board.read(20)
    for pad in reading.counts:
        np.testing.assert_array_equal(pad, counts)
    assert reading.status == (0, 255, 7)
