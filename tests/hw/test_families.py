"""The table of families: every row has its own classes, and no unknown name resolves to a family."""

import pytest

from paxisim.hw.families.board import Board
from paxisim.hw.families.emulated_board import EmulatedBoard
from paxisim.hw.families.load import board_class, emulated_class
from paxisim.hw.families.table import FAMILIES


def test_each_family_has_its_own_driver_and_emulation() -> None:
    drivers = {board_class(family) for family in FAMILIES}
    emulations = {emulated_class(family) for family in FAMILIES}
    assert len(drivers) == len(emulations) == len(FAMILIES)
    assert all(issubclass(driver, Board) for driver in drivers)
    assert all(issubclass(emulation, EmulatedBoard) for emulation in emulations)


@pytest.mark.parametrize("family", FAMILIES)
def test_what_is_heard_on_its_line_names_the_family(family: str) -> None:
    driver = board_class(family)
    assert any(f"family '{family}'" in what for what in driver.heard)
    # a family without questions must be recognisable from what it sends unasked
    assert driver.questions or not any("requests" in what for what in driver.heard)


def test_no_family_stands_for_another() -> None:
    for lookup in (board_class, emulated_class):
        with pytest.raises(KeyError):
            lookup("no-such-family")
