"""The ``paxisim device check``, ``paxisim device quality`` and ``paxisim device profiles`` commands."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import tyro

from paxisim.cli.output import check_output, live_line, named_after, png, printable, progress, write_output
from paxisim.errors import InvalidValueError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from paxisim.hw.commissioning.check import CheckResult, Step, Touch
    from paxisim.hw.device import TactileSensor
    from paxisim.hw.frame import Frame
    from paxisim.hw.profiles.profile import Profile

_LATE = 0.1  # s; frames from before the start of a step may arrive this late
_PATIENCE = 5.0  # s; longest wait for a frame


def device_check(
    port: Annotated[str, tyro.conf.Positional],
    profile: str,
    *,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    seconds: float = 4.0,
    force: bool = False,
) -> None:
    """Find the taxel order, axes and signs of a real sensor by pressing it, and write a profile.

    The command asks for one step after another: press Enter, then follow the instruction. It repeats a step that gave
    no clear signal. It writes the profile only when all steps are done and agree, and nothing after Ctrl-C.

    For a board of magnetometers (AnySkin, ReSkin, eFlesh), the command only finds which chips respond, since each chip
    has its own axes.

    For example:

    paxisim device check /dev/ttyACM0 --profile gen2-box-120 -o my-sensor.toml

    Args:
        port: Port of the sensor.
        profile: Profile to check, closest to the sensor: a name or a .toml file.
        output: Output profile, .toml; default: the name of the profile, with -checked.toml.
        seconds: Duration of each step in seconds.
        force: Overwrite the output if it exists.
    """
    from dataclasses import replace
    from datetime import datetime

    from paxisim.hw.device import open_sensor
    from paxisim.hw.profiles.load import load_profile
    from paxisim.hw.profiles.profile import UnverifiedProfileWarning
    from paxisim.hw.profiles.write import profile_toml

    output = named_after(profile, "-checked.toml") if output is None else output
    if output.suffix != ".toml":
        raise InvalidValueError(f"the output must be a .toml file, so that it can be used as a profile, got {output}")
    check_output(output, force)
    _check_seconds(seconds)
    believed = load_profile(profile)
    measures_field = believed.unit == "uT"
    check = _field_check() if measures_field else _force_check()
    steps = check.steps(believed)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnverifiedProfileWarning)  # this check verifies it
        sensor = open_sensor(port, replace(believed, pool=(1, 1)))
    with sensor:
        said = " ".join(sensor.version().split())
        print(f"{said or believed.name} on {port}")
        if not measures_field:
            print("Look at the sensing surface with the top of the pad up: left, right and down are as you see them.")
        print(f"At each step, press Enter, then follow the instruction and hold, within {seconds:g} s.\n")
        touches: dict[str, Any] = {}
        rest = None
        for number, step in enumerate(steps, 1):
            while True:
                frames = _ask(sensor, step, f"{number}/{len(steps)}", seconds)
                try:
                    if rest is None:
                        rest = check.rest(believed, frames)
                    else:
                        touches[step.name] = check.feel(believed, step, frames, rest)
                        print(f"     {check.say(believed, touches[step.name])}")
                    break
                except InvalidValueError as error:
                    print(f"     {error}. Again:")
    day = datetime.now().astimezone().date().isoformat()
    verified = f"paxisim device check, {day}" + (f", {said}" if said else "")
    result = check.conclude(believed, touches, verified)
    named = replace(result.profile, name=output.stem.lower())
    write_output(output, profile_toml(named), force)
    print()
    for finding in result.findings:
        print(finding)
    print(f"\n{believed.name} was {'wrong where marked with !' if result.changed else 'right'}; wrote {output}")


class _Check(NamedTuple):
    """Steps of a kind of check, and the functions that evaluate the recorded frames."""

    steps: Callable[[Profile], tuple[Step, ...]]
    rest: Callable[..., Any]
    feel: Callable[..., Any]
    say: Callable[[Profile, Any], str]
    conclude: Callable[..., CheckResult]


def _force_check() -> _Check:
    from paxisim.hw.commissioning.check import check_steps, conclude, feel, rest_of

    def say(believed: Profile, touch: Touch) -> str:
        x, y, z = touch.total
        there, unit = believed.slots[touch.pad].name, believed.unit
        return f"felt on the profile's pad {there!r}: {z:.1f} {unit} of normal force, shear {x:+.1f} {y:+.1f} {unit}"

    return _Check(check_steps, rest_of, feel, say, conclude)


def _field_check() -> _Check:
    from paxisim.hw.commissioning.check_field import conclude_field, field_at_rest, field_steps, responses

    def say(believed: Profile, ratio: NDArray[np.float64]) -> str:
        return "the chips' fields changed by " + ", ".join(f"{value:.0f}" for value in ratio) + " times their noise"

    return _Check(lambda _: field_steps(), field_at_rest, responses, say, conclude_field)


def _ask(sensor: TactileSensor, step: Step, number: str, seconds: float):
    """Ask for a step, wait for Enter, and return the recorded forces, ``(T, pads, 3, rows, cols)``."""
    import numpy as np

    print(f"{number:>4} {step.prompt}. Enter: ", end="", flush=True)
    if not sys.stdin.readline():
        raise InvalidValueError("standard input ended before the check was done; nothing was written")
    if not sys.stdin.isatty():
        print()  # on a terminal, Enter has ended the line
    frames = _record(sensor, seconds, sys.stdout.isatty())
    return np.stack([frame.force for frame in frames])


def _record(sensor: TactileSensor, seconds: float, live: bool) -> list[Frame]:
    """Return the frames of the next seconds; if `live`, show each pad's total force meanwhile."""
    first = sensor.latest(_PATIENCE).arrival + _LATE
    frames = [sensor.read(_PATIENCE)]
    while frames[0].arrival < first:
        frames = [sensor.read(_PATIENCE)]
    end, shown = frames[0].arrival + seconds, frames[0].arrival
    while frames[-1].arrival < end or len(frames) < 20:
        frames.append(frame := sensor.read(_PATIENCE))
        if live and frame.arrival > shown + 0.1:
            shown = frame.arrival
            totals = frame.force.sum(axis=(-2, -1))
            felt = "   ".join(
                f"{pad} {z:5.1f} {sensor.profile.unit}" for pad, (_, _, z) in zip(sensor.pads, totals, strict=True)
            )
            live_line("\r" + printable(f"     {max(end - shown, 0):3.0f} s   {felt}")[:78], "\x1b[K")
    if live:
        live_line("\r", "\x1b[K")
    return frames


def device_quality(
    port: Annotated[str, tyro.conf.Positional],
    profile: str,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
    *,
    seconds: float = 10.0,
    force: bool = False,
) -> None:
    """Measure the rate, jitter, noise and drift of a real sensor while nothing touches it.

    For example:

    paxisim device quality /dev/ttyACM0 --profile gen2-box-120 --seconds 60 -o quality.png

    Args:
        port: Port of the sensor.
        profile: Profile of the sensor: a name or a .toml file.
        output: Output picture, .png; default: print the table only.
        seconds: Duration in seconds. Drift shows only after minutes.
        force: Overwrite the output if it exists.
    """
    from paxisim.hw.commissioning.quality import measure_quality
    from paxisim.hw.device import open_sensor
    from paxisim.hw.profiles.load import load_profile

    if output is not None:
        check_output(output, force, ".png")
    _check_seconds(seconds)
    known = load_profile(profile)
    with open_sensor(port, known) as sensor:
        progress(f"recording for {seconds:g} s, leave the sensor untouched")
        frames = _record(sensor, seconds, live=False)
        line = f"{sensor.bad_checksums} bad checksums, {sensor.skipped} stray bytes, {sensor.reconnects} reconnects"
        quality = measure_quality(frames, sensor.layout, sensor.pads, known.rate)
    print(f"{known.name} on {port}")
    print(quality)
    print(f"line: {line}")
    if output is not None:
        from paxisim.viz.quality import plot_quality

        write_output(output, png(plot_quality(quality)), force)
        print(f"picture: {output}")


def device_profiles(name: Annotated[str | None, tyro.conf.Positional] = None) -> None:
    """List the known sensor profiles, or print one as the start of your own.

    For example:

    paxisim device profiles gen2-box-120 > my-sensor.toml

    Args:
        name: Name of the profile to print; default: list all.
    """
    from paxisim.hw.profiles.load import format_profiles, load_profile
    from paxisim.hw.profiles.write import profile_toml

    print(format_profiles() if name is None else profile_toml(load_profile(name)).rstrip())


def _check_seconds(seconds: float) -> None:
    if not 0 < seconds < float("inf"):
        raise InvalidValueError(f"--seconds must be more than 0, got {seconds:g}")
