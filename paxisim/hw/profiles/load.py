"""Reading of profiles in TOML: those that ship with paxisim, and a user's own."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.files import parse_toml
from paxisim.hw.profiles.profile import Profile, Slot
from paxisim.layout import TaxelLayout
from paxisim.sensors import Sensor

_NUMBER = (int, float)
# key of a profile file -> required type, and its description in messages
_KEYS: Mapping[str, tuple[type | tuple[type, ...], str]] = {
    "name": (str, "a string"),
    "like": (str, "the name of a known profile"),
    "family": (str, "a string"),
    "axes": (list, "a list of three strings"),
    "pool": (list, "a list of two whole numbers"),
    "resolution": (_NUMBER, "a number"),
    "baud": (int, "a whole number"),
    "rate": (_NUMBER, "a number"),
    "verified": (str, "a string"),
    "notes": (str, "a string"),
    "layout": (dict, "a table"),
    "slots": (list, "a list of tables"),
    "settings": (dict, "a table"),
    "sources": (dict, "a table"),
}
_LAYOUT_KEYS = ("rows", "cols", "pitch", "positions", "normals", "vendor_order", "coordinates")
_MOST_TAXELS = 0xFFFF // 3  # every family gives the length of a message in 16 bits, at three bytes per taxel
_LINES_FROM_ROOT = "lines-from-root"


def known_profiles() -> tuple[str, ...]:
    """Return the names of the profiles that ship with paxisim, including aliases. Needs no optional package."""
    data = _shipped()
    return (*data["profiles"], *data["aliases"])


def load_profile(name: str | os.PathLike[str]) -> Profile:
    """Return the profile of that name, or read one from a TOML file.

    All keys of a profile file (either `like`, or `family`, `layout` and slots are required)::

        name = "my-gripper"               # default: the file's name
        like = "gen2-box-120"             # start from this known profile; the keys below replace its keys
        family = "control-box"            # a key of paxisim.hw.families.table.FAMILIES
        axes = ["-y", "+x", "+z"]         # wire axis, with sign, of the pad's x, y, z
        pool = [2, 2]                     # rows and columns of taxels summed to one
        resolution = 0.1                  # N per count
        baud = 460800
        rate = 300                        # Hz
        verified = "A. User, 2025-03-01, DP-M2826 on connector 1"
        notes = "..."

        [layout]                          # fields of TaxelLayout, in m
        rows = 12
        cols = 10
        pitch = [0.0022, 0.0022]
        vendor_order = [110, 100, ...]    # row-major place of each taxel in the order of the bytes
        positions = [[0.0, 0.0, 0.0], ...]  # with normals, for a curved part; or instead of all of these
        coordinates = "paxini-sdk:PXSR-STDDP03G"

        [[slots]]                         # one per pad, in the tensor's order
        name = "left"
        index = 2                         # port, block, id or module, see Slot

        [settings]                        # see Profile.settings
        mode = 5

        [sources]                         # source of any figure
        rate = "measured with paxisim device quality"

    Args:
        name: A name from `known_profiles`, in upper or lower case, or the path of a ``.toml`` file that holds one
            profile.

    Raises:
        UnknownNameError: There is no such profile.
        InvalidValueError: The file is not a profile.
        OSError: The file cannot be read.
        MissingExtraError: The profile needs the coordinates of a curved part and paxini-sdk is not installed.
    """
    name = os.fspath(name)
    if name.endswith(".toml"):
        return _read(Path(name))
    entry = shipped_entry(name)
    return _build(entry, entry["part"], entry["taxels"])


def as_profile(profile: str | os.PathLike[str] | Profile) -> Profile:
    """Return `profile` itself if it is a `Profile`, else load it with `load_profile`."""
    return profile if isinstance(profile, Profile) else load_profile(profile)


def shipped_entry(name: str) -> dict[str, Any]:
    """Return board, part and profile of the data file merged into one table, without reading coordinates.

    The table has the keys of a profile file, plus ``board``, ``part``, ``model`` and ``taxels``.

    Raises:
        UnknownNameError: There is no such profile.
    """
    data = _shipped()
    key = data["aliases"].get(name.lower(), name.lower())
    if key not in data["profiles"]:
        raise UnknownNameError("profile", name, known_profiles(), "`paxisim sensors` lists them")
    own = data["profiles"][key]
    levels = (data["boards"][own["board"]], data["parts"][own["part"]], own)
    entry: dict[str, Any] = {"name": key}
    for level in levels:
        entry |= level
    for table in ("settings", "sources"):
        entry[table] = {k: v for level in levels for k, v in level.get(table, {}).items()}
    entry["sources"] = {figure: text.strip() for figure, text in entry["sources"].items()}
    entry["notes"] = " ".join(level["notes"].strip() for level in levels if "notes" in level)
    return entry


def format_profiles() -> str:
    """Return the shipped profiles as a plain text table, at most 80 columns wide, without a final newline."""
    rows: list[tuple[str, ...]] = [("name", "family", "taxels", "verified")]
    for name in _shipped()["profiles"]:
        entry = shipped_entry(name)
        layout = entry["layout"]
        taxels = f"{entry['taxels']}, curved" if "coordinates" in layout else f"{layout['rows']} x {layout['cols']}"
        rows.append((name, entry["family"], taxels, "yes" if entry.get("verified") else "no"))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, tuple("-" * width for width in widths))
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines += ["", *(f"{alias} is {name}" for alias, name in _shipped()["aliases"].items())]
    lines += ["verified: tried on a device; try yours with `paxisim device check`"]
    return "\n".join(lines)


@cache
def _shipped() -> dict[str, Any]:
    return parse_toml(files("paxisim").joinpath("data/profiles.toml").read_text(encoding="utf-8"))


def _read(path: Path) -> Profile:
    try:
        document = parse_toml(path.read_text(encoding="utf-8"))
        return _from_document(document, path)
    except UnicodeDecodeError as error:
        raise InvalidValueError(f"{path} is not a profile: it is not UTF-8 text") from error
    except (InvalidValueError, UnknownNameError) as error:
        raise InvalidValueError(f"{path} is not a profile: {error}") from error


def _from_document(document: dict[str, Any], path: Path) -> Profile:
    _check_keys("key", document, _KEYS)
    for key, value in document.items():
        kind, wanted = _KEYS[key]
        if not isinstance(value, kind) or isinstance(value, bool):
            raise InvalidValueError(f"{key} must be {wanted}, got {value!r}")
    entry: dict[str, Any] = {"name": path.stem}
    if "like" in document:
        entry |= shipped_entry(document["like"])
        # the sources of replaced keys do not apply to the user's values
        sources = {figure: text for figure, text in entry["sources"].items() if figure not in document}
        entry |= {"name": path.stem, "verified": "", "sources": sources}
        if "layout" not in document:
            return _build(entry | document, entry["part"], entry["taxels"])
    entry |= document
    for key in ("family", "layout", "slots"):
        if key not in entry:
            raise InvalidValueError(f"it has neither {key} nor a known profile (like = ...) to take it from")
    return _build(entry, entry["name"], None)


def _build(entry: Mapping[str, Any], part: str, taxels: int | None) -> Profile:
    """Build the profile that a complete table describes."""
    optional = ("resolution", "baud", "rate", "settings", "verified", "notes", "sources")
    fields = {key: entry[key] for key in optional if key in entry}
    for key in ("axes", "pool"):
        if key in entry:
            fields[key] = tuple(entry[key])
    for key, text in entry.get("sources", {}).items():
        if not isinstance(text, str):
            raise InvalidValueError(f"sources.{key} must be a string, got {text!r}")
    if "axes" in fields and not all(isinstance(axis, str) for axis in fields["axes"]):
        raise InvalidValueError(f"axes must be {_KEYS['axes'][1]}, got {entry['axes']!r}")
    if "pool" in fields and (len(fields["pool"]) != 2 or not all(_is_whole(n) for n in fields["pool"])):
        raise InvalidValueError(f"pool must be {_KEYS['pool'][1]}, got {entry['pool']!r}")
    return Profile(
        name=entry["name"].lower(),
        family=entry["family"],
        wire_layout=_layout(entry["layout"], part, taxels),
        slots=tuple(_slot(slot) for slot in entry["slots"]),
        **fields,
    )


def _slot(table: Any) -> Slot:
    if not isinstance(table, dict):
        raise InvalidValueError(f"a slot must be a table with name and index, got {table!r}")
    _check_keys("key of a slot", table, ("name", "index"))
    name, index = table.get("name"), table.get("index")
    if not isinstance(name, str) or not name or not isinstance(index, int) or isinstance(index, bool):
        raise InvalidValueError(f"a slot must have a name and a whole number as index, got {table!r}")
    return Slot(name, index)


def _layout(table: Mapping[str, Any], part: str, taxels: int | None) -> TaxelLayout:
    _check_keys("key of layout", table, _LAYOUT_KEYS)
    if "coordinates" in table:
        others = sorted(set(table) - {"coordinates"})
        if others:
            raise InvalidValueError(f"layout has coordinates, so it must not have {', '.join(others)}")
        return _coordinates(str(table["coordinates"]), part, taxels)
    missing = [key for key in ("rows", "cols", "pitch") if key not in table]
    if missing:
        raise InvalidValueError(f"layout lacks {', '.join(missing)}")
    rows, cols = table["rows"], table["cols"]
    # check before allocating anything of that size
    if all(isinstance(n, _NUMBER) for n in (rows, cols)) and max(rows, cols, rows * cols) > _MOST_TAXELS:
        raise InvalidValueError(f"layout must have at most {_MOST_TAXELS} taxels, got rows {rows} and cols {cols}")
    order = table.get("vendor_order")
    if order == _LINES_FROM_ROOT:
        layout = TaxelLayout.from_dict({key: value for key, value in table.items() if key != "vendor_order"})
        upward = np.arange(layout.taxels).reshape(layout.rows, layout.cols)[::-1]
        return replace(layout, vendor_order=tuple(upward.T.ravel().tolist()))
    if order is not None and not (isinstance(order, list) and all(_is_whole(i) for i in order)):
        raise InvalidValueError(f"vendor_order must be a list of whole numbers, got {order!r}")
    return TaxelLayout.from_dict(dict(table))


def _coordinates(source: str, part: str, taxels: int | None) -> TaxelLayout:
    """Return the layout of a curved part, from the optional package that holds its coordinates."""
    if taxels is None:
        taxels = _count(source)
    return Sensor(name=part, maker="PaXini", model=part, rows=1, cols=taxels, coordinates=source).layout


def _count(source: str) -> int:
    """Return the number of taxels of the shipped part with those coordinates."""
    known = {
        p["layout"]["coordinates"]: p["taxels"] for p in _shipped()["parts"].values() if "coordinates" in p["layout"]
    }
    if source not in known:
        raise InvalidValueError(str(UnknownNameError("source of coordinates", source, known)))
    return known[source]


def _check_keys(kind: str, table: Mapping[str, Any], known: Any) -> None:
    for key in table:
        if key not in known:
            raise InvalidValueError(str(UnknownNameError(kind, key, known)))


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
