"""Lost bytes in four families: no wrong frame, and no frame lost except the damaged one.

A check byte is a sum, so it does not detect a loss of bytes that have the same sum as those that take their place. The
tests try every loss of 1 to 4 bytes at every place of the second of four frames, on pads at rest and on pressed pads.
"""

import numpy as np
import pytest

from paxisim.hw.frames import control_box, hand_board, high_speed, serial_converter
from paxisim.hw.frames.stream_layout import StreamLayout
from paxisim.hw.framing import FrameDecoder

LOSSES = range(1, 5)
LOADS = {"at rest": 0.0, "a third pressed": 0.3, "all pressed": 1.0}


def counts(rng, load, taxels):
    """``(taxels, 3)`` counts; each taxel is nonzero with probability `load`."""
    values = rng.integers([-128, -128, 0], [128, 128, 256], (taxels, 3)).astype(np.int16)
    return values * (rng.random((taxels, 1)) < load)


def as_bytes(values):
    return values.astype(np.uint8).tobytes()


def pushes(rng, load, taxels, modules=1):
    layout = StreamLayout(tuple(range(modules)), (taxels,) * modules)
    readings = [counts(rng, load, taxels) for _ in range(modules)]
    resultants = [counts(rng, load > 0, 1)[0] for _ in range(modules)]
    return high_speed.Push(0, layout.encode(resultants, readings))


def converter_replies(rng, load, taxels):
    data = as_bytes(counts(rng, load, 1)) + bytes(27) + as_bytes(counts(rng, load, taxels))
    return serial_converter.Reply(1, serial_converter.READ, 1008, len(data), 0, data)


def box_replies(rng, load, taxels):
    data = as_bytes(counts(rng, load, 1)) + bytes(27) + as_bytes(counts(rng, load, taxels))
    return control_box.Reply(*control_box.READ_REGISTERS, control_box.Region(1008, data).encode())


def rounds(rng, load, _):
    return hand_board.Round(tuple(hand_board.Block(as_bytes(counts(rng, load, 15))) for _ in range(4)))


def push_decoder(taxels, modules=1):
    return FrameDecoder(high_speed.push_parser({0, modules * (6 + 3 * taxels)}))


def converter_decoder(taxels):
    return FrameDecoder(serial_converter.reply_parser({0, 3, 100, 30 + 3 * taxels}))


def box_decoder(taxels):
    return FrameDecoder(control_box.reply_parser({*range(129), 36 + 3 * taxels}))


FAMILIES = {
    "high-speed": (pushes, push_decoder, (9, 31, 52, 116)),
    "high-speed, two pads": (lambda *a: pushes(*a, 2), lambda taxels: push_decoder(taxels, 2), (52,)),
    "serial-converter": (converter_replies, converter_decoder, (9, 52, 72)),
    "control-box": (box_replies, box_decoder, (60, 120)),
    "hand-board": (rounds, lambda _: hand_board.RoundDecoder(), (15,)),
}


def check(make_decoder, sent, at, lost, pieces=1):
    """Remove `lost` bytes at offset `at` of the stream, decode the rest, and compare the result with what was sent."""
    frames = [message.encode() for message in sent]
    stream = b"".join(frames)
    damaged = stream[:at] + stream[at + lost :]
    decoder = make_decoder()
    step = -(-len(damaged) // pieces)
    found = [m for i in range(0, len(damaged), step) for m in decoder.feed(damaged[i : i + step])] + decoder.flush()
    # another loss may leave the same bytes; the damaged frame is then ambiguous
    ends = np.cumsum([len(frame) for frame in frames])
    same = [i for i in range(at - 4, at + 5) if i >= 0 and stream[:i] + stream[i + lost :] == damaged]
    hit = {int(np.searchsorted(ends, i, "right")) for i in same if i + lost <= len(stream)}
    allowed = [[m for k, m in enumerate(sent) if k != gone] for gone in hit] + [list(sent)]
    assert found in allowed, (at, lost, [sent.index(m) if m in sent else m for m in found])


def check_every_loss(family, taxels, load, turns):
    """Try every loss at every place of the second frame, and some of them with the stream in pieces of any size."""
    make, decoder, _ = FAMILIES[family]
    rng = np.random.default_rng(taxels)
    for _ in range(turns):
        sent = [make(rng, LOADS[load], taxels) for _ in range(4)]
        first, second = len(sent[0].encode()), len(sent[1].encode())
        for lost in LOSSES:
            for at in range(first, first + second - lost + 1):
                check(lambda: decoder(taxels), sent, at, lost)
        for _ in range(100):
            lost = int(rng.integers(1, 5))
            at = int(rng.integers(first, first + second - lost + 1))
            check(lambda: decoder(taxels), sent, at, lost, pieces=int(rng.integers(1, 400)))


@pytest.mark.parametrize("load", ["at rest", "a third pressed"])
@pytest.mark.parametrize("family", FAMILIES)
def test_one_loss_costs_one_frame_and_makes_no_wrong_one(family, load):
    check_every_loss(family, FAMILIES[family][2][0], load, turns=1)


@pytest.mark.slow
@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("family", FAMILIES)
def test_one_loss_in_frames_of_any_size(family, load):
    for taxels in FAMILIES[family][2]:
        check_every_loss(family, taxels, load, turns=3)


def test_a_loss_is_noticed_where_the_next_frame_is_damaged_as_well():
    push = high_speed.Push(0, bytes(162)).encode()
    short = push[:20] + push[22:]
    for at in range(2, len(push), 3):  # damage anywhere after the two bytes of the head
        for damaged in (push[:at] + push[at + 1 :], push[:at] + bytes([push[at] ^ 0x40]) + push[at + 1 :]):
            decoder = push_decoder(52)
            assert decoder.feed(push + short + damaged + push) + decoder.flush() == [high_speed.Push(0, bytes(162))] * 2
            assert decoder.bad_checksums > 0


def ending_in_a_head():
    """A push whose check byte is the first byte of a head."""
    data = bytes(160)
    rest = -(sum(high_speed.Push(0, data + b"\0\0").encode()[:-1]) + 0xAA) & 0xFF
    return high_speed.Push(0, data + bytes([rest // 2, rest - rest // 2]))


def test_a_frame_that_ends_like_a_head_waits_for_one_byte_and_keeps_its_time():
    push = ending_in_a_head()
    assert push.encode()[-1:] == b"\xaa"
    for following in (b"\xaa", b"\x00", b"\x57"):  # the next frame, and noise
        decoder = push_decoder(52)
        assert decoder.feed_at(push.encode(), 1.0) == []
        assert decoder.feed_at(following, 2.0) == [(1.0, push)]
    decoder = push_decoder(52)
    assert decoder.feed_at(push.encode(), 1.0) == []
    assert decoder.flush_at() == [(1.0, push)]


def test_an_answer_does_not_wait_for_what_nobody_asked_for():
    decoder = FrameDecoder(high_speed.push_parser({162}), stream=False)
    assert decoder.feed(ending_in_a_head().encode()) == [ending_in_a_head()]
