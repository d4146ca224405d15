"""Damaged streams of the families on serial ports: no wrong frame, and none lost except the damaged one.

A check byte is a sum, so it does not detect a loss of bytes that have the same sum as those that take their place. The
tests try every loss of 1 to 4 bytes at every place of the second of four frames, on pads at rest and on pressed pads.
Random noise, changed and lost bytes are a short benchmarks/damaged_streams.py.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from byte_streams import decoded

from paxisim.hw.families.high_speed import wire as high_speed
from paxisim.hw.link.framing import FrameDecoder

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import damaged_streams

SLOW = pytest.mark.slow
CASES = [(name, kind) for name, family in damaged_streams.FAMILIES.items() for kind in family.kinds]


@pytest.mark.parametrize("size", [300_000, pytest.param(2_000_000, marks=SLOW)])
@pytest.mark.parametrize(("family", "kind"), CASES)
def test_a_damaged_stream_gives_no_wrong_frame_and_loses_no_good_one(family, kind, size):
    result = damaged_streams.measure(family, kind, size, seed=1)
    assert result.faults == 0
    if family not in ("hand-board", "magnetometer-board"):  # these two have no check byte
        assert result.collisions <= max(2, result.damaged / 100)
        assert result.undecidable == 0
    if family == "magnetometer-board":  # a burst is recognised by the bursts next to it
        assert result.missed_undecidable <= result.damaged / 20
    else:  # about one in 32768 of the frames followed by noise
        assert result.missed_undecidable <= 3
    assert result.most_held < 1200


LOADS = {"at rest": 0.0, "a third pressed": 0.3, "all pressed": 1.0}
FAMILIES = {name: family for name, family in damaged_streams.FAMILIES.items() if not family.by_neighbours}


def push_decoder(size):
    return FrameDecoder(high_speed.push_parser({0, size}))


# boards with few taxels and with two pads
SMALL, TWO = 6 + 3 * 9, 2 * (6 + 3 * 52)
FAMILIES["high-speed, small"] = replace(FAMILIES["high-speed"], size=SMALL, decoder=lambda: push_decoder(SMALL))
FAMILIES["high-speed, two pads"] = replace(FAMILIES["high-speed"], size=TWO, decoder=lambda: push_decoder(TWO))


def frames_of(family, rng, load):
    """Four frames; each taxel is nonzero with probability `load`."""
    shape = (4, family.size // 3)
    taxels = rng.integers(0, 256, (*shape, 3)) * (rng.random((*shape, 1)) < load)
    return [family.make(one.astype(np.uint8).tobytes()) for one in taxels]


def check(family, sent, at, lost, sizes=()):
    """Remove `lost` bytes at offset `at` of the stream, decode the rest, and compare the result with what was sent."""
    frames = [message.encode() for message in sent]
    stream = b"".join(frames)
    damaged = stream[:at] + stream[at + lost :]
    found = decoded(family.decoder(), damaged, sizes)
    # another loss may leave the same bytes; the damaged frame is then ambiguous
    ends = np.cumsum([len(frame) for frame in frames])
    same = [i for i in range(at - 4, at + 5) if i >= 0 and stream[:i] + stream[i + lost :] == damaged]
    hit = {int(np.searchsorted(ends, i, "right")) for i in same if i + lost <= len(stream)}
    allowed = [[m for k, m in enumerate(sent) if k != gone] for gone in hit] + [list(sent)]
    assert found in allowed, (at, lost, [sent.index(m) if m in sent else m for m in found])


@pytest.mark.parametrize(
    ("load", "turns"),
    [("at rest", 1), ("a third pressed", 1), *(pytest.param(load, 5, marks=SLOW) for load in LOADS)],
)
@pytest.mark.parametrize("name", FAMILIES)
def test_one_loss_costs_one_frame_and_makes_no_wrong_one(name, load, turns):
    family, rng = FAMILIES[name], np.random.default_rng(1)
    for _ in range(turns):
        sent = frames_of(family, rng, LOADS[load])
        length = len(sent[0].encode())
        for lost in range(1, 5):
            for at in range(length, 2 * length - lost + 1):
                check(family, sent, at, lost)
        for _ in range(100):
            check(family, sent, int(rng.integers(length, 2 * length - 3)), 4, rng.integers(1, 200, 20).tolist())


PUSH = high_speed.Push(0, bytes(162))


def test_a_loss_is_noticed_where_the_next_frame_is_damaged_as_well():
    push = PUSH.encode()
    short = push[:20] + push[22:]
    for at in range(2, len(push), 3):  # damage anywhere after the two bytes of the head
        for damaged in (push[:at] + push[at + 1 :], push[:at] + bytes([push[at] ^ 0x40]) + push[at + 1 :]):
            decoder = push_decoder(162)
            assert decoded(decoder, push + short + damaged + push) == [PUSH] * 2
            assert decoder.bad_checksums > 0


def test_a_frame_that_ends_like_a_head_waits_for_one_byte_and_keeps_its_time():
    rest = -(sum(PUSH.encode()[:-1]) + 0xAA) & 0xFF
    push = high_speed.Push(0, bytes(160) + bytes([rest // 2, rest - rest // 2]))
    assert push.encode()[-1:] == b"\xaa"
    for following in (b"\xaa", b"\x00", b"\x57"):  # the next frame, and noise
        decoder = push_decoder(162)
        assert decoder.feed_at(push.encode(), 1.0) == []
        assert decoder.feed_at(following, 2.0) == [(1.0, push)]
    decoder = push_decoder(162)
    assert decoder.feed_at(push.encode(), 1.0) == []
    assert decoder.flush_at() == [(1.0, push)]
    # an answer does not wait for what nobody asked for
    assert FrameDecoder(high_speed.push_parser({162}), stream=False).feed(push.encode()) == [push]
