"""Families of boards: the only table that lists them.

A family is a protocol. To add one, write its driver (a `paxisim.hw.families.board.Board`) and its emulation (a
`paxisim.hw.families.emulated_board.EmulatedBoard`), and add a row here: see `docs/how-to/add-a-board.md`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

Range = tuple[tuple[int, int, int], tuple[int, int, int]]
"""Minimum and maximum counts of x, y and z."""

BYTES: Range = ((-128, -128, 0), (127, 127, 255))
"""Range of a taxel of three bytes whose normal force is unsigned."""


@dataclass(frozen=True)
class Family:
    """One row of the table: what a profile of the family needs, and where its classes are.

    Attributes:
        driver: Class of the driver, ``module:Class``, imported when a sensor is opened.
        emulation: Class of the emulated board, ``module:Class``.
        settings: Keys that `Profile.settings` may hold, with their types.
        counts: Range of a taxel's counts, which are whole numbers; None: the counts are floats of any size.
        unit: Unit of the tensor: ``"N"``, ``"uT"`` (microtesla) or ``"counts"``.
        transport: Function that opens the port, ``module:function``, see `paxisim.hw.link.transport.open_transport`.
        port: Callable that makes an emulated port, ``module:callable``, see `paxisim.hw.emulation.port.Port`.
    """

    driver: str
    emulation: str
    settings: Mapping[str, type] = field(default_factory=dict)
    counts: Range | None = BYTES
    unit: str = "N"
    transport: str = "paxisim.hw.link.transport:open_transport"
    port: str = "paxisim.hw.emulation.pseudo_terminal:PseudoTerminal"


FAMILIES: dict[str, Family] = {
    "control-box": Family(
        driver="paxisim.hw.families.control_box.driver:ControlBox",
        emulation="paxisim.hw.families.control_box.emulated:ControlBox",
        settings={"mode": int, "address": int, "resultant_address": int},
    ),
    "hand-board": Family(
        driver="paxisim.hw.families.hand_board.driver:HandBoard",
        emulation="paxisim.hw.families.hand_board.emulated:HandBoard",
        settings={"signed_normal": bool},
    ),
    "serial-converter": Family(
        driver="paxisim.hw.families.serial_converter.driver:SerialConverter",
        emulation="paxisim.hw.families.serial_converter.emulated:SerialConverter",
        settings={"address": int, "resultant_address": int, "scan": bool, "part": str},
    ),
    "high-speed": Family(
        driver="paxisim.hw.families.high_speed.driver:HighSpeed",
        emulation="paxisim.hw.families.high_speed.emulated:HighSpeedBoard",
        settings={"palm_counts": str},
    ),
    "magnetometer-board": Family(
        driver="paxisim.hw.families.magnetometer_board.driver:MagnetometerBoard",
        emulation="paxisim.hw.families.magnetometer_board.emulated:MagnetometerBoard",
        settings={"text": bool},
        counts=None,
        unit="uT",
    ),
    "xela-counts": Family(
        driver="paxisim.hw.families.xela_server.driver:XelaCounts",
        emulation="paxisim.hw.families.xela_server.emulated:XelaCounts",
        settings={"model": str},
        counts=None,
        unit="counts",
        transport="paxisim.hw.link.websocket:open_websocket",
        port="paxisim.hw.families.xela_server.emulated:listen",
    ),
    "xela-forces": Family(
        driver="paxisim.hw.families.xela_server.driver:XelaForces",
        emulation="paxisim.hw.families.xela_server.emulated:XelaForces",
        settings={"model": str},
        counts=None,
        transport="paxisim.hw.link.websocket:open_websocket",
        port="paxisim.hw.families.xela_server.emulated:listen",
    ),
}
"""Families, keyed by the name that profiles use."""
