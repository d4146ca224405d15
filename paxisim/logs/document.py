"""Document: dataclasses rebuilt from JSON, and values restricted to what JSON can represent."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

_WORDS = {str: "text", list: "list", dict: "JSON object"}


def built(kind: Any, document: Any) -> Any:
    """Rebuild a value from the JSON of its `dataclasses.asdict`.

    Args:
        kind: Type of the value: a dataclass, a tuple of one type, an optional of either, or a native JSON type.
        document: The parsed JSON.

    Raises:
        KeyError: A field is missing.
        TypeError: A field is not an object, a list, a number or a text where one was expected.
    """
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        return kind(**{f.name: built(hints[f.name], document[f.name]) for f in fields(kind)})  # type: ignore[operator]
    if kind is float:  # `finite` writes null for NaN
        if document is not None and type(document) not in (int, float):
            raise TypeError(f"expected a number, got {document!r:.60}")
        return math.nan if document is None else float(document)
    wanted = {tuple: list}.get(get_origin(kind) or kind, get_origin(kind) or kind)
    if wanted in (str, list, dict) and not isinstance(document, wanted):
        raise TypeError(f"expected a {_WORDS[wanted]}, got {document!r:.60}")
    if get_origin(kind) is dict and isinstance(document, dict):
        return {name: built(get_args(kind)[1], item) for name, item in document.items()}
    if get_origin(kind) is tuple:
        return tuple(built(get_args(kind)[0], item) for item in document)
    if get_origin(kind) in (Union, UnionType):
        some = next(item for item in get_args(kind) if item is not NoneType)
        return None if document is None else built(some, document)
    return document


def finite(value: Any) -> Any:
    """Return nested mappings, lists and numbers with None in place of non-finite numbers, which JSON lacks."""
    if isinstance(value, Mapping):
        return {name: finite(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
