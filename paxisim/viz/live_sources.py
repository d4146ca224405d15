"""Sources of the live view: a sensor's port, a recording, or a running MuJoCo scene."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.viz.live_scene import Moment, largest

if TYPE_CHECKING:
    from paxisim.hw.calibrated import SensorCalibration
    from paxisim.hw.device import TactileSensor

RECORDINGS = (".mcap", ".npz", ".csv")
_RECONNECT = 10.0  # s to wait for a port that disappeared
_MAX_LAG = 0.05  # s: limits the lag, so a slow simulation runs in slow motion
_RATE = 100.0  # Hz, readings of a scene


@dataclass(frozen=True, eq=False)
class Source:
    """A source of moments for the live view.

    Attributes:
        layouts: ``(pads,)`` layouts.
        pads: ``(pads,)`` names.
        tensors: Tensors in the moments: ``"measured"``, ``"simulated"`` or both.
        moments: Iterator over the moments in order; time starts near 0.
        ends: Whether the source ends by itself.
        unit: Unit of the tensors.
        vmax: Largest normal force (N) in the source, if known in advance.
        shear_max: Largest shear force (N), likewise.
    """

    layouts: tuple[TaxelLayout, ...]
    pads: tuple[str, ...]
    tensors: tuple[str, ...]
    moments: Iterator[Moment]
    ends: bool
    unit: str = "N"
    vmax: float | None = None
    shear_max: float | None = None


@contextmanager
def open_source(
    source: str,
    profile: str | None,
    real_time: bool,
    calibration: SensorCalibration | None = None,
    covariates: Callable[[], Mapping[str, ArrayLike]] | None = None,
) -> Iterator[Source]:
    """Open a source; it is closed when the context ends.

    Args:
        source: A recording or an MJCF file, identified by its suffix, or a port.
        profile: Profile of the sensor; required for a port and not allowed otherwise.
        real_time: Whether a recording or a scene plays in real time; otherwise as fast as possible.
        calibration: Calibration of the sensor; allowed for a port only.
        covariates: Function that returns the values on which the calibration depends.

    Raises:
        InvalidValueError: A profile is missing, a profile or calibration is not allowed, or the file does not match
            its suffix.
        DeviceError: The sensor on the port cannot be read.
    """
    suffix = Path(source).suffix.lower()
    is_file = suffix in (*RECORDINGS, ".xml")
    if is_file and profile is not None:
        raise InvalidValueError(f"--profile is for a port, and {source} is a file")
    if is_file and calibration is not None:
        raise InvalidValueError(f"--calibration is for a port, and {source} is a file")
    if suffix == ".xml":
        yield _scene(source, real_time)
    elif is_file:
        yield _recording(source, real_time)
    elif Path(source).is_file():
        raise InvalidValueError(f"expected a recording ({', '.join(RECORDINGS)}), a scene (.xml) or a port: {source}")
    elif profile is None:
        from paxisim.hw.profiles.load import known_profiles

        known = ", ".join(known_profiles())
        raise InvalidValueError(f"{source} is treated as a port, which needs --profile NAME; known: {known}")
    else:
        from paxisim.hw.device import open_sensor

        with open_sensor(
            source, profile, reconnect=_RECONNECT, calibration=calibration, covariates=covariates
        ) as sensor:
            layouts = (sensor.layout,) * len(sensor.pads)
            yield Source(layouts, sensor.pads, ("measured",), _readings(sensor), ends=False, unit=sensor.unit)


def _readings(sensor: TactileSensor) -> Iterator[Moment]:
    wait = _RECONNECT + 2  # longer than a reconnection, so that the view continues after one
    frame = sensor.latest(wait)  # skip the frames that arrived while the viewer started
    while True:
        force = frame.force
        if wrong := frame.pads_in_error:
            force = force.copy()
            force[wrong] = np.nan  # as in a recording
        yield Moment(frame.time, measured=force)
        frame = sensor.read(wait)


def _recording(path: str, real_time: bool) -> Source:
    from paxisim.recording import Recording

    recording = Recording.load(path)
    tensors = {"measured": recording.measured, "simulated": recording.simulated}
    present = {name: tensor for name, tensor in tensors.items() if tensor is not None}
    # the clock of an episode may restart at 0; in the view, the episode follows the one before
    steps = np.diff(recording.time, prepend=recording.time[0])
    forward = steps[steps > 0]
    shown = np.cumsum(np.where(steps < 0, np.median(forward) if len(forward) else 0.0, steps))

    def moments() -> Iterator[Moment]:
        start = time.monotonic()
        for i, moment in enumerate(shown):
            if real_time:
                time.sleep(max(0.0, start + moment - time.monotonic()))
            yield Moment(float(moment), **{name: tensor[i] for name, tensor in present.items()})

    # one scale for the whole recording makes its beginning and end comparable
    normal = max(largest(np.abs(tensor[:, :, 2])) for tensor in present.values())
    shear = max(largest(np.hypot(tensor[:, :, 0], tensor[:, :, 1])) for tensor in present.values())
    return Source(
        (recording.layout,) * len(recording.pads),
        recording.pads,
        tuple(present),
        moments(),
        ends=True,
        unit=recording.unit,
        vmax=normal or None,
        shear_max=shear or None,
    )


def _scene(path: str, real_time: bool) -> Source:
    import mujoco

    from paxisim.models.load import compile_spec, load_spec
    from paxisim.models.pads import find_pads
    from paxisim.models.readout import TactileReadout

    model = compile_spec(load_spec(Path(path)), path)
    data = mujoco.MjData(model)
    pads = find_pads(model)
    readout = TactileReadout(model, pads)
    steps = max(1, round(1 / (_RATE * model.opt.timestep)))

    def moments() -> Iterator[Moment]:
        mujoco.mj_forward(model, data)
        zero = time.monotonic() - data.time
        while True:
            yield Moment(data.time, simulated=readout.read(data))
            mujoco.mj_step(model, data, nstep=steps)
            if real_time:
                late = time.monotonic() - zero - data.time
                zero += max(0.0, late - _MAX_LAG)
                time.sleep(max(0.0, -late))

    return Source(pads.layouts, pads.names, ("simulated",), moments(), ends=False)
