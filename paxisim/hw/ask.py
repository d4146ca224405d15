"""Ask: who is on a line that does not answer the family it was opened as."""

from __future__ import annotations

from paxisim.hw.clock import Clock
from paxisim.hw.families import FAMILIES, board_class
from paxisim.hw.recognise import describe
from paxisim.hw.transport import Transport

WAIT = 0.15
"""Seconds that a board may take to say its version; 10 ms were seen."""


def who_answers(transport: Transport, clock: Clock, family: str) -> str:
    """Ask the questions of each family that has the same kind of port as `family`, see `paxisim.hw.board.Board`.

    Returns:
        What answered, as `describe` says it; empty where nothing did.
    """
    others = [other for other, row in FAMILIES.items() if row.transport == FAMILIES[family].transport]
    for request in [question for other in others for question in board_class(other).questions]:
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
