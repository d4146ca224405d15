"""Shared code of the ``python -m paxisim_insertion.*`` commands: options from signatures, one-line errors."""

from __future__ import annotations

import inspect
import logging
import os
import sys
from collections.abc import Callable

import tyro

import paxisim


def command(function: Callable[..., None], arguments: list[str] | None = None) -> int:
    """Run a function as a shell command.

    Args:
        function: The command; its parameters are the options.
        arguments: Command-line arguments; default: those of the process.

    Returns:
        The exit status: 0, 2 after an error, which is printed as one line on stderr, or 130 after an interrupt.
    """
    logging.getLogger("robosuite_logs").setLevel(logging.ERROR)  # it warns about its own setup
    try:
        tyro.cli(function, args=arguments, config=(tyro.conf.FlagCreatePairsOff,))
        sys.stdout.flush()
    except BrokenPipeError:  # the reader closed the pipe, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (paxisim.PaxisimError, OSError) as error:
        print(f"paxisim_insertion: error: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        hint = "; pass --resume to continue" if "resume" in inspect.signature(function).parameters else ""
        print(f"paxisim_insertion: interrupted{hint}", file=sys.stderr)
        return 130
    return 0
