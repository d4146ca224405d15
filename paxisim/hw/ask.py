"""Ask: who is on a line that does not answer the family it was opened as."""

from __future__ import annotations

from paxisim.hw.clock import Clock
from paxisim.hw.recognise import describe
from paxisim.hw.transport import Transport

WAIT = 0.15
"""Seconds that a board may take to say its version; 10 ms were seen."""
IDS = range(9)
"""Where sensors on a serial converter answer."""


def who_answers(transport: Transport, clock: Clock) -> str:
    """Ask for the version in each family's language, which changes nothing on a board of another family.

    Returns:
        What answered, as `describe` says it; empty where nothing did.
    """
    for request in _questions():
        transport.discard_input()
        transport.write(request)
        heard = b""
        end = clock.monotonic() + WAIT
        while clock.monotonic() < end:
            heard += transport.read(end - clock.monotonic())
        said = describe(heard)
        if "family '" in said:
            return said
    return ""


def _questions() -> list[bytes]:
    from paxisim.hw.frames import control_box, high_speed, serial_converter

    converter = b"".join(serial_converter.version_request(i).encode() for i in IDS)
    return [control_box.version_request().encode(), high_speed.version_request().encode(), converter]
