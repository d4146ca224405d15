"""Mounts as text for the shell: ``'BODY pos-mm=X,Y,Z quat=W,X,Y,Z replaces=GEOM,GEOM name=NAME'``."""

from __future__ import annotations

import shlex

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.models.mount import Mount, is_index

_KEYS = ("name", "pos-mm", "quat", "replaces")


def parse_mount(text: str) -> Mount:
    """Parse a mount from text; everything but the body may be left out.

    Raises:
        InvalidValueError: A word is not KEY=VALUE, or a value is invalid.
        UnknownNameError: There is no such key.
    """
    body, *words = shlex.split(text) or [""]
    if not body or "=" in body:
        raise InvalidValueError(f"a mount must begin with the name of a body, got {text!r}")
    values: dict[str, str] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals:
            raise InvalidValueError(f"expected KEY=VALUE in a mount, got {word!r}")
        if key not in _KEYS:
            raise UnknownNameError("key of a mount", key, _KEYS)
        values[key] = value
    replaces = [geom for geom in values.get("replaces", "").split(",") if geom]
    return Mount(
        body,
        pos=tuple(1e-3 * v for v in _numbers("pos-mm", values.get("pos-mm", "0,0,0"))),  # type: ignore[arg-type]
        quat=tuple(_numbers("quat", values.get("quat", "1,0,0,0"))),  # type: ignore[arg-type]
        replaces=tuple(int(geom) if is_index(geom) else geom for geom in replaces),
        name=values.get("name", ""),
    )


def format_mount(mount: Mount, between: str = " ") -> str:
    """Format a mount for `parse_mount`, rounded to 1 um and 1e-6, with the white space `between` its words."""
    words = [
        shlex.quote(mount.body),
        "pos-mm=" + ",".join(f"{round(1e3 * v, 3) + 0.0:g}" for v in mount.pos),
        "quat=" + ",".join(f"{round(v, 6) + 0.0:g}" for v in mount.quat),
    ]
    if mount.replaces:
        words.append("replaces=" + shlex.quote(",".join(str(geom) for geom in mount.replaces)))
    if mount.name != mount.body:
        words.append("name=" + shlex.quote(mount.name))
    return between.join(words)


def _numbers(key: str, text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InvalidValueError(f"{key} of a mount must be numbers with commas between them, got {text!r}") from None
