"""The shell command ``paxisim VERB``, with one file per verb."""

from __future__ import annotations

import contextlib
import functools
import io
import os
import sys
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Union

import tyro

from paxisim._version import __version__
from paxisim.cli.attach import attach
from paxisim.cli.calibrate import calibrate
from paxisim.cli.card import card, judge
from paxisim.cli.convert import convert
from paxisim.cli.demo import demo
from paxisim.cli.device import device_check, device_profiles, device_quality
from paxisim.cli.diagnose import diagnose
from paxisim.cli.emulate import emulate
from paxisim.cli.example import example
from paxisim.cli.help import arranged, misuse, overview, sentence, unknown_verb
from paxisim.cli.info import info
from paxisim.cli.live import live
from paxisim.cli.output import PrintableOutput, printable
from paxisim.cli.pad import pad
from paxisim.cli.plot import plot
from paxisim.cli.protocol import protocol
from paxisim.cli.record import record
from paxisim.cli.replay import replay
from paxisim.cli.scene import scene_compose, scene_make, scene_object
from paxisim.cli.scene_init import scene_init
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
    "plot": plot,
    "calibrate": calibrate,
    "protocol": protocol,
    "replay": replay,
    "diagnose": diagnose,
    "card": card,
    "judge": judge,
}
# verbs that are followed by another
GROUPS = {
    "scene": (
        {"compose": scene_compose, "init": scene_init, "make": scene_make, "object": scene_object},
        "Write the scene of a robot, of a recording, or a ready-made one; find out what a hand holds.",
    ),
    "device": (
        {"check": device_check, "quality": device_quality, "profiles": device_profiles},
        "Check a real sensor, measure its quality, list profiles.",
    ),
}
# the list of verbs, by what a user does
SECTIONS = {
    "Start here": ("demo", "example", "sensors"),
    "Pads in MuJoCo": ("pad", "attach", "view"),
    "A real sensor": ("device", "record", "live", "emulate", "calibrate"),
    "Recordings": ("info", "convert", "plot"),
    "From a recording to a better simulation": ("protocol", "scene", "replay", "diagnose", "card", "judge"),
}


def main(arguments: list[str] | None = None) -> int:
    """Run a verb.

    Args:
        arguments: The words after ``paxisim``; default: the arguments of the process.

    Returns:
        Exit status: 0 on success, 2 after an error that is reported in one line on stderr, 130 after Ctrl-C.
    """
    warnings.showwarning = _show_warning
    words = sys.argv[1:] if arguments is None else arguments
    try:
        status = _run(words)
        sys.stdout.flush()
        return status
    except BrokenPipeError:  # who reads the output has seen enough, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _run(words: Sequence[str]) -> int:
    """Run a verb, or print the version or the list of verbs, and return the exit status.

    Raises:
        BrokenPipeError: Nobody reads the output.
    """
    if list(words) == ["--version"]:
        print(f"paxisim {__version__}")
        return 0
    if not words or list(words) in (["-h"], ["--help"]):
        sentences = {name: _sentence(verb) for name, verb in VERBS.items()}
        print(overview(SECTIONS, sentences | {name: said for name, (_, said) in GROUPS.items()}))
        return 0
    try:
        verb = parse(words)
        with contextlib.redirect_stdout(PrintableOutput(sys.stdout)):
            verb()
            sys.stdout.flush()
    except BrokenPipeError:
        raise
    except PaxisimError as error:
        return _complain(str(error))
    except OSError as error:
        return _complain(sentence(error))
    except KeyboardInterrupt:
        print("paxisim: interrupted", file=sys.stderr)
        return 130
    except SystemExit as stop:
        return _complain(stop.code) if isinstance(stop.code, str) else int(stop.code or 0)
    except Exception as error:
        if not _is_of_opengl(error):
            raise
        said, chosen = " ".join(str(error).split()), os.environ.get("MUJOCO_GL", "")
        return _complain(
            f"MuJoCo cannot be loaded with MUJOCO_GL={chosen} ({said}): without a display set MUJOCO_GL=egl, which "
            "needs PyOpenGL and the system's EGL; unset it if nothing is rendered"
        )
    return 0


def parse(words: Sequence[str]) -> Callable[[], None]:
    """Return the verb with its options, ready to be called.

    Raises:
        SystemExit: With status 0 after printing the requested help, or with an error message if parsing failed.
    """
    if wrong := unknown_verb(words, _known()):
        raise SystemExit(wrong)
    said, helped = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(helped):
            return tyro.extras.subcommand_cli_from_dict(
                {name: _deferred(verb, name in words) for name, verb in VERBS.items()}
                | {name: _group(verbs, description, words) for name, (verbs, description) in GROUPS.items()},
                prog="paxisim",
                description="Magnet-based tactile sensors in MuJoCo. `paxisim VERB --help` explains a verb, "
                "`paxisim --version` prints the version.",
                args=words,
                sort_subcommands=False,
                config=(tyro.conf.FlagCreatePairsOff, tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            print(arranged(helped.getvalue()))
            raise
        raise SystemExit(misuse(said.getvalue(), words, _known())) from None


def _known() -> dict[str, tuple[str, ...]]:
    """Return all verbs, each with the verbs that may follow it."""
    return {**dict.fromkeys(VERBS, ()), **{name: tuple(verbs) for name, (verbs, _) in GROUPS.items()}}


def _sentence(verb: Callable[..., None]) -> str:
    """Return the first sentence of a verb's help."""
    return (verb.__doc__ or "").partition("\n\n")[0]


def _deferred(verb: Callable[..., None], explained: bool) -> Callable[..., Callable[[], None]]:
    """Return a function with the options of `verb` that only returns the call, to tell parse errors from others.

    Args:
        verb: The verb.
        explained: Whether to keep the whole docstring; a list of verbs shows one line for each.
    """

    @functools.wraps(verb)
    def bind(*args, **options) -> Callable[[], None]:
        return functools.partial(verb, *args, **options)

    if not explained:
        bind.__doc__ = _sentence(verb)
    return bind


def _group(
    verbs: Mapping[str, Callable[..., None]], description: str, words: Sequence[str]
) -> Callable[..., Callable[[], None]]:
    """Return a verb that is followed by one of `verbs`."""

    def pick(verb):
        return verb

    choices = tuple(
        Annotated[Any, tyro.conf.subcommand(name, constructor=_deferred(verb, name in words))]
        for name, verb in verbs.items()
    )
    pick.__annotations__["verb"] = Union[choices]  # noqa: UP007
    pick.__doc__ = description
    return pick


def _is_of_opengl(error: Exception) -> bool:
    """Whether the import of MuJoCo failed, which it does if the OpenGL that MUJOCO_GL names is not there."""
    frames = (frame for frame, _ in traceback.walk_tb(error.__traceback__))
    return "MUJOCO_GL" in os.environ and any(
        frame.f_code.co_name == "<module>" and frame.f_globals.get("__name__") == "mujoco" for frame in frames
    )


def _complain(message: str) -> int:
    print(f"paxisim: error: {printable(' '.join(message.split()))}", file=sys.stderr)
    return 2


def _show_warning(message, category, filename, lineno, file=None, line=None) -> None:
    print(f"paxisim: warning: {printable(' '.join(str(message).split()))}", file=sys.stderr)
