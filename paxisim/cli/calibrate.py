"""``paxisim calibrate``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import tyro

from paxisim.cli.output import check_output, png, progress, write_output
from paxisim.errors import InvalidValueError


def calibrate(
    recording: Annotated[Path, tyro.conf.Positional],
    loads: tuple[str, ...],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
    *,
    degree: int = 1,
    quadratic: bool = False,
    max_delay: float = 0.5,
    force: bool = False,
) -> None:
    """Calibrate a sensor whose channels are not in newtons, such as microtesla, with a load cell beside it.

    Each channel gets a gain for each load, and all one delay; the load is also fitted to all channels together. Tables
    of both with their held-out errors are printed, and two pictures drawn beside the output, as .png and
    .residuals.png.

    An output that ends in .json is a calibration, to be applied live by --calibration of record and live. Any other is
    the recording in newtons with the loads as its simulation, ready for `paxisim diagnose`.

    For example:

    paxisim calibrate raw.mcap --loads Fx=cell_x Fy=cell_y Fz=cell_z -o sensor.json

    Args:
        recording: An .mcap, .npz or .csv file with the channels as its measured tensors and the loads as covariates.
        loads: The covariates that hold the load, in N and N m, up to six: as names, or as COMPONENT=NAME with the
            components Fx, Fy, Fz, Tx, Ty and Tz. A covariate with 3 or 6 values per sample holds them in this order.
        output: The calibration to write, .json, or the calibrated recording, .mcap or .npz.
        degree: 1 for straight lines, 2 or 3 for polynomials of each load.
        quadratic: Fit the load to products of the channels as well; look whether the held-out error falls.
        max_delay: Largest delay between loads and channels to search, in seconds, of either sign.
        force: Overwrite the outputs if they exist.
    """
    from paxisim.calibrate.calibration import calibrate_sensor
    from paxisim.errors import MissingExtraError
    from paxisim.recording import Recording
    from paxisim.viz.calibration import plot_calibration
    from paxisim.viz.residuals import plot_residuals

    is_model = output.suffix.lower() == ".json"
    if not is_model and output.suffix.lower() not in (".npz", ".mcap"):
        raise InvalidValueError(
            f"the output must be a calibration (.json) or a calibrated recording (.npz, .mcap), got {output}"
        )
    pictures = [output.with_suffix(".png"), output.with_suffix(".residuals.png")]
    check_output(output, force)
    for picture in pictures:
        check_output(picture, force, ".png")
    given = _loads(loads)
    progress(f"reading {recording}")
    raw = Recording.load(recording)
    progress("fitting gains, delay and load")
    calibration = calibrate_sensor(raw, given, degree=degree, quadratic=quadratic, max_delay=max_delay)
    progress("drawing")
    try:
        drawn = [png(plot_calibration(calibration.readout, raw)), png(plot_residuals(calibration, raw))]
        missing = None
    except MissingExtraError as error:
        drawn, missing = [], error
    if is_model:
        calibration.save(output)
        said = "the calibration, for --calibration of record and live"
    else:
        calibrated = calibration.readout.apply(raw)
        calibrated.save(output)
        said = f"{len(calibrated)} samples in {len(list(calibrated.episodes()))} episodes, in newtons"
    print(calibration)
    print(f"\n{output}: {said}")
    if missing is not None:
        print(f"no picture: {missing}")
        return
    for picture, data in zip(pictures, drawn, strict=True):
        write_output(picture, data, force)
    print(f"{pictures[0]}: the episodes, and how well the loads explain each channel")
    print(f"{pictures[1]}: errors of the load")


def _loads(words: tuple[str, ...]) -> tuple[str, ...] | Mapping[str, str]:
    """Names, or the covariate of each component."""
    pairs = [word.split("=", 1) for word in words]
    named = [pair for pair in pairs if len(pair) == 2]
    if not named:
        return words
    components = [component for component, *_ in pairs]
    if len(named) < len(pairs) or len(set(components)) < len(components) or not all(name for _, name in named):
        raise InvalidValueError(
            f"--loads takes names, or COMPONENT=NAME for different components, got {' '.join(words)}"
        )
    return dict(named)
