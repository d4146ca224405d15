"""Where the live view's moments come from: a sensor's port, a recording, or a MuJoCo scene as it runs."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.schemas import in_error
from paxisim.viz.live_scene import Moment, largest

if TYPE_CHECKING:
    from paxisim.calibrate.calibration import Calibration
    from paxisim.hw.device import TactileSensor

RECORDINGS = (".mcap", ".npz", ".csv")
_RECONNECT = 10.0  # s for which a port that went away is waited for
_MAX_LAG = 0.05  # s: a slower simulation runs in slow motion instead of falling ever further behind
_RATE = 100.0  # readings of a scene a second


@dataclass(frozen=True, eq=False)
class Source:
    """Something to be looked at.

    Attributes:
        layouts: ``(pads,)`` layouts.
        pads: ``(pads,)`` names.
        tensors: What its moments hold: ``"measured"``, ``"simulated"`` or both.
        moments: What happens, in order; time counts from about 0.
        ends: Whether it ends by itself.
        unit: Unit of the tensors.
        vmax: The largest normal force (N) there will be, where that is known.
        shear_max: The largest shear (N), likewise.
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
    source: str, profile: str | None, real_time: bool, calibration: Calibration | None = None
) -> Iterator[Source]:
    """Open what the words name; closed when the context ends.

    Args:
        source: A recording or an MJCF file, by its suffix; everything else is a port.
        profile: The profile of the sensor on a port, and of nothing else.
        real_time: Whether a recording or a scene takes its time; else it is as fast as it can be.
        calibration: Of the sensor on a port, and of nothing else.

    Raises:
        InvalidValueError: A profile is missing or not wanted, or the file is not what its suffix says.
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
        from paxisim.hw.profile import known_profiles

        known = ", ".join(known_profiles())
        raise InvalidValueError(f"{source} is taken for a port, and a port needs --profile NAME; known: {known}")
    else:
        from paxisim.hw.device import open_sensor

        with open_sensor(source, profile, reconnect=_RECONNECT, calibration=calibration) as sensor:
            layouts = (sensor.layout,) * len(sensor.pads)
            yield Source(layouts, sensor.pads, ("measured",), _readings(sensor), ends=False, unit=sensor.unit)


def _readings(sensor: TactileSensor) -> Iterator[Moment]:
    wait = _RECONNECT + 2  # a port that comes back within its time is no reason to stop looking
    frame = sensor.latest(wait)  # the frames that came while the viewer started are of no interest
    while True:
        force = frame.force
        if wrong := in_error(frame.status):
            force = force.copy()
            force[wrong] = np.nan  # as a recording has them
        yield Moment(frame.time, measured=force)
        frame = sensor.read(wait)


def _recording(path: str, real_time: bool) -> Source:
    from paxisim.recording import Recording

    recording = Recording.load(path)
    tensors = {"measured": recording.measured, "simulated": recording.simulated}
    present = {name: tensor for name, tensor in tensors.items() if tensor is not None}
    # an episode may count from 0 again; on the view's one clock it follows the one before
    steps = np.diff(recording.time, prepend=recording.time[0])
    forward = steps[steps > 0]
    shown = np.cumsum(np.where(steps < 0, np.median(forward) if len(forward) else 0.0, steps))

    def moments() -> Iterator[Moment]:
        start = time.monotonic()
        for i, moment in enumerate(shown):
            if real_time:
                time.sleep(max(0.0, start + moment - time.monotonic()))
            yield Moment(float(moment), **{name: tensor[i] for name, tensor in present.items()})

    # one scale for all of it, so that its beginning can be compared with its end; see Scale for the least
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
