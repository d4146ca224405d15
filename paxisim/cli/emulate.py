"""``paxisim emulate``."""

from __future__ import annotations

import importlib
import math
import os
import signal as system_signals
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from paxisim.cli.output import check_folder


def emulate(
    *,
    profile: str = "gen3-highspeed",
    signal: str = "demo",
    reference: str | None = None,
    link: Path | None = None,
    fault: str = "",
    rate_hz: float | None = None,
    gate: int | None = None,
    seed: int = 0,
    seconds: float = math.inf,
) -> None:
    """Emulate a sensor on a port that speaks a profile's protocol byte for byte.

    The first line printed is the name of the port, which any driver opens as a serial port. Runs until Ctrl-C, SIGTERM
    or the end of --seconds, with status 0. For Linux; not tried on macOS.

    For example:

    paxisim emulate --profile gen2-box-120 --link my-sensor

    Args:
        profile: Profile of the sensor: a name or a file.
        signal: Forces on the pads: 'demo' (a press that drags), a recording (.mcap, .npz, .csv), a MuJoCo scene with
            pads that runs in real time (.xml), or MODULE:FUNCTION, a function of the seconds that returns (pads, 3,
            rows, cols) in the profile's unit.
        reference: Read the signal through a magnetic pad from first principles, such as unit:7, or unit:7+memory for a
            gel that creeps.
        link: Symbolic link to the port.
        fault: Faults of the line, as NAME=NUMBER separated by commas: drop, flip, garble (probability per byte), split,
            merge, stall, status (probability per message), stall_seconds, noise (bytes at power-on), unplug_after
            (messages).
        rate_hz: Readings per second; default: the profile's.
        gate: Components below this number of counts read 0; default: 2 on GEN3 boards, as on real parts, else 0.
        seed: Random seed of the faults.
        seconds: Duration in seconds.
    """
    import paxisim
    from paxisim.hw.emulator import Emulator
    from paxisim.hw.end_signals import end_signals
    from paxisim.hw.faults import Faults
    from paxisim.hw.profile import load_profile

    if not seconds >= 0:
        raise paxisim.InvalidValueError(f"--seconds must be 0 or more, got {seconds:g}")
    if link is not None:
        check_folder(link)
    chosen = load_profile(profile)
    felt = make_signal(signal, chosen)
    if reference is not None:
        felt = _as_unit(felt, reference, chosen)
    sensor = Emulator(chosen, felt, rate=rate_hz, gate=gate, faults=Faults.parse(fault), link=link, seed=seed)
    try:
        # however it is asked to end, no link to nowhere stays behind
        with end_signals(system_signals.default_int_handler), sensor:
            print(sensor.port, flush=True)
            _run(sensor, seconds)
    except KeyboardInterrupt:
        pass
    finally:
        if sys.stderr.isatty():
            print(file=sys.stderr)


def _as_unit(felt: Callable[[float], Any], text: str, profile) -> Callable[[float], Any]:
    """What the unit that ``--reference`` names reads of a signal."""
    import paxisim

    make = paxisim.reference_sensor(text)
    if profile.unit != "N":
        raise paxisim.InvalidValueError(
            f"a reference unit reads newtons, but profile {profile.name!r} feels {profile.unit}: choose another profile"
        )
    sensor = make(profile.wire_layout)
    if sensor.covariate_names:
        raise paxisim.InvalidValueError("an emulated board does not know the gripper's opening: leave out +neighbour")
    state, before = None, 0.0

    def read(now: float) -> Any:
        nonlocal state, before
        force = np.asarray(felt(now), dtype=np.float32)
        state = sensor.initial_state(force) if state is None else state
        reading, state = sensor.step(force, state, max(now - before, 0.0))
        before = now
        return reading

    return read


def make_signal(text: str, profile) -> Callable[[float], Any]:
    """The signal that ``--signal`` names, see `emulate`.

    Raises:
        InvalidValueError: It names nothing, or not what it says, or something for other pads.
        OSError: The file cannot be read.
    """
    import paxisim
    from paxisim.hw.signals import from_recording, press

    suffix = Path(text).suffix.lower()
    if text == "demo":
        return press(profile)
    if suffix == ".xml":
        from paxisim.cli.scene_signal import SceneSignal

        return SceneSignal(Path(text), profile)
    if suffix in (".mcap", ".npz", ".csv"):
        from paxisim.recording import Recording

        recording = Recording.load(text)
        # what is not known, as while a pad was in error, cannot be felt: the sample before is held
        known = np.isfinite(recording.tensor).all(axis=(1, 2, 3, 4))
        return from_recording(recording[known], profile)
    module, _, name = text.partition(":")
    if not (module and name):
        raise paxisim.InvalidValueError(
            f"--signal must be 'demo', a recording (.mcap, .npz, .csv), a scene (.xml) or MODULE:FUNCTION, got {text!r}"
        )
    # as `python -m` does: a module beside the user is found
    sys.path.insert(0, os.getcwd())
    try:
        function = getattr(importlib.import_module(module), name)
    except Exception as error:  # whatever a user's module raises
        raise paxisim.InvalidValueError(f"--signal {text}: {type(error).__name__}: {error}") from error
    finally:
        sys.path.pop(0)
    if not callable(function):
        raise paxisim.InvalidValueError(f"--signal {text}: expected a function, got {type(function).__name__}")
    return lambda now: np.asarray(function(now))


def _run(sensor, seconds: float) -> None:
    """Wait, and say once a second on a terminal how it goes."""
    end, before = time.monotonic() + seconds, 0
    while (left := end - time.monotonic()) > 0 and sensor.plugged:
        sensor.wait(min(left, 1.0))
        if sys.stderr.isatty():
            line = f"\r{sensor.messages - before} messages/s, {sensor.messages} in all, {sensor.overruns} bytes lost "
            print(line, end="", file=sys.stderr, flush=True)
        before = sensor.messages
