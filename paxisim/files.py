"""Atomic writing of files and folders, and parsing of untrusted JSON, TOML and files with paxisim's own errors."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from paxisim.errors import InvalidValueError, OutputExistsError, UnknownNameError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]

_Parsed = TypeVar("_Parsed")


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder, which replaces `path` at the end.

    After an error the temporary file is removed, and an existing file at `path` stays as it was.

    Raises:
        InvalidValueError: The path is a folder, or its folder does not exist.
    """
    if path.is_dir():
        raise InvalidValueError(f"the output path must be a file, {path} is a folder")
    if not path.absolute().parent.is_dir():
        raise InvalidValueError(f"the output's folder does not exist: {path.absolute().parent}")
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    try:
        yield temporary
        os.replace(temporary, path)
    except BaseException as error:
        with contextlib.suppress(FileNotFoundError):
            temporary.unlink()
        if isinstance(error, OSError) and error.errno is not None and error.filename in (None, str(temporary)):
            error.filename = str(path)  # as for a full disk
        raise


@contextlib.contextmanager
def all_or_none(paths: Iterable[Path]) -> Iterator[None]:
    """Remove those of several files that are new, if writing one of them fails."""
    new = [path for path in paths if not path.exists()]
    try:
        yield
    except BaseException:
        for path in new:
            path.unlink(missing_ok=True)
        raise


@contextlib.contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Yield a new temporary folder beside `path`, which becomes `path` at the end and is removed after an error.

    Raises:
        OutputExistsError: The path already exists.
        InvalidValueError: Its parent folder does not exist.
    """
    refuse_existing(path)
    if not path.absolute().parent.is_dir():
        raise InvalidValueError(f"the output's folder does not exist: {path.absolute().parent}")
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(4)}")
    temporary.mkdir()
    try:
        yield temporary
        os.rename(temporary, path)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def refuse_existing(path: Path) -> None:
    """Check that the path of a folder to be created does not exist yet.

    Raises:
        OutputExistsError: The path already exists.
    """
    if path.exists() or path.is_symlink():
        raise OutputExistsError(f"{path} exists; folders are never overwritten, choose a new name")


def parse_file(path: Path, parse: Callable[[str], _Parsed]) -> _Parsed:
    """Return the result of `parse` for the file's text.

    Raises:
        InvalidValueError: The file is not UTF-8 text, or `parse` raises this error; the message names the file.
        UnknownNameError: `parse` raises this error; the message names the file.
        FileNotFoundError: The file does not exist.
    """
    try:
        return parse(path.read_text(encoding="utf-8"))
    except UnicodeDecodeError as error:
        raise InvalidValueError(
            f"{path}: expected UTF-8 text, got the byte {error.object[error.start]:#04x}"
        ) from error
    except InvalidValueError as error:
        raise InvalidValueError(f"{path}: {error}") from error
    except UnknownNameError as error:
        raise error.advised(f"it is in {path}") from error


def parse_json(text: str | bytes) -> Any:
    """Parse a JSON text.

    Raises:
        InvalidValueError: The text is not JSON, is nested too deeply, or has a number of thousands of digits.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise InvalidValueError("the JSON cannot be read: it is nested too deeply") from None
    except ValueError as error:
        raise InvalidValueError(f"not JSON: {error}") from error


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a TOML text.

    Raises:
        InvalidValueError: The text is not TOML, is nested too deeply, or has a number of thousands of digits.
    """
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InvalidValueError("the TOML cannot be read: it is nested too deeply") from None
    except ValueError as error:
        raise InvalidValueError(f"not TOML: {error}") from error
