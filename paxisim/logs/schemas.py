"""The topics of an MCAP recording, and the JSON schemas of their messages, as Foxglove reads them.

| stream | topic | message |
|---|---|---|
| ``measured``, ``simulated`` | ``/tactile/measured``, ``/tactile/simulated`` | `TACTILE` |
| ``covariate/NAME`` | ``/covariate/NAME`` | `SCALAR` or `ARRAY` |
| ``episode`` | ``/episode`` | `EPISODE` |

A number that is not known (NaN) is null.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

FORMAT = "paxisim-recording/1"
# the name of the metadata record that says what the file is
METADATA = "paxisim"
# the attachment that holds the scene's MJCF
SCENE = "scene.xml"

TACTILE_STREAMS = ("measured", "simulated")
COVARIATE = "covariate/"
# the readings' own totals, which boards report beside the taxels
RESULTANT = COVARIATE + "resultant"
# ns since 1970-01-01 that a reader's int64 holds
LATEST = 2**63 - 1
# the one bit of a status that is no error: the resultant is not zero, but every taxel is, as real boards send now and
# then, and as a touch may look that is too weak for each taxel
NO_TAXELS = 0x80


def in_error(status: Sequence[int]) -> list[int]:
    """Numbers of the pads whose status says that what they read is no force."""
    return [pad for pad, code in enumerate(status) if code & ~NO_TAXELS]


_NUMBER = {"type": "number"}
_INTEGER = {"type": "integer"}
_XYZ = {"x": _NUMBER, "y": _NUMBER, "z": _NUMBER}


def _array(items: dict[str, Any], description: str) -> dict[str, Any]:
    return {"type": "array", "items": items, "description": description}


def _message(title: str, description: str, **properties: Any) -> dict[str, Any]:
    timestamp = {
        "type": "object",
        "title": "time",
        "description": "when it was measured, since 1970-01-01 UTC",
        "properties": {"sec": _INTEGER, "nsec": _INTEGER},
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": title,
        "description": description,
        "type": "object",
        "properties": {"timestamp": timestamp, **properties},
        "required": ["timestamp"],
    }


TACTILE = _message(
    "paxisim.Tactile",
    "forces that the object exerts on the taxels (N, or the unit in the file's metadata; pad frame: x right, y down, z "
    "into the pad)",
    sequence={**_INTEGER, "description": "counts the readings; a gap says that so many are missing"},
    total={
        "type": "array",
        "description": "sum over the taxels of each pad (in the unit of the tensor)",
        "items": {"type": "object", "properties": {"pad": {"type": "string"}, **_XYZ}},
    },
    resultant=_array(_NUMBER, "the total force that the board itself reports (N), x y z of each pad"),
    status=_array(
        _INTEGER,
        f"one error byte a pad; 0 is good, and {NO_TAXELS} says that its total is not zero though its taxels are; with "
        "any other the numbers of the pad are no forces",
    ),
    shape=_array(_INTEGER, "pads, 3, rows, cols"),
    force=_array(_NUMBER, "the tensor, flat in C order"),
)
SCALAR = _message("paxisim.Scalar", "one number", value=_NUMBER)
ARRAY = _message(
    "paxisim.Array",
    "an array of numbers",
    shape=_array(_INTEGER, "its shape"),
    value=_array(_NUMBER, "the numbers, flat in C order"),
)
EPISODE = _message(
    "paxisim.Episode", "an episode begins", episode={**_INTEGER, "description": "the number of the episode"}
)
