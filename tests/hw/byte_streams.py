"""Helpers for the tests of decoders: bytes in pieces, and what a decoder accepts of them."""

import numpy as np

from paxisim.hw.families.magnetometer_board.wire import Burst
from paxisim.hw.link.framing import FrameDecoder


def hexed(text):
    """Bytes from hexadecimal digits with spaces."""
    return bytes.fromhex(text.replace(" ", ""))


def in_pieces(data, sizes):
    """`data` cut into pieces of the given sizes, the rest last."""
    at = 0
    for size in sizes:
        yield data[at : at + size]
        at += size
    yield data[at:]


def decoded(decoder, data, sizes=()):
    """The messages that `decoder` finds in `data`, which comes in pieces and then stops."""
    found = [message for piece in in_pieces(data, sizes) for message in decoder.feed(piece)]
    return found + decoder.flush()


def parsed(parse, data):
    """The messages that a parser finds in `data`."""
    return decoded(FrameDecoder(parse, stream=False), data)


def accepted(parse, data, stream=True):
    """``{(start, end): message}`` of everything that a decoder accepts as a frame in `data`."""

    def watched(buffer, at):
        result = parse(buffer, at)
        if not isinstance(result, tuple):
            return result
        start = len(data) - len(buffer) + at
        return result[0], ((start, start + result[0]), result[1])

    return dict(decoded(FrameDecoder(watched, stream), data))


def sums_to_zero(frame):
    """Whether the check byte of a GEN3 frame is right by its definition, independent of the code under test."""
    return sum(frame) % 256 == 0


def box_checks(frame):
    """Whether head, tail and check byte of a control box's frame are right by their definition."""
    return frame[:4] == hexed("55AA7B7B") and frame[-4:] == hexed("55AA7D7D") and sum(frame[4:-4]) % 256 == 0


def bursts(count, seed=0, chips=5):
    """Different readings of a magnetometer board, in multiples of the chips' resolution."""
    rng = np.random.default_rng(seed)
    steps = rng.integers(-800, 800, (count, chips, 4))
    steps[:, :, 0] = 550
    return [Burst((one * np.array([0.0452, 0.15, 0.15, 0.242])).astype(np.float32)) for one in steps]
