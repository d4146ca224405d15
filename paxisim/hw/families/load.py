"""The classes and functions that the table of families names, imported when they are needed."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any

from paxisim.hw.families.table import FAMILIES

if TYPE_CHECKING:
    from paxisim.hw.emulation.port import Port
    from paxisim.hw.families.board import Board
    from paxisim.hw.families.emulated_board import EmulatedBoard
    from paxisim.hw.link.transport import Transport


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
