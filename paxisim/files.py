"""A file or folder that is written whole or not at all, and a file whose errors say which it is."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from paxisim.errors import InvalidValueError, OutputExistsError, UnknownNameError

_Parsed = TypeVar("_Parsed")


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A path to write to in the same folder; what is there at the end takes the place of `path`.

    After an error nothing is left of it, and a file that was at `path` before stays as it was.

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
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            temporary.unlink()
        raise


@contextlib.contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """A new folder beside `path` to write to, which becomes `path` at the end; after an error nothing is left of it.

    Raises:
        OutputExistsError: There is something at the path.
        InvalidValueError: Its folder does not exist.
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
    """Raise if there is something at the path of a folder that is to be made.

    Raises:
        OutputExistsError: There is.
    """
    if path.exists() or path.is_symlink():
        raise OutputExistsError(f"{path} exists; a folder is never written over, name a new one")


def parse_file(path: Path, parse: Callable[[str], _Parsed]) -> _Parsed:
    """What `parse` makes of the file's text.

    Raises:
        InvalidValueError: The file is no UTF-8 text, or `parse` raises it; the message names the file.
        UnknownNameError: `parse` raises it; the message names the file.
        FileNotFoundError: There is no such file.
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
