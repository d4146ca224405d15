"""Document: objects saved as JSON files that state their format, and dataclasses rebuilt from JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields, is_dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, ClassVar, TypeVar, Union, get_args, get_origin, get_type_hints

from paxisim.errors import InvalidValueError, PaxisimError, UnknownNameError
from paxisim.files import parse_file, parse_json, whole_file

_WORDS = {str: "text", list: "list", dict: "JSON object"}
_Kind = TypeVar("_Kind", bound="Document")


class Document:
    """Base class of objects that are saved as a JSON object with the entry ``format``.

    A subclass states `FORMAT`, the names of its entries in `ENTRIES`, and how it is converted in `_entries` and
    `_from_entries`.
    """

    FORMAT: ClassVar[str]
    """What the file is, and the version of its form, as ``"paxisim-chain/1"``."""
    ENTRIES: ClassVar[tuple[str, ...]]
    """Names of all entries but ``format``."""

    def _entries(self) -> dict[str, Any]:
        """Return the entries of the JSON object, without ``format``."""
        raise NotImplementedError

    @classmethod
    def _from_entries(cls: type[_Kind], entries: dict[str, Any]) -> _Kind:
        """Return the object; what the entries lack or misuse may raise any of the errors that `from_document` names."""
        raise NotImplementedError

    def to_document(self) -> dict[str, Any]:
        """Return the object as nested dicts, lists, texts and numbers for JSON."""
        entries = self._entries()
        return {"format": self.FORMAT, **{name: entries[name] for name in self.ENTRIES}}

    @classmethod
    def from_document(cls: type[_Kind], document: Any) -> _Kind:
        """Return the object that `to_document` describes.

        Raises:
            InvalidValueError: The document has another format, or lacks or misuses an entry.
            UnknownNameError: This version does not know an entry, or a name in it.
        """
        name = cls.__name__.lower()
        if not isinstance(document, dict) or document.get("format") != cls.FORMAT:
            found = f", got {document['format']!r:.60}" if isinstance(document, dict) and "format" in document else ""
            raise InvalidValueError(f"expected a {name}, a JSON object of format {cls.FORMAT!r}{found}")
        entries = {key: value for key, value in document.items() if key != "format"}
        for key in entries:
            if key not in cls.ENTRIES:
                raise UnknownNameError(f"entry of a {name}", key, cls.ENTRIES)
        try:
            return cls._from_entries(entries)
        except PaxisimError:
            raise
        except (
            AttributeError,
            LookupError,
            ArithmeticError,
            RecursionError,
            SyntaxError,
            TypeError,
            ValueError,
        ) as error:
            raise InvalidValueError(f"the {name} lacks or misuses {error}") from error

    def to_json(self) -> str:
        """Return the object as JSON text, which `from_json` restores.

        Raises:
            InvalidValueError: A value cannot be written as JSON, such as a function.
        """
        try:
            return json.dumps(self.to_document(), indent=1, allow_nan=False)
        except (TypeError, ValueError) as error:
            name = type(self).__name__
            raise InvalidValueError(f"this {name} cannot be saved, create it anew instead: {error}") from error

    @classmethod
    def from_json(cls: type[_Kind], text: str) -> _Kind:
        """Return the object that `to_json` wrote.

        Raises:
            InvalidValueError: The text is not JSON or has another format, or an entry cannot be used.
            UnknownNameError: This version does not know an entry, or a name in it.
        """
        return cls.from_document(parse_json(text))


class DocumentFile(Document):
    """A `Document` with one file."""

    def save(self, path: str | Path) -> None:
        """Write `to_json` to a file; an existing file is replaced atomically.

        Raises:
            InvalidValueError: The path is a folder, or its folder does not exist; or `to_json` raises it.
            OSError: The file cannot be written.
        """
        text = self.to_json()
        with whole_file(Path(path)) as temporary:
            temporary.write_text(text + "\n", encoding="utf-8")

    @classmethod
    def load(cls: type[_Kind], path: str | Path) -> _Kind:
        """Read a file that `save` wrote; raises as `from_json` does, and FileNotFoundError if it does not exist."""
        return parse_file(Path(path), cls.from_json)


def built(kind: Any, document: Any) -> Any:
    """Rebuild a value from the JSON of its `dataclasses.asdict`.

    Args:
        kind: Type of the value: a dataclass, a tuple of one type, an optional of either, or a native JSON type.
        document: The parsed JSON.

    Raises:
        KeyError: A field without a default is missing.
        TypeError: A field is not an object, a list, a number or a text where one was expected.
    """
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        given = [
            f for f in fields(kind) if f.name in document or (f.default is MISSING and f.default_factory is MISSING)
        ]
        return kind(**{f.name: built(hints[f.name], document[f.name]) for f in given})  # type: ignore[operator]
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
    """Return nested dataclasses, mappings, lists and numbers as JSON has them: None in place of non-finite numbers."""
    if is_dataclass(value) and not isinstance(value, type):
        return finite(asdict(value))
    if isinstance(value, Mapping):
        return {name: finite(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
