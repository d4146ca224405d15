"""What a table or an archive says about a recording: layout, pads and metadata as one JSON text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import orjson

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs import schemas
from paxisim.logs.aligned import Aligned


def about_text(recording: Aligned) -> str:
    """The text.

    Raises:
        InvalidValueError: The metadata cannot be written as JSON.
    """
    about = {
        "format": schemas.FORMAT,
        "layout": None if recording.layout is None else recording.layout.to_dict(),
        "pads": recording.pads,
        "metadata": recording.metadata,
    }
    try:
        return orjson.dumps(about, option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS).decode()
    except TypeError as error:
        raise InvalidValueError(f"the metadata cannot be written as JSON: {error}") from error


def read_about(path: Path, about: Any) -> dict[str, Any]:
    """The fields ``layout``, ``pads`` and ``metadata`` of an `Aligned`, from what the text holds.

    Raises:
        InvalidValueError: It is not such a text; `path` is for the message.
    """
    given = {"layout": None, "pads": [], "metadata": {}, **about} if isinstance(about, dict) else {}
    layout, pads, metadata = given.get("layout"), given.get("pads"), given.get("metadata")
    if not (isinstance(pads, list) and isinstance(metadata, dict)):
        raise InvalidValueError(f"{path}: 'about' must be a JSON object with a list 'pads' and an object 'metadata'")
    try:
        layout = None if layout is None else TaxelLayout.from_dict(layout)
    except InvalidValueError as error:
        raise InvalidValueError(f"{path}: 'layout' in 'about': {error}") from error
    return {"layout": layout, "pads": tuple(pads), "metadata": metadata}
