"""The shell command: ``paxisim VERB``, one file a verb."""

from __future__ import annotations

import contextlib
import functools
import io
import os
import shutil
import sys
import textwrap
import warnings
from collections.abc import Callable
from typing import Annotated, Any, Union

import tyro

from paxisim._version import __version__
from paxisim.cli.attach import attach
from paxisim.cli.calibrate import calibrate
from paxisim.cli.convert import convert
from paxisim.cli.demo import demo
from paxisim.cli.diagnose import diagnose
from paxisim.cli.emulate import emulate
from paxisim.cli.example import example
from paxisim.cli.info import info
from paxisim.cli.live import live
from paxisim.cli.output import PrintableOutput, printable
from paxisim.cli.pad import pad
from paxisim.cli.protocol import protocol
from paxisim.cli.record import record
from paxisim.cli.replay import replay
from paxisim.cli.scene import scene_init, scene_make
from paxisim.cli.sensor import sensor_check, sensor_profiles, sensor_quality
from paxisim.cli.sensors import sensors
from paxisim.cli.view import view
from paxisim.errors import PaxisimError

VERBS = {
    "demo": demo,
    "example": example,
    "sensors": sensors,
    "pad": pad,
    "attach": attach,
    "view": view,
    "emulate": emulate,
    "record": record,
    "info": info,
    "convert": convert,
    "live": live,
    "calibrate": calibrate,
    "protocol": protocol,
    "replay": replay,
    "diagnose": diagnose,
}
SCENE_VERBS = {"init": scene_init, "make": scene_make}
SENSOR_VERBS = {"check": sensor_check, "quality": sensor_quality, "profiles": sensor_profiles}


def main(arguments: list[str] | None = None) -> int:
    """Run a verb.

    Args:
        arguments: The words after ``paxisim``; default: those of the process.

    Returns:
        The exit status: 0, or 2 after one line on stderr that says what was wrong.
    """
    warnings.showwarning = _show_warning
    if (sys.argv[1:] if arguments is None else arguments) == ["--version"]:
        print(f"paxisim {__version__}")
        return 0
    try:
        verb = parse(arguments)
        with contextlib.redirect_stdout(PrintableOutput(sys.stdout)):
            verb()
            sys.stdout.flush()
    except BrokenPipeError:  # who reads the output has seen enough, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (PaxisimError, OSError) as error:
        return _complain(str(error))
    except KeyboardInterrupt:
        print("paxisim: interrupted", file=sys.stderr)
        return 130
    except SystemExit as stop:
        return _complain(stop.code) if isinstance(stop.code, str) else int(stop.code or 0)
    return 0


def parse(arguments: list[str] | None) -> Callable[[], None]:
    """The verb with its options, ready to be called.

    Raises:
        SystemExit: Help was asked for and given (0), or the words do not parse (a sentence that says why).
    """
    said, helped = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(helped):
            return tyro.extras.subcommand_cli_from_dict(
                {name: _deferred(verb) for name, verb in VERBS.items()}
                | {
                    "scene": _group(SCENE_VERBS, "Begin the scene of a recording, or write a ready-made one."),
                    "sensor": _group(SENSOR_VERBS, "Check a real sensor, measure how good it is, list profiles."),
                },
                prog="paxisim",
                description="Magnet-based tactile sensors in MuJoCo. `paxisim VERB --help` explains a verb, "
                "`paxisim --version` says which version this is.",
                args=arguments,
                sort_subcommands=False,
                config=(tyro.conf.FlagCreatePairsOff, tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            print(_wrapped(helped.getvalue()))
            raise
        raise SystemExit(_first_paragraphs(said.getvalue())) from None


def _deferred(verb: Callable[..., None]) -> Callable[..., Callable[[], None]]:
    """Has the options of `verb`, but only returns the call: parsing and running fail differently."""

    @functools.wraps(verb)
    def bind(*args, **options) -> Callable[[], None]:
        return functools.partial(verb, *args, **options)

    return bind


def _group(verbs: dict[str, Callable[..., None]], description: str) -> Callable[..., Callable[[], None]]:
    """A verb that is followed by one of `verbs`."""

    def pick(verb):
        return verb

    choices = tuple(Annotated[Any, tyro.conf.subcommand(n, constructor=_deferred(v))] for n, v in verbs.items())
    pick.__annotations__["verb"] = Union[choices]  # noqa: UP007
    pick.__doc__ = description
    return pick


def _wrapped(text: str) -> str:
    """Lines no longer than the terminal; tyro wraps its boxes but not a verb's description."""
    width = shutil.get_terminal_size().columns
    return "\n".join(textwrap.fill(line, width) if len(line) > width else line for line in text.rstrip().splitlines())


def _first_paragraphs(boxed: str) -> str:
    """What tyro says in a box, without the box and its rules: what is wrong, and what there is instead."""
    paragraphs: list[list[str]] = [[]]
    for line in boxed.splitlines()[1:]:
        text = line.strip("│╭╮╰╯ \n")
        if text.startswith(("For full helptext", "Got errors")):
            break
        if text.strip("─- "):
            paragraphs[-1] += text.split()
        elif paragraphs[-1]:
            paragraphs.append([])
    return "; ".join(" ".join(words).removesuffix(".") for words in paragraphs[:2] if words) + "; see paxisim --help"


def _complain(message: str) -> int:
    print(f"paxisim: error: {printable(' '.join(message.split()))}", file=sys.stderr)
    return 2


def _show_warning(message, category, filename, lineno, file=None, line=None) -> None:
    print(f"paxisim: warning: {printable(' '.join(str(message).split()))}", file=sys.stderr)
