"""Profile: which part hangs on the line, and how its bytes become the pad's tensor. Data, not code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.layout import TaxelLayout

FAMILIES = ("control-box", "hand-board", "serial-converter", "high-speed")


@dataclass(frozen=True)
class Slot:
    """Where one pad hangs.

    Attributes:
        name: The pad's name, e.g. ``"left"``.
        index: Its place on the board: the port (control box), block (hand board), id (serial converter) or module
            (high-speed board).
    """

    name: str
    index: int


@dataclass(frozen=True, eq=False)
class Profile:
    """One kind of board with its pads, all of the same part.

    Attributes:
        name: Lower case, as `open_sensor` takes it.
        family: One of `FAMILIES`.
        wire_layout: The taxels as they are on the wire; `vendor_order` lists them in the order of the bytes.
        slots: The pads, in the order of the tensor's first axis.
        axes: For the pad's x, y and z, which axis of the wire it is and with which sign, e.g. ``("-y", "+x", "+z")``.
        pool: Taxels summed to one, as (rows, cols).
        resolution: Newtons a count.
        baud: Bits a second.
        rate: Readings of all pads a second (Hz), nominal; None where no source says.
        settings: What the family's board needs besides, e.g. ``mode`` and ``address``.
        verified: By whom and on what this was tried; empty means that it never was.
        notes: What to know before using it.
        sources: For each figure, where it comes from.
    """

    name: str
    family: str
    wire_layout: TaxelLayout
    slots: tuple[Slot, ...]
    axes: tuple[str, str, str] = ("+x", "+y", "+z")
    pool: tuple[int, int] = (1, 1)
    resolution: float = 0.1
    baud: int = 460800
    rate: float | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    verified: str = ""
    notes: str = ""
    sources: Mapping[str, str] = field(default_factory=dict)

    @property
    def layout(self) -> TaxelLayout:
        """The pad's taxels after pooling: the layout of `Frame.force`."""
        raise NotImplementedError

    def to_force(self, counts: NDArray[np.int16]) -> NDArray[np.float32]:
        """``(..., N, 3)`` counts as they come on the wire -> ``(..., 3, rows, cols)`` float32 newtons, pooled."""
        raise NotImplementedError

    def to_counts(self, force: NDArray[np.floating], gate: int = 0) -> NDArray[np.int16]:
        """``(..., 3, rows, cols)`` newtons of the **wire** layout -> ``(..., N, 3)`` counts, as firmware would send them.

        Rounded to whole counts, components below `gate` counts set to 0, shear clipped to -128..127 and normal force to
        0..255. The inverse of `to_force` up to that, where nothing is pooled.
        """
        raise NotImplementedError


def known_profiles() -> tuple[str, ...]:
    """The names of the profiles that ship with paxisim, aliases included."""
    raise NotImplementedError


def load_profile(name: str) -> Profile:
    """The profile of that name, or that of a TOML file.

    Args:
        name: A name from `known_profiles`, or the path of a file that ends in ``.toml`` and holds one profile.

    Raises:
        UnknownNameError: There is no such profile.
        InvalidValueError: The file is not a profile.
        MissingExtraError: It needs the coordinates of a curved part and paxini-sdk is not installed.
    """
    raise NotImplementedError
