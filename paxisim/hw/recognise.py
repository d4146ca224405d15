"""Recognise: what speaks on a line, told from the bytes that came. No I/O."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from paxisim.hw.framing import FrameDecoder, Parser

_SHOWN = 8


def describe(data: bytes) -> str:
    """What bytes from a port are, in words that fit behind a colon in a message.

    Args:
        data: What came last, a few hundred bytes or more. At most 4096 are looked at.

    Returns:
        The family whose frames they hold, by the name that profiles give it; or that they fit no family, as with a
        wrong baud rate; or that nothing arrived.
    """
    data = bytes(data[-4096:])
    if not data:
        return "nothing arrived"
    best, most = "", 0
    for name, decode in _families().items():
        frames, bytes_in_frames = decode(data)
        if bytes_in_frames > most:
            most = bytes_in_frames
            best = f"{frames} {name} (in {most} of {len(data)} bytes)"
    if best:
        return best
    shown = data[:_SHOWN].hex(" ").upper() + (" ..." if len(data) > _SHOWN else "")
    return f"{len(data)} bytes that fit no family, as with a wrong baud rate: {shown}"


def _families() -> dict[str, Callable[[bytes], tuple[int, int]]]:
    """For each kind of frame, what counts them and their bytes."""
    from paxisim.hw.frames import control_box, high_speed, serial_converter

    echo = "of the host's own requests, which the line sends back"
    return {
        "replies of the family 'control-box', a GEN1 or GEN2 control box": _counter(control_box.parse_reply),
        "rounds of the family 'hand-board', an older GEN1 hand board": _count_rounds,
        "replies of the family 'serial-converter', a GEN3 converter or USB sensor": _counter(
            serial_converter.parse_reply
        ),
        "replies of the family 'high-speed', a GEN3 high-speed board": _counter(high_speed.parse_reply),
        "pushes of the family 'high-speed', a GEN3 high-speed board": _counter(high_speed.parse_push),
        f"{echo} (control-box)": _counter(control_box.parse_request),
        f"{echo} (serial-converter)": _counter(serial_converter.parse_request),
        f"{echo} (high-speed)": _counter(high_speed.parse_request),
    }


def _counter(parse: Parser[Any]) -> Callable[[bytes], tuple[int, int]]:
    def count(data: bytes) -> tuple[int, int]:
        decoder = FrameDecoder(parse)
        decoder.feed(data)
        decoder.flush()
        return decoder.frames, len(data) - decoder.skipped

    return count


def _count_rounds(data: bytes) -> tuple[int, int]:
    from paxisim.hw.frames.hand_board import RoundDecoder

    decoder = RoundDecoder()
    decoder.feed(data)
    decoder.flush()
    return decoder.frames, len(data) - decoder.skipped
