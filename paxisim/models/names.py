"""Names of the parts of a pad in MJCF, by which a saved model finds its pads again.

The pad's body has the name of the pad itself.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from lxml import etree

from paxisim.errors import InvalidValueError

_LISTED = 4  # most names in a short list

TAXEL = re.compile(r"^(?P<pad>.+)_taxel_(?P<row>\d+)_(?P<col>\d+)$")
"""Pattern of the name of a taxel geom; ``pad`` includes any prefix that attaching put in front."""


def check(what: str, name: str) -> None:
    """Check that an MJCF file can hold a name.

    Args:
        what: Description of the name, for the message.
        name: Name to check.

    Raises:
        InvalidValueError: The name has a control character or is not valid text.
    """
    try:
        etree.Element("body", name=name)
    except ValueError as error:
        raise InvalidValueError(f"{what} must be text that XML can hold, got {name!r}") from error


def taxel(pad: str, row: int, col: int) -> str:
    """Name of a taxel's geom."""
    return f"{pad}_taxel_{row}_{col}"


def base(pad: str) -> str:
    """Name of the geom drawn behind the taxels."""
    return f"{pad}_base"


def gel(pad: str) -> str:
    """Name of the box site around the gel; its half size along z is half the nominal thickness."""
    return f"{pad}_gel"


def force(pad: str, row: int, col: int) -> str:
    """Name of a taxel's contact sensor."""
    return f"{pad}_force_{row}_{col}"


def touch_grid(pad: str) -> str:
    """Name of the pad's touch_grid sensor and of its site."""
    return f"{pad}_touch_grid"


def listed(names: Sequence[str]) -> str:
    """Return names with commas, but only the first of many."""
    return ", ".join([*names[:_LISTED], *["..."] * (len(names) > _LISTED)])


def described_pads(names: Sequence[str], rows: int, cols: int) -> str:
    """Return how many pads of which taxels there are, and their names."""
    return f"{len(names)} pad{'s' * (len(names) != 1)} of {rows}x{cols} taxels: {listed(names)}"
