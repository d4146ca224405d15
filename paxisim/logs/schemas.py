"""Topics of an MCAP recording and the JSON schemas of their messages, readable by Foxglove.

| stream | topic | message |
|---|---|---|
| ``measured``, ``simulated`` | ``/tactile/measured``, ``/tactile/simulated`` | `TACTILE` |
| ``covariate/NAME`` | ``/covariate/NAME`` | `SCALAR` or `ARRAY` |
| ``episode`` | ``/episode`` | `EPISODE` |
| | ``/tactile_layout`` | `LAYOUT`, once, before the first tensor |

An unknown number (NaN) is stored as null.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

FORMAT = "paxisim-recording/1"
# name of the metadata record that describes the file
METADATA = "paxisim"
# name of the attachment that holds the scene's MJCF
SCENE = "scene.xml"

TACTILE_STREAMS = ("measured", "simulated")
COVARIATE = "covariate/"
# the total force that boards report in addition to the taxels
RESULTANT = COVARIATE + "resultant"
# latest time, in ns since 1970-01-01, that fits an int64
LATEST = 2**63 - 1
# the only status bit that is not an error: every taxel is zero but the resultant is not. Real boards send this
# occasionally; a touch too weak for any single taxel can cause it.
NO_TAXELS = 0x80


def in_error(status: Sequence[int]) -> list[int]:
    """Return the indices of the pads whose status marks their readings as invalid."""
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
        "description": "time of measurement since 1970-01-01 UTC",
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
    sequence={**_INTEGER, "description": "counter of readings; it skips the numbers of missing readings"},
    time_error={**_NUMBER, "description": "largest error of the time (s), if the recorder was suspended meanwhile"},
    total={
        "type": "array",
        "description": "sum over the taxels of each pad (in the tensor's unit)",
        "items": {"type": "object", "properties": {"pad": {"type": "string"}, **_XYZ}},
    },
    resultant=_array(_NUMBER, "total force reported by the board itself (N), x y z of each pad"),
    status=_array(
        _INTEGER,
        f"one error byte per pad; 0 is good, and {NO_TAXELS} means that the total is not zero although all taxels are; "
        "with any other value the pad's readings are not forces",
    ),
    shape=_array(_INTEGER, "pads, 3, rows, cols"),
    force=_array(_NUMBER, "the tensor, flattened in C order"),
)
LAYOUT = _message(
    "paxisim.TactileLayout",
    "what the tactile messages of this file have in common",
    pads={"type": "array", "items": {"type": "string"}, "description": "names of the pads, in the order of the tensor"},
    unit={"type": "string", "description": "unit of the tensor: N, uT or counts"},
    rows={**_INTEGER, "description": "rows of taxels, along y of the pad frame"},
    cols={**_INTEGER, "description": "columns of taxels, along x of the pad frame"},
    pitch=_array(_NUMBER, "distance of the rows and of the columns (m)"),
    pitch_known={"type": "boolean", "description": "false if the pitch is a stand-in; missing if it is known"},
    positions=_array(_array(_NUMBER, "x y z"), "places of the taxels in the pad frame (m); missing for a flat grid"),
    normals=_array(_array(_NUMBER, "x y z"), "directions into the pad at the taxels; missing for a flat grid"),
)
LAYOUT_TOPIC = "/tactile_layout"
SCALAR = _message("paxisim.Scalar", "one number", value=_NUMBER)
ARRAY = _message(
    "paxisim.Array",
    "an array of numbers",
    shape=_array(_INTEGER, "its shape"),
    value=_array(_NUMBER, "the numbers, flattened in C order"),
)
EPISODE = _message(
    "paxisim.Episode", "an episode begins", episode={**_INTEGER, "description": "the number of the episode"}
)
