"""Reading and writing of scenes as TOML."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import MISSING, fields, replace
from pathlib import Path
from typing import Any

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.files import parse_file, parse_toml, whole_file
from paxisim.models.gel import Gel
from paxisim.models.mount import Mount
from paxisim.scene.drive import Drive, ObjectStart
from paxisim.scene.scene import Scene

_NUMBER, _TEXT, _WHOLE, _LIST = "a number", "a string", "a whole number", "a list"
_PAIR, _PAIRS = "a list of 2 numbers", "a list of lists of 2 numbers"
_POSITION, _QUATERNION = "a list of 3 numbers", "a list of 4 numbers"
# keys of each table, with the kind of value that each must have
_SCENE = {
    "mjcf": _TEXT,
    "mode": _TEXT,
    "closing": _TEXT,
    "settle": _NUMBER,
    "pads": _LIST,
    "sensor": _TEXT,
    "pool": _WHOLE,
    "drive": "a list of tables",
    "start": "a list of tables",
    "mount": "a list of tables",
    "gel": "a table",
    "bounds": "a table",
}
_DRIVE = {
    "stream": _TEXT,
    "joint": _TEXT,
    "body": _TEXT,
    "actuator": _TEXT,
    "unit": _TEXT,
    "scale": _NUMBER,
    "offset": "a number or a list of 3 numbers",
    "column": _WHOLE,
    "resolution": _NUMBER,
    "curve": _PAIRS,
    "quaternion": _TEXT,
}
_START = {"body": _TEXT, "pos": _POSITION, "quat": _QUATERNION, "stream": _TEXT, "quaternion": _TEXT}
_MOUNT = {"body": _TEXT, "pos": _POSITION, "quat": _QUATERNION, "replaces": _LIST, "name": _TEXT}
_GEL = {item.name: _NUMBER for item in fields(Gel)}


def read_scene(path: Path) -> Scene:
    """Read a scene from a file; see `paxisim.Scene.load`."""
    scene = parse_file(path, parse_scene)
    return replace(scene, mjcf=path.parent / scene.mjcf)


def parse_scene(text: str) -> Scene:
    """Return the scene described by a TOML text; its `mjcf` is the path exactly as written there.

    Raises:
        InvalidValueError: The text is not TOML, or a value cannot be used.
        UnknownNameError: The text has an unknown key.
    """
    document = parse_toml(text)
    _check("the scene", document, _SCENE)
    if "mjcf" not in document:
        raise InvalidValueError("the scene needs mjcf, the path of its MJCF file")
    plain = {key: document[key] for key in ("mode", "closing", "settle", "sensor", "pool") if key in document}
    gel = document.get("gel", {})
    _check("[gel]", gel, _GEL)
    return Scene(
        document["mjcf"],
        tuple(Drive(**table) for table in _tables(document, "drive", _DRIVE, ("stream",))),
        start=tuple(ObjectStart(**table) for table in _tables(document, "start", _START, ("body",))),
        mounts=tuple(Mount(**table) for table in _tables(document, "mount", _MOUNT, ("body",))),
        pads=tuple(str(name) for name in document.get("pads", ())),
        gel=Gel(**gel),
        bounds=_bounds(document.get("bounds", {})),
        **plain,
    )


def _bounds(table: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    for name, value in table.items():
        if not _fits(value, _PAIR):
            raise InvalidValueError(f"{name} of [bounds] must be {_PAIR}, got {value!r}")
    return {name: (float(value[0]), float(value[1])) for name, value in table.items()}


def _tables(document: Mapping[str, Any], name: str, keys: Mapping[str, str], needed: tuple[str, ...]) -> list[Any]:
    tables = document.get(name, [])
    for number, table in enumerate(tables, start=1):
        what = f"[[{name}]] number {number}"
        if not isinstance(table, dict):
            raise InvalidValueError(f"{what} must be a table")
        _check(what, table, keys)
        for key in needed:
            if key not in table:
                raise InvalidValueError(f"{what} needs {key}")
    return [{k: tuple(v) if isinstance(v, list) else v for k, v in table.items()} for table in tables]


def _check(what: str, table: Mapping[str, Any], keys: Mapping[str, str]) -> None:
    for key, value in table.items():
        if key not in keys:
            raise UnknownNameError(f"key of {what}", key, keys)
        if not _fits(value, keys[key]):
            raise InvalidValueError(f"{key} of {what} must be {keys[key]}, got {value!r}")


def _fits(value: Any, wanted: str) -> bool:
    def number(one: Any) -> bool:
        # integers in TOML have 64 bits, but Python's parser accepts any size
        return isinstance(one, float) or (isinstance(one, int) and not isinstance(one, bool) and abs(one) < 2**63)

    def numbers(count: int, value: Any = value) -> bool:
        return isinstance(value, list) and len(value) == count and all(map(number, value))

    kinds = {
        _TEXT: isinstance(value, str),
        _NUMBER: number(value),
        _WHOLE: isinstance(value, int) and number(value),
        _LIST: isinstance(value, list) and all(isinstance(one, (str, int)) for one in value),
        _PAIR: numbers(2),
        _PAIRS: isinstance(value, list) and all(numbers(2, one) for one in value),
        _POSITION: numbers(3),
        _QUATERNION: numbers(4),
        "a number or a list of 3 numbers": number(value) or numbers(3),
        "a list of tables": isinstance(value, list),
        "a table": isinstance(value, dict),
    }
    return kinds[wanted]


def write_scene(scene: Scene, path: Path) -> None:
    """Write a scene to a file; see `paxisim.Scene.save`."""
    mjcf = scene.mjcf
    if isinstance(mjcf, str) and mjcf.lstrip().startswith("<"):
        beside = path.with_suffix(".xml")
        with whole_file(beside) as temporary:
            temporary.write_text(mjcf, encoding="utf-8")
        mjcf = beside
    relative = os.path.relpath(Path(mjcf).absolute(), path.absolute().parent)
    with whole_file(path) as temporary:
        temporary.write_text(format_scene(scene, Path(relative).as_posix()), encoding="utf-8")


def format_scene(scene: Scene, mjcf: str) -> str:
    """Return the scene as TOML, mostly without default values; `mjcf` is the path to write."""
    lines = [f"mjcf = {_value(mjcf)}"]
    plain = ("mode", "closing", "settle", "pads", "sensor", "pool")
    lines += _entries(scene, plain, always=("mode", "settle"))
    lines += ["", "[gel]", *_entries(scene.gel, tuple(_GEL), always=tuple(_GEL))]
    if scene.bounds:
        lines += ["", "[bounds]", *(f"{_value(name)} = {_value(tuple(ends))}" for name, ends in scene.bounds.items())]
    groups = (("drive", scene.drives, _DRIVE), ("start", scene.start, _START), ("mount", scene.mounts, _MOUNT))
    for name, things, keys in groups:
        for thing in things:
            lines += ["", f"[[{name}]]", *_entries(thing, tuple(keys), always=())]
    return "\n".join(lines) + "\n"


def _entries(thing: Any, names: tuple[str, ...], always: tuple[str, ...]) -> list[str]:
    defaults = {item.name: item.default for item in fields(thing)}
    return [
        f"{name} = {_value(getattr(thing, name))}"
        for name in names
        if name in always or defaults[name] is MISSING or getattr(thing, name) != defaults[name]
    ]


def _value(value: Any) -> str:
    if isinstance(value, str):
        # a JSON string is valid TOML, unless JSON escapes a character beyond 16 bits as two surrogates
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple):
        return "[" + ", ".join(_value(one) for one in value) + "]"
    return repr(value if isinstance(value, int) else float(value))
