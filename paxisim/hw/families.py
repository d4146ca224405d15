"""Families of boards: the only table that lists them.

A family is a protocol. To add one, write its driver (a `paxisim.hw.board.Board`) and its emulation (a
`paxisim.hw.emulation.board.EmulatedBoard`), and add a row here: see `docs/how-to/add-a-board.md`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from paxisim.hw.board import Board
    from paxisim.hw.emulation.board import EmulatedBoard
    from paxisim.hw.emulation.port import Port
    from paxisim.hw.transport import Transport

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
        transport: Function that opens the port, ``module:function``, see `paxisim.hw.transport.open_transport`.
        port: Callable that makes an emulated port, ``module:callable``, see `paxisim.hw.emulation.port.Port`.
    """

    driver: str
    emulation: str
    settings: Mapping[str, type] = field(default_factory=dict)
    counts: Range | None = BYTES
    unit: str = "N"
    transport: str = "paxisim.hw.transport:open_transport"
    port: str = "paxisim.hw.emulation.pseudo_terminal:PseudoTerminal"


FAMILIES: dict[str, Family] = {
    "control-box": Family(
        driver="paxisim.hw.boards.control_box:ControlBox",
        emulation="paxisim.hw.emulation.control_box:ControlBox",
        settings={"mode": int, "address": int, "resultant_address": int},
    ),
    "hand-board": Family(
        driver="paxisim.hw.boards.hand_board:HandBoard",
        emulation="paxisim.hw.emulation.hand_board:HandBoard",
        settings={"signed_normal": bool},
    ),
    "serial-converter": Family(
        driver="paxisim.hw.boards.serial_converter:SerialConverter",
        emulation="paxisim.hw.emulation.serial_converter:SerialConverter",
        settings={"address": int, "resultant_address": int, "scan": bool, "part": str},
    ),
    "high-speed": Family(
        driver="paxisim.hw.boards.high_speed:HighSpeed",
        emulation="paxisim.hw.emulation.high_speed:HighSpeedBoard",
        settings={"palm_counts": str},
    ),
    "magnetometer-board": Family(
        driver="paxisim.hw.boards.magnetometer_board:MagnetometerBoard",
        emulation="paxisim.hw.emulation.magnetometer_board:MagnetometerBoard",
        settings={"text": bool},
        counts=None,
        unit="uT",
    ),
    "xela-counts": Family(
        driver="paxisim.hw.boards.xela_server:XelaCounts",
        emulation="paxisim.hw.emulation.xela_server:XelaCounts",
        settings={"model": str},
        counts=None,
        unit="counts",
        transport="paxisim.hw.websocket:open_websocket",
        port="paxisim.hw.emulation.xela_server:listen",
    ),
    "xela-forces": Family(
        driver="paxisim.hw.boards.xela_server:XelaForces",
        emulation="paxisim.hw.emulation.xela_server:XelaForces",
        settings={"model": str},
        counts=None,
        transport="paxisim.hw.websocket:open_websocket",
        port="paxisim.hw.emulation.xela_server:listen",
    ),
}
"""Families, keyed by the name that profiles use."""


def board_class(family: str) -> type[Board]:
    """Return the driver class of a family."""
    return _load(FAMILIES[family].driver)


def emulated_class(family: str) -> type[EmulatedBoard]:
    """Return the class of the emulated board of a family."""
    return _load(FAMILIES[family].emulation)


def open_port(family: str) -> Callable[[str, int], Transport]:
    """Return the function that opens a port of a family, given its name and baud rate."""
    return _load(FAMILIES[family].transport)


def emulated_port(family: str) -> Port:
    """Return a new port for an emulated board of a family."""
    return _load(FAMILIES[family].port)()


def _load(place: str) -> Any:
    module, name = place.split(":")
    return getattr(import_module(module), name)
