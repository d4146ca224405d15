"""Shared code of the commands of this package and of `paxisim_lab`: options from signatures, one-line errors."""

from __future__ import annotations

import contextlib
import functools
import inspect
import io
import itertools
import logging
import os
import sys
from collections.abc import Callable
from typing import Any

import tyro

import paxisim


def command(function: Callable[..., None], arguments: list[str] | None = None) -> int:
    """Run a function as a shell command.

    Args:
        function: The command, the only one of its module; its parameters are the options.
        arguments: Command-line arguments; default: those of the process.

    Returns:
        The exit status: 0, 2 after an error, which is printed as one line on stderr, or 130 after an interrupt.

    Raises:
        SystemExit: With status 0, after the requested help was printed.
    """
    logging.getLogger("robosuite_logs").setLevel(logging.ERROR)  # it warns about its own setup
    try:
        parse(function, arguments)()
        sys.stdout.flush()
    except BrokenPipeError:  # the reader closed the pipe, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (paxisim.PaxisimError, OSError) as error:
        print(f"{_module(function)}: error: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        hint = "; pass --resume to continue" if "resume" in inspect.signature(function).parameters else ""
        print(f"{_module(function)}: interrupted{hint}", file=sys.stderr)
        return 130
    return 0


def parse(function: Callable[..., None], arguments: list[str] | None) -> Callable[[], None]:
    """Return the command with its options, ready to be called.

    Raises:
        SystemExit: With status 0, after the requested help was printed.
        InvalidValueError: The arguments are not options of the command.
    """
    program = f"python -m {_module(function)}"

    @functools.wraps(function)
    def bind(*args: Any, **options: Any) -> Callable[[], None]:
        return functools.partial(function, *args, **options)

    box = io.StringIO()
    try:
        with contextlib.redirect_stderr(box):
            return tyro.cli(bind, prog=program, args=arguments, config=(tyro.conf.FlagCreatePairsOff,))
    except SystemExit as stop:
        if not stop.code:
            raise
        raise paxisim.InvalidValueError(f"{_reason(box.getvalue())}; see {program} --help") from None


def _module(function: Callable[..., None]) -> str:
    """Return the name of the function's module, also where that runs as the program."""
    spec = getattr(sys.modules["__main__"], "__spec__", None)
    return spec.name if function.__module__ == "__main__" and spec is not None else function.__module__


def _reason(box: str) -> str:
    """Return the first paragraph of tyro's message, which consists of a heading and paragraphs between rules."""

    def is_rule(line: str) -> bool:
        return not line.strip("─- ")

    lines = [line.strip("│╭╮╰╯ ") for line in box.splitlines()[1:]]
    paragraph = itertools.takewhile(lambda line: not is_rule(line), itertools.dropwhile(is_rule, lines))
    return " ".join(paragraph).removesuffix(".")
