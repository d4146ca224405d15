"""The ``paxisim calibrate`` command."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import tyro

from paxisim.cli.output import check_output, png, progress, write_output
from paxisim.errors import InvalidValueError
from paxisim.files import all_or_none


def calibrate(
    recording: Annotated[Path, tyro.conf.Positional],
    loads: tuple[str, ...],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
    *,
    degree: int = 1,
    kind: Literal["best", "linear", "quadratic"] = "best",
    max_delay: float = 0.5,
    force: bool = False,
) -> None:
    """Calibrate a sensor that does not measure newtons against a load cell recorded with it.

    The command fits a gain per channel and load, with one delay for all channels, and the load as a function of all
    channels at the same time. It prints both tables with held-out errors, and draws the fit (.png) and the residuals
    (.residuals.png) next to the output.

    An output file .json is a calibration, for the option --calibration of record and live. Any other output is the
    recording in newtons with the loads as simulated tensors, as input for `paxisim diagnose`.

    For example:

    paxisim calibrate raw.mcap --loads Fx=cell_x Fy=cell_y Fz=cell_z -o sensor.json

    Args:
        recording: Recording with the channels as measured tensors and the loads as covariates (.mcap, .npz, .csv).
        loads: Covariates that hold the load, up to six, in N and N m.
            Either names, or COMPONENT=NAME with the components Fx, Fy, Fz, Tx, Ty and Tz.
            A covariate with 3 or 6 values per sample holds the components in this order.
        output: Output file: a calibration (.json) or the calibrated recording (.mcap, .npz).
        degree: Degree of the polynomials in each load: 1 (straight lines), 2 or 3.
        kind: How the load depends on all channels: linear, quadratic (also on their products), or best: the one with
            the lower held-out error.
        max_delay: Largest delay between loads and channels to search, in seconds, in either direction.
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
    calibration = calibrate_sensor(raw, given, degree=degree, kind=kind, max_delay=max_delay)
    progress("drawing")
    try:
        drawn = [png(plot_calibration(calibration.readout, raw)), png(plot_residuals(calibration, raw))]
        missing = None
    except MissingExtraError as error:
        drawn, missing = [], error
    with all_or_none([output, *pictures]):
        if is_model:
            calibration.save(output)
            said = "the calibration, for the option --calibration of record and live"
        else:
            calibrated = calibration.readout.apply(raw)
            calibrated.save(output)
            said = f"{len(calibrated)} samples in {len(list(calibrated.episodes()))} episodes, in newtons"
        for picture, data in zip(pictures if missing is None else [], drawn, strict=True):
            write_output(picture, data, force)
    print(calibration)
    print(f"\n{output}: {said}")
    if missing is not None:
        print(f"no picture: {missing}")
        return
    print(f"{pictures[0]}: the episodes, and how well the loads explain each channel")
    print(f"{pictures[1]}: errors of the load")


def _loads(words: tuple[str, ...]) -> tuple[str, ...] | Mapping[str, str]:
    """Parse ``--loads``: either covariate names, or a mapping from load component to covariate name."""
    pairs = [word.split("=", 1) for word in words]
    named = [pair for pair in pairs if len(pair) == 2]
    if not named:
        return words
    components = [component for component, *_ in pairs]
    if len(named) < len(pairs) or len(set(components)) < len(components) or not all(name for _, name in named):
        raise InvalidValueError(
            f"--loads must be names, or COMPONENT=NAME for different components, got {' '.join(words)}"
        )
    return dict(named)
