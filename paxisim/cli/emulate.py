"""The ``paxisim emulate`` command."""

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
    shear_floor: int = 0,
    seed: int = 0,
    seconds: float = math.inf,
) -> None:
    """Emulate a sensor on a serial port, with the protocol of a profile, byte for byte.

    The command first prints the name of the port, which any driver can open as a serial port. It runs until Ctrl-C,
    SIGTERM or the end of --seconds, and then exits with status 0. It works on Linux and is untested on macOS.

    For example:

    paxisim emulate --profile gen2-box-120 --link my-sensor

    Args:
        profile: Profile of the sensor: a name or a file.
        signal: Source of the forces on the pads.
            demo: a press that drags.
            .mcap, .npz, .csv: a recording.
            .xml: a MuJoCo scene with pads, simulated in real time.
            MODULE:FUNCTION: a Python function of the time (s)
            that returns (pads, 3, rows, cols) in the profile's unit.
        reference: Pass the signal through a simulated magnetic pad, computed from first principles.
            For example unit:7, or unit:7+memory for a gel that creeps.
            The pads of a scene (.xml) get the uneven surfaces of that unit.
        link: Symbolic link to create to the port.
        fault: Simulated line faults, as NAME=NUMBER separated by commas.
            Probability per byte: drop, flip, garble.
            Probability per message: split, merge, stall, status.
            Others: stall_seconds (s), noise (bytes at power-on), unplug_after (messages).
        rate_hz: Readings per second; default: the profile's.
        gate: Components smaller than this number of counts read 0.
            Default: 2 on GEN3 boards, as observed on real parts; 0 on all others.
        shear_floor: Smallest number of counts of x and y on a taxel that is on.
            A real PaXini S1813E never reads less than 2.
        seed: Random seed of the faults.
        seconds: Duration in seconds.
    """
    import paxisim
    from paxisim.hw.capture.end_signals import end_signals
    from paxisim.hw.emulation.emulator import Emulator
    from paxisim.hw.emulation.faults import Faults
    from paxisim.hw.profiles.load import load_profile

    if not seconds >= 0:
        raise paxisim.InvalidValueError(f"--seconds must be 0 or more, got {seconds:g}")
    if link is not None:
        check_folder(link)
    chosen = load_profile(profile)
    felt = make_signal(signal, chosen)
    if reference is not None:
        felt = _as_unit(felt, reference, chosen)
    sensor = Emulator(
        chosen,
        felt,
        rate=rate_hz,
        gate=gate,
        shear_floor=shear_floor,
        faults=Faults.parse(fault),
        link=link,
        seed=seed,
    )
    try:
        # leave no dangling link behind, whichever signal ends the process
        with end_signals(system_signals.default_int_handler), sensor:
            print(sensor.port, flush=True)
            _run(sensor, seconds)
    except KeyboardInterrupt:
        pass
    finally:
        if sys.stderr.isatty():
            print(file=sys.stderr)


def _as_unit(felt: Callable[[float], Any], text: str, profile) -> Callable[[float], Any]:
    """Pass a signal through the reference unit that ``--reference`` names."""
    import paxisim
    from paxisim.cli.scene_signal import SceneSignal

    make = paxisim.reference_sensor(text)
    if profile.unit != "N":
        raise paxisim.InvalidValueError(
            f"a reference unit reads newtons, but profile {profile.name!r} is in {profile.unit}: choose another profile"
        )
    sensor = make(profile.wire_layout)
    if sensor.covariate_names:
        raise paxisim.InvalidValueError("an emulated board does not know the gripper's opening: leave out +neighbour")
    if isinstance(felt, SceneSignal):
        felt.set_surface(sensor.heights(len(profile.slots)))
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
    """Return the signal that ``--signal`` names, see `emulate`.

    Raises:
        InvalidValueError: The text names no signal, or the signal is invalid or does not fit the pads.
        OSError: The file cannot be read.
    """
    import paxisim
    from paxisim.hw.emulation.signals import from_recording, press

    suffix = Path(text).suffix.lower()
    if text == "demo":
        return press(profile)
    if suffix == ".xml":
        from paxisim.cli.scene_signal import SceneSignal

        return SceneSignal(Path(text), profile)
    if suffix in (".mcap", ".npz", ".csv"):
        from paxisim.recording import Recording

        recording = Recording.load(text)
        # drop samples with unknown values, e.g. from a pad in error: the last known sample is held instead
        known = np.isfinite(recording.tensor).all(axis=(1, 2, 3, 4))
        return from_recording(recording[known], profile)
    module, _, name = text.partition(":")
    if not (module and name):
        raise paxisim.InvalidValueError(
            f"--signal must be 'demo', a recording (.mcap, .npz, .csv), a scene (.xml) or MODULE:FUNCTION, got {text!r}"
        )
    # find modules in the current folder, as `python -m` does
    sys.path.insert(0, os.getcwd())
    try:
        function = getattr(importlib.import_module(module), name)
    except Exception as error:  # a user's module may raise anything
        raise paxisim.InvalidValueError(f"--signal {text}: {type(error).__name__}: {error}") from error
    finally:
        sys.path.pop(0)
    if not callable(function):
        raise paxisim.InvalidValueError(f"--signal {text}: expected a function, got {type(function).__name__}")
    return lambda now: np.asarray(function(now))


def _run(sensor, seconds: float) -> None:
    """Wait until the end; on a terminal, show the progress once a second."""
    end, before = time.monotonic() + seconds, 0
    while (left := end - time.monotonic()) > 0 and sensor.plugged:
        sensor.wait(min(left, 1.0))
        if sys.stderr.isatty():
            line = f"\r{sensor.messages - before} messages/s, {sensor.messages} in all, {sensor.overruns} bytes lost "
            print(line, end="", file=sys.stderr, flush=True)
        before = sensor.messages
