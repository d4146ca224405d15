"""What the ``python -m paxisim_insertion.*`` commands share: options from a function, errors as one line."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable

import tyro

import paxisim


def command(function: Callable[..., None], arguments: list[str] | None = None) -> int:
    """Run a function with its options from the shell.

    Args:
        function: The command; its arguments are the options.
        arguments: The words; default: those of the process.

    Returns:
        The exit status: 0, or 2 after one line on stderr that says what was wrong.
    """
    logging.getLogger("robosuite_logs").setLevel(logging.ERROR)  # it speaks of its own setup
    try:
        tyro.cli(function, args=arguments, config=(tyro.conf.FlagCreatePairsOff,))
        sys.stdout.flush()
    except BrokenPipeError:  # who reads the output has seen enough, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except (paxisim.PaxisimError, OSError) as error:
        print(f"paxisim_insertion: error: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("paxisim_insertion: interrupted; --resume goes on from here", file=sys.stderr)
        return 130
    return 0
