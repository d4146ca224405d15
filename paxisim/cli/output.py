"""Writing what a verb makes: never over a file unasked, never half."""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from paxisim.errors import InvalidValueError, OutputExistsError
from paxisim.files import whole_file

if TYPE_CHECKING:
    from paxisim.calibrate.calibration import Calibration

WIDTH = 80  # columns of a terminal


def printable(text: str) -> str:
    """The text as a terminal may have it: what is no printable character, but for line ends and tabs, as its escape.

    Names come from files, and an escape sequence in one could rewrite what is on the screen.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


class PrintableOutput(io.TextIOBase):
    """Standard output whose text is made `printable`; `terminal` takes what a verb writes over its own line."""

    def __init__(self, terminal: TextIO) -> None:
        """Write on to `terminal`."""
        self.terminal = terminal

    def write(self, text: str, /) -> int:
        """Write it, printable."""
        self.terminal.write(printable(text))
        return len(text)

    def flush(self) -> None:
        """Flush the terminal."""
        self.terminal.flush()

    def isatty(self) -> bool:
        """Whether it is one."""
        return self.terminal.isatty()

    def fileno(self) -> int:
        """The terminal's descriptor."""
        return self.terminal.fileno()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """The terminal's encoding."""
        return self.terminal.encoding


def live_line(text: str, end: str = "") -> None:
    """Write a line of this program's own, with its carriage return, to a terminal."""
    print(text, end=end, file=getattr(sys.stdout, "terminal", sys.stdout), flush=True)


def progress(what: str) -> None:
    """Say on a terminal what is going on; in a pipe or a log nothing."""
    if sys.stderr.isatty():
        print(printable(f"{what} ..."), file=sys.stderr, flush=True)


def check_output(path: Path, force: bool, suffix: str = "") -> None:
    """Refuse an output path before any work is done.

    Args:
        path: The file to be written.
        force: Whether it may exist.
        suffix: What it must end in, e.g. ``".png"``; default: anything.

    Raises:
        OutputExistsError: The file exists and `force` is off.
        InvalidValueError: The path is a folder or ends in something else, or its folder does not exist or may not be
            written to.
    """
    if path.is_dir():
        raise InvalidValueError(f"the output path must be a file, {path} is a folder")
    if suffix and path.suffix.lower() != suffix:
        raise InvalidValueError(f"the output must end in {suffix}, got {path}")
    check_folder(path)
    if path.exists() and not force:
        raise OutputExistsError(f"{path} exists; --force overwrites it")


def check_folder(path: Path) -> None:
    """Refuse a path that cannot be made.

    Raises:
        InvalidValueError: Its folder does not exist or may not be written to.
    """
    folder = path.absolute().parent
    if not folder.is_dir():
        raise InvalidValueError(f"the output's folder does not exist: {folder}")
    try:
        tempfile.TemporaryFile(dir=folder).close()  # what the permissions say is not all, as on a read-only disk
    except OSError as error:
        raise InvalidValueError(f"cannot write {path}: {error.strerror} in {folder}") from None


def write_output(path: Path, content: str | bytes, force: bool) -> None:
    """Write a file whole or not at all.

    Raises:
        OutputExistsError: The file exists and `force` is off.
        InvalidValueError: The path cannot be an output.
    """
    check_output(path, force)
    data = content.encode() if isinstance(content, str) else content
    with whole_file(path) as temporary:
        temporary.write_bytes(data)


def size_text(size: int) -> str:
    """A number of bytes for people, e.g. ``"34 kB"``."""
    return f"{size / 1e3:.0f} kB" if size < 1e6 else f"{size / 1e6:.1f} MB"


def png(figure) -> bytes:
    """A matplotlib figure as the bytes of a PNG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150, bbox_inches="tight")
    return buffer.getvalue()


def load_calibration(path: Path | None) -> Calibration | None:
    """The calibration in a file that ``--calibration`` names."""
    if path is None:
        return None
    from paxisim.calibrate.calibration import Calibration

    return Calibration.load(path)
