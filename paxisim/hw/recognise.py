"""Recognise: identify the board on a line from the bytes received. No I/O."""

from __future__ import annotations

from paxisim.hw.families import FAMILIES, board_class

_SHOWN = 8
_SHOWN_TEXT = 60


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
