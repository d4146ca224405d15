"""Document: dataclasses from what JSON holds of them, and numbers that JSON can hold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints


def built(kind: Any, document: Any) -> Any:
    """What `dataclasses.asdict` and JSON made of a value, as it was.

    Args:
        kind: The type: a dataclass, a tuple of one type, either of them or None, or what JSON holds itself.
        document: From JSON.

    Raises:
        KeyError: A field is missing.
        TypeError: A field is no object or no list where one was expected.
    """
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        return kind(**{f.name: built(hints[f.name], document[f.name]) for f in fields(kind)})  # type: ignore[operator]
    if get_origin(kind) is tuple:
        return tuple(built(get_args(kind)[0], item) for item in document)
    if get_origin(kind) in (Union, UnionType):
        some = next(item for item in get_args(kind) if item is not NoneType)
        return None if document is None else built(some, document)
    return document


def finite(value: Any) -> Any:
    """Mappings, lists and numbers, with None for numbers that JSON has none for."""
    if isinstance(value, Mapping):
        return {name: finite(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
