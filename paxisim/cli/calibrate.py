"""The ``paxisim calibrate`` command."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from paxisim.cli.output import check_output, named_after, png, progress, write_output
from paxisim.errors import InvalidValueError, MissingExtraError
from paxisim.files import all_or_none

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from paxisim.calibrate.background import Background
    from paxisim.calibrate.calibration import Calibration
    from paxisim.recording import Recording


def calibrate(
    recording: Annotated[Path | None, tyro.conf.Positional] = None,
    /,
    *,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"], metavar="PATH")] = None,
    loads: tuple[str, ...] = (),
    background: Path | None = None,
    covariates: tuple[str, ...] = (),
    degree: int = 1,
    kind: Literal["best", "linear", "quadratic"] = "best",
    max_delay: float = 0.5,
    total: bool = False,
    force: bool = False,
) -> None:
    """Calibrate a sensor that does not measure newtons against a load cell, or subtract the field of the robot from it.

    With --loads, the command fits a gain per channel and load, with one delay for all channels, and the load as a
    function of all channels at the same time. It prints both tables with held-out errors, and draws the fit (.png) and
    the residuals (.residuals.png) next to the output.

    With --background, it first subtracts what the sensor reads without contact: the other finger's magnets and the
    earth's field, as a function of the joint positions. Without a recording, the output is the background itself.

    An output file .json is a calibration or a background, for the option --calibration of record and live. Any other
    output is a recording: in newtons with the loads as simulated tensors, as input for `paxisim diagnose`, or without
    --loads the channels without the background.

    For example:

    paxisim calibrate raw.mcap --loads Fx=cell_x Fy=cell_y Fz=cell_z -o sensor.json

    paxisim calibrate --background free.mcap --covariates opening -o background.json

    Args:
        recording: Recording with the channels as measured tensors and the loads as covariates (.mcap, .npz, .csv).
        output: Output file: a calibration or background (.json), or a recording (.mcap, .npz). Default: the name of the
            recording, with -calibration.json, -background.json or -without-background.mcap.
        loads: Covariates that hold the load, up to six, in N and N m.
            Either names, or COMPONENT=NAME with the components Fx, Fy, Fz, Tx, Ty and Tz.
            A covariate with 3 or 6 values per sample holds the components in this order.
        background: Recording of the moving robot with nothing at the sensor (.mcap, .npz, .csv), with --covariates; or
            a background that this command wrote (.json).
        covariates: Covariates of the background: joint positions, quaternion of the hand, temperature.
        degree: Degree of the polynomials in each load: 1 (straight lines), 2 or 3.
        kind: How the load depends on all channels: linear, quadratic (also on their products), or best: the one with
            the lower held-out error.
        max_delay: Largest delay between loads and channels to search, in seconds, in either direction.
        total: Write a recording of the total force, from all channels together, as one taxel. Use it to diagnose a
            magnetised skin: none of its channels measures a force.
        force: Overwrite the outputs if they exist.
    """
    output = _output(recording, loads, background) if output is None else output
    _check(recording, output, loads, background, covariates)
    if total and (not loads or _is_model(output)):
        raise InvalidValueError(
            f"--total writes a recording of the total force: expected --loads and an output .mcap or .npz, got {output}"
        )
    given = _loads(loads)
    pictures = [output.with_suffix(".png"), *([output.with_suffix(".residuals.png")] if loads else [])]
    check_output(output, force)
    for picture in pictures:
        check_output(picture, force, ".png")
    raw = None if recording is None else _read(recording)
    free = _read(background) if background is not None and covariates else None
    field = None if background is None else _background(background, free, covariates)
    if raw is not None and loads:
        made = _newtons(raw, field, output, total, loads=given, degree=degree, kind=kind, max_delay=max_delay)
    else:
        assert field is not None
        made = _without_field(raw, free, field)
    progress("drawing")
    try:
        drawn = [png(draw()) for draw in made.pictures.values()]
        missing = None
    except MissingExtraError as error:
        drawn, missing = [], error
    with all_or_none([output, *pictures]):
        made.result.save(output)
        for picture, data in zip(pictures if missing is None else [], drawn, strict=True):
            write_output(picture, data, force)
    print(made.table)
    print(f"\n{output}: {made.what}")
    if missing is not None:
        print(f"no picture: {missing}")
        return
    for picture, shown in zip(pictures, made.pictures, strict=True):
        print(f"{picture}: {shown}")


def _output(recording: Path | None, loads: tuple[str, ...], background: Path | None) -> Path:
    """Return the default output."""
    if recording is None:
        return named_after(background or "", "-background.json")
    return named_after(recording, "-calibration.json" if loads else "-without-background.mcap")


@dataclass
class _Made:
    """What a run makes: the output, what it is, tables to print, and functions that draw pictures, by their content."""

    result: Calibration | Background | Recording
    what: str
    table: str
    pictures: dict[str, Callable[[], Figure]]


def _newtons(raw: Recording, field: Background | None, output: Path, total: bool, **options: Any) -> _Made:
    """Fit a calibration; the result is the calibration or the recording in newtons."""
    from paxisim.calibrate.calibration import calibrate_sensor
    from paxisim.viz.calibration import plot_calibration
    from paxisim.viz.residuals import plot_residuals

    progress("fitting gains, delay and load")
    calibration = calibrate_sensor(raw, background=field, **options)
    given, raw = raw, raw if field is None else field.apply(raw)
    pictures: dict[str, Callable[[], Figure]] = {
        "the episodes, and how well the loads explain each channel": lambda: plot_calibration(calibration.readout, raw),
        "errors of the load": lambda: plot_residuals(calibration, raw),
    }
    if _is_model(output):
        what = "the calibration, for the option --calibration of record and live"
        return _Made(calibration, what, str(calibration), pictures)
    newtons = calibration.apply_total(given) if total else calibration.readout.apply(raw)
    what = f"{len(newtons)} samples in {len(list(newtons.episodes()))} episodes, in newtons"
    return _Made(newtons, what, str(calibration), pictures)


def _without_field(raw: Recording | None, free: Recording | None, field: Background) -> _Made:
    """Return the background, or the recording without it if there is one."""
    from paxisim.viz.background import plot_background

    shown = free if raw is None else raw
    assert shown is not None
    pictures = {"the channels before and after": lambda: plot_background(field, shown)}
    if raw is None:
        what = "the background, for --background of this command and --calibration of record and live"
        return _Made(field, what, str(field), pictures)
    result = field.apply(raw)
    return _Made(result, f"{len(result)} samples without the background", str(field), pictures)


def _is_model(output: Path) -> bool:
    return output.suffix.lower() == ".json"


def _check(
    recording: Path | None,
    output: Path,
    loads: tuple[str, ...],
    background: Path | None,
    covariates: tuple[str, ...],
) -> None:
    """Check that the options fit together before any file is read."""
    if not _is_model(output) and output.suffix.lower() not in (".npz", ".mcap"):
        raise InvalidValueError(
            f"the output must be a calibration (.json) or a calibrated recording (.npz, .mcap), got {output}"
        )
    if not loads and background is None:
        raise InvalidValueError("expected --loads, the covariates of a load cell, or --background, or both")
    if loads and recording is None:
        raise InvalidValueError("--loads need a recording with the load: paxisim calibrate RECORDING --loads ...")
    is_fitted = background is not None and background.suffix.lower() == ".json"
    if covariates and (background is None or is_fitted):
        raise InvalidValueError(
            "--covariates are what a background depends on: expected --background RECORDING with them, got "
            + ("none" if background is None else f"{background}, which is already fitted")
        )
    if background is not None and not is_fitted and not covariates:
        raise InvalidValueError(f"expected --covariates, the joint positions in {background} that its field depends on")
    if not loads and recording is None and not (_is_model(output) and covariates):
        raise InvalidValueError(
            "without a recording to subtract it from, the output is a background: expected --background RECORDING "
            f"--covariates ... and an output .json, got {background} and {output}"
        )
    if not loads and recording is not None and _is_model(output):
        raise InvalidValueError(f"without --loads, the output is the recording (.npz, .mcap), got {output}")


def _read(path: Path) -> Recording:
    from paxisim.recording import Recording

    progress(f"reading {path}")
    return Recording.load(path)


def _background(path: Path, free: Recording | None, covariates: tuple[str, ...]) -> Background:
    """Load a background, or fit it to a recording without contact."""
    from paxisim.calibrate.background import Background
    from paxisim.calibrate.fit_background import fit_background

    if free is None:
        return Background.load(path)
    progress("fitting the background")
    return fit_background(free, covariates)


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
