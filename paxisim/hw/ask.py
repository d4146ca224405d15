"""Ask: identify the board on a line where the expected family does not answer."""

from __future__ import annotations

from paxisim.hw.clock import Clock
from paxisim.hw.families import FAMILIES, board_class
from paxisim.hw.recognise import describe
from paxisim.hw.transport import Transport

VERSION_SECONDS = 0.15
"""Time (s) that a board may take to report its version; 10 ms was observed."""


def who_answers(transport: Transport, clock: Clock, family: str) -> str:
    """Send the questions of each family that uses the same kind of port as `family`, see `paxisim.hw.board.Board`.

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
