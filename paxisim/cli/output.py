"""Output of the commands: files are written whole and overwritten only with ``--force``."""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path
from typing import TextIO

from paxisim.errors import InvalidValueError, OutputExistsError
from paxisim.files import whole_file

TERMINAL_COLUMNS = 80  # columns of a terminal


def printable(text: str) -> str:
    """Escape all characters that are not printable, except line ends and tabs.

    Names come from files, and an escape sequence in a name could rewrite the screen.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


class PrintableOutput(io.TextIOBase):
    """Standard output that makes all text `printable`.

    Attributes:
        terminal: The stream behind it, for a command that redraws its own line.
    """

    def __init__(self, terminal: TextIO) -> None:
        """Wrap `terminal`."""
        self.terminal = terminal

    def write(self, text: str, /) -> int:
        """Write `text`, made printable."""
        self.terminal.write(printable(text))
        return len(text)

    def flush(self) -> None:
        """Flush the terminal."""
        if not self.terminal.closed:  # this object may be finalised later than the terminal is closed
            self.terminal.flush()

    def isatty(self) -> bool:
        """Return whether the stream is a terminal."""
        return self.terminal.isatty()

    def fileno(self) -> int:
        """Return the terminal's file descriptor."""
        return self.terminal.fileno()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Encoding of the terminal."""
        return self.terminal.encoding


def live_line(text: str, end: str = "") -> None:
    """Write text with control characters, such as a carriage return, to the terminal unescaped."""
    print(text, end=end, file=getattr(sys.stdout, "terminal", sys.stdout), flush=True)


def progress(what: str) -> None:
    """Print the current step to standard error if it is a terminal."""
    if sys.stderr.isatty():
        print(printable(f"{what} ..."), file=sys.stderr, flush=True)


def check_output(path: Path, force: bool, suffix: str = "") -> None:
    """Check an output path before any work is done.

    Args:
        path: Output file.
        force: Whether the file may already exist.
        suffix: Required suffix, e.g. ``".png"``; default: any.

    Raises:
        OutputExistsError: The file exists and `force` is off.
        InvalidValueError: The path is a folder or has another suffix, or its folder does not exist or is not writable.
    """
    if path.is_dir():
        raise InvalidValueError(f"the output path must be a file, {path} is a folder")
    if suffix and path.suffix.lower() != suffix:
        raise InvalidValueError(f"the output must end in {suffix}, got {path}")
    check_folder(path)
    if path.exists() and not force:
        raise OutputExistsError(f"{path} exists; --force overwrites it")


def named_after(source: str | Path, ending: str) -> Path:
    """Return the default output for an input file: its name with another ending, in the working directory."""
    return Path(f"{Path(source).stem}{ending}")


def check_no_file(folder: Path) -> None:
    """Check that an output folder is not an existing file.

    Raises:
        InvalidValueError: It is a file.
    """
    if folder.exists() and not folder.is_dir():
        raise InvalidValueError(f"the output must be a folder, but {folder} is a file")


def check_folder(path: Path) -> None:
    """Check that a path can be created.

    Raises:
        InvalidValueError: The folder of the path does not exist or is not writable.
    """
    folder = path.absolute().parent
    if not folder.is_dir():
        raise InvalidValueError(f"the output's folder does not exist: {folder}")
    try:
        tempfile.TemporaryFile(dir=folder).close()  # permissions do not show a read-only disk
    except OSError as error:
        raise InvalidValueError(f"cannot write {path}: {error.strerror} in {folder}") from None


def write_output(path: Path, content: str | bytes, force: bool) -> None:
    """Write a file completely or not at all.

    Raises:
        OutputExistsError: The file exists and `force` is off.
        InvalidValueError: The path cannot be written.
    """
    check_output(path, force)
    data = content.encode() if isinstance(content, str) else content
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


def size_text(size: int) -> str:
    """Format a number of bytes, e.g. ``"34 kB"``."""
    return f"{size / 1e3:.0f} kB" if size < 1e6 else f"{size / 1e6:.1f} MB"


def png(figure) -> bytes:
    """Return a matplotlib figure as the bytes of a PNG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150, bbox_inches="tight")
    return buffer.getvalue()
