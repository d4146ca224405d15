"""The ``paxisim live`` command."""

from __future__ import annotations

import contextlib
import math
from pathlib import Path
from typing import Annotated

import tyro

from paxisim.cli.calibrated import load_calibration
from paxisim.cli.output import check_output
from paxisim.errors import DeviceError, InvalidValueError

_ROUNDING = 1e-6  # s


def live(
    source: Annotated[str, tyro.conf.Positional],
    profile: str | None = None,
    save: Path | None = None,
    seconds: float | None = None,
    vmax: float | None = None,
    fps: float = 200.0,
    calibration: Path | None = None,
    covariates: str | None = None,
    force: bool = False,
) -> None:
    """Show a sensor, a recording or a MuJoCo scene in Rerun's viewer.

    The viewer draws the taxels in their places, with normal force as colour and shear as arrows, and plots each pad's
    total force and the sampling rate. If a recording has simulated tensors, the viewer also shows them and the
    difference. Press Ctrl-C to stop.

    For example:

    paxisim live press.mcap --save press.rrd

    paxisim live /dev/ttyACM0 --profile gen2-box-120

    Args:
        source: Serial port (needs --profile), recording (.mcap, .npz, .csv) or MuJoCo scene with pads (.xml).
        profile: Profile of the sensor on the port: a name or a file.
        save: Write an .rrd file for Rerun instead of opening the viewer; needs no display.
            A recording, or a scene with --seconds, is then drawn completely and as fast as possible.
        seconds: Duration in seconds.
        vmax: Normal force shown as full red, in N or the sensor's unit.
            Default: the maximum of the recording or, of a live source, of the last seconds.
        fps: Maximum number of readings drawn per second, in real time.
        calibration: Calibration or background of `paxisim calibrate`, for a sensor that does not measure newtons.
        covariates: Python function that returns the present values on which the background depends, by name, such as
            {"opening": 0.04}, as module:function.
        force: Overwrite the output file if it exists.
    """
    from paxisim.files import whole_file
    from paxisim.viz.live import LiveView
    from paxisim.viz.live_drawing import import_rerun, need_display
    from paxisim.viz.live_sources import RECORDINGS, open_source

    for name, value in (("--seconds", seconds), ("--fps", fps)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise InvalidValueError(f"{name} must be positive and finite, got {value:g}")
    import_rerun()
    if save is None:
        need_display()
    else:
        check_output(save, force)
        if save.suffix.lower() != ".rrd":
            raise InvalidValueError(f"--save must end in .rrd, got {save}")
    ends = Path(source).suffix.lower() in RECORDINGS or (seconds is not None and source.lower().endswith(".xml"))
    real_time = save is None or not ends
    failure = None
    with contextlib.ExitStack() as stack:
        opened = stack.enter_context(
            open_source(source, profile, real_time, *load_calibration(calibration, covariates))
        )
        view = stack.enter_context(
            LiveView(
                opened.layouts,
                opened.pads,
                opened.tensors,
                save=None if save is None else stack.enter_context(whole_file(save)),
                vmax=opened.vmax if vmax is None else vmax,
                shear_max=opened.shear_max,
                unit=opened.unit,
                fps=fps if real_time else None,
                window=10.0 if real_time else None,
            )
        )
        try:
            start = None
            for moment in opened.moments:
                start = moment.time if start is None else start
                if seconds is not None and moment.time - start > seconds + _ROUNDING:
                    break
                view.show(moment.time, moment.measured, moment.simulated, wait=not real_time)
        except (DeviceError, KeyboardInterrupt) as error:
            # keep what was drawn until then
            if not view.shown:
                raise
            failure = error
    words = f"{view.drawn} of {view.shown} readings drawn"
    print(f"wrote {save}, {words}" if save else words)
    # Ctrl-C is the normal end of a source without an end
    if isinstance(failure, DeviceError) or (failure is not None and opened.ends):
        raise failure
