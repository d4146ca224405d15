"""Layout, pads and metadata of a recording as one JSON text, as stored in tables and archives."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import orjson

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs import schemas
from paxisim.logs.recording_arrays import RecordingArrays


def about_text(recording: RecordingArrays) -> str:
    """Return the JSON text for a recording.

    Raises:
        InvalidValueError: The metadata cannot be written as JSON.
    """
    about = {
        "format": schemas.FORMAT,
        "layout": None if recording.layout is None else recording.layout.to_dict(),
        "pads": recording.pads,
        "covariates": {name: values.shape[1:] for name, values in recording.covariates.items()},
        "metadata": recording.metadata,
    }
    try:
        return orjson.dumps(about, option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS).decode()
    except TypeError as error:
        raise InvalidValueError(f"the metadata cannot be written as JSON: {error}") from error


def checked_metadata(path: Path, metadata: dict[str, Any]) -> None:
    """Check the metadata entries that readers rely on and that a file from another program may get wrong.

    Raises:
        InvalidValueError: The layout, the pad names, the unit or a time has the wrong type; the message names `path`.
    """
    layout, pads = metadata.get("layout"), metadata.get("pads")
    if pads is not None and not (isinstance(pads, list) and all(isinstance(pad, str) for pad in pads)):
        raise InvalidValueError(f"{path}: pads in its metadata must be a list of names, got {pads!r:.80}")
    if layout is not None:
        try:
            TaxelLayout.from_dict(layout)
        except InvalidValueError as error:
            raise InvalidValueError(f"{path}: layout in its metadata: {error}") from error
    zeros, clocks = metadata.get("time_zero_ns"), metadata.get("episode_clocks")
    if zeros is not None and not _are_times(zeros):
        raise InvalidValueError(f"{path}: time_zero_ns in its metadata must be a list of times, got {zeros!r:.80}")
    if clocks is not None and not (
        isinstance(clocks, list)
        and all(_are_times(clock) and len(clock) == 3 for clock in clocks)
        and all(before[0] <= after[0] for before, after in itertools.pairwise(clocks))
    ):
        raise InvalidValueError(
            f"{path}: episode_clocks in its metadata must hold the first time, time 0 and number of each episode, in "
            f"order, got {clocks!r:.80}"
        )
    unit = metadata.get("unit")
    if unit is not None and not isinstance(unit, str):
        raise InvalidValueError(f"{path}: unit in its metadata must be a text such as N or uT, got {unit!r:.80}")
    start = metadata.get("start")
    if start is not None and not (isinstance(start, (int, float)) and abs(start) < 1e300):
        raise InvalidValueError(f"{path}: start in its metadata must be Unix seconds, got {start!r:.80}")


def _are_times(given: Any) -> bool:
    return isinstance(given, list) and all(type(time) is int and abs(time) <= schemas.LATEST for time in given)


def read_about(path: Path, about: Any) -> dict[str, Any]:
    """Return the fields ``layout``, ``pads`` and ``metadata`` of an `RecordingArrays` from the parsed JSON text.

    Raises:
        InvalidValueError: The document does not have the expected form; the message names `path`.
    """
    given = {"layout": None, "pads": [], "metadata": {}, **about} if isinstance(about, dict) else {}
    layout, pads, metadata = given.get("layout"), given.get("pads"), given.get("metadata")
    if not (isinstance(pads, list) and isinstance(metadata, dict)):
        raise InvalidValueError(f"{path}: 'about' must be a JSON object with a list 'pads' and an object 'metadata'")
    checked_metadata(path, {name: metadata.get(name) for name in ("start", "unit")})
    try:
        layout = None if layout is None else TaxelLayout.from_dict(layout)
    except InvalidValueError as error:
        raise InvalidValueError(f"{path}: 'layout' in 'about': {error}") from error
    return {"layout": layout, "pads": tuple(pads), "metadata": metadata}


def covariate_shapes(about: dict[str, Any]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the covariates' samples as stated in the parsed JSON text; empty in older files."""
    given = about.get("covariates")
    return {
        name: tuple(shape)
        for name, shape in (given.items() if isinstance(given, dict) else ())
        if isinstance(shape, list) and len(shape) < 32 and all(type(n) is int and 0 < n < 2**31 for n in shape)
    }
