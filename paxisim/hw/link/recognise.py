"""Recognise: identify the board on a line, from the bytes received or by asking it."""

from __future__ import annotations

from paxisim.hw.families.load import board_class
from paxisim.hw.families.table import FAMILIES
from paxisim.hw.link.clock import Clock
from paxisim.hw.link.transport import Transport

_SHOWN = 8
_SHOWN_TEXT = 60
VERSION_SECONDS = 0.15
"""Time (s) that a board may take to report its version; 10 ms was observed."""


def describe(data: bytes) -> str:
    """Describe bytes from a port, in words that fit after a colon in a message.

    Args:
        data: The latest bytes, a few hundred or more. At most 4096 are examined.

    Returns:
        The family whose frames the bytes hold, by the name that profiles use; or a statement that they fit no family,
        as with a wrong baud rate, or that nothing arrived.
    """
    data = bytes(data[-4096:])
    if not data:
        return "nothing arrived"
    best, most = "", 0
    for family in FAMILIES:
        for name, make_decoder in board_class(family).heard.items():
            decoder = make_decoder()
            decoder.feed(data)
            decoder.flush()
            in_frames = len(data) - decoder.skipped
            if in_frames > most:
                most = in_frames
                best = f"{decoder.frames} {name} (in {most} of {len(data)} bytes)"
    if best:
        return best
    if data.isascii() and data.decode().replace("\n", "").isprintable():
        text = data.decode()
        return f"text of no family: {text[:_SHOWN_TEXT]!r}" + (" ..." if len(text) > _SHOWN_TEXT else "")
    shown = data[:_SHOWN].hex(" ").upper() + (" ..." if len(data) > _SHOWN else "")
    return f"{len(data)} bytes that fit no family, as with a wrong baud rate: {shown}"


def who_answers(transport: Transport, clock: Clock, family: str) -> str:
    """Send the questions of each family that uses the same kind of port as `family`.

    Returns:
        Description of the board that answered, as given by `describe`; empty if no known board answered.
    """
    others = [other for other, row in FAMILIES.items() if row.transport == FAMILIES[family].transport]
    for request in [question for other in others for question in board_class(other).questions]:
        transport.discard_input()
        transport.write(request)
        heard = b""
        end = clock.monotonic() + VERSION_SECONDS
        while clock.monotonic() < end:
            heard += transport.read(end - clock.monotonic())
        said = describe(heard)
        if "family '" in said:
            return said
    return ""
