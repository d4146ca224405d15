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
    max_delay: float = 0.5,
    force: bool = False,
) -> None:
    """Calibrate a sensor whose channels are not in newtons, such as microtesla, with a load cell beside it.

    Each channel gets a gain for each load, and all one delay. The output is a recording in newtons with the loads as
    its simulation, ready for `paxisim diagnose`. A table of the gains and held-out errors is printed, and a picture
    drawn beside the output, as .png.

    For example:

    paxisim calibrate raw.mcap --loads Fx=cell_x Fy=cell_y Fz=cell_z -o calibrated.mcap

    Args:
        recording: An .mcap, .npz or .csv file with the channels as its measured tensors and the loads as covariates.
        loads: The covariates that hold the load, in N and N m, up to six: as names, or as COMPONENT=NAME with the
            components Fx, Fy, Fz, Tx, Ty and Tz. A covariate with 3 or 6 values per sample holds them in this order.
        output: The recording to write, .mcap or .npz.
        degree: 1 for straight lines, 2 or 3 for polynomials of each load.
        max_delay: Largest delay between loads and channels to search, in seconds, of either sign.
        force: Overwrite the outputs if they exist.
    """
    from paxisim.calibrate.fit import calibrate_readout
    from paxisim.errors import MissingExtraError
    from paxisim.recording import Recording
    from paxisim.viz.calibration import plot_calibration

    if output.suffix.lower() not in (".npz", ".mcap"):
        raise InvalidValueError(f"a calibrated recording is written to .npz or .mcap, got {output}")
    picture = output.with_suffix(".png")
    check_output(output, force)
    check_output(picture, force, ".png")
    given = _loads(loads)
    progress(f"reading {recording}")
    raw = Recording.load(recording)
    progress("fitting gains and delay")
    readout = calibrate_readout(raw, given, degree=degree, max_delay=max_delay)
    calibrated = readout.apply(raw)
    progress("drawing")
    try:
        drawn, missing = png(plot_calibration(readout, raw)), None
    except MissingExtraError as error:
        drawn, missing = b"", error
    calibrated.save(output)
    print(readout)
    print(f"\n{output}: {len(calibrated)} samples in {len(list(calibrated.episodes()))} episodes, in newtons")
    if missing is not None:
        print(f"no picture: {missing}")
        return
    write_output(picture, drawn, force)
    print(f"{picture}: the episodes, and how well the loads explain each channel")


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
