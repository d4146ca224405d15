"""Recordings of eFlesh: a magnet-based sensor whose channels are fields, pressed beside a load cell.

A recording is two CSV files without a header, as eFlesh's characterisation writes them, beside one another:

- ``NAME.sensor.csv``: Unix time (s), then x, y and z of each magnetometer in turn, in microtesla.
- ``NAME.states.csv``: Unix time (s), the robot's x, y and z (mm), and the load cell's force in grams-force; -1 says
  that there is no new reading.

Each magnetometer is a taxel of one row, so that the tensor is ``(T, 1, 3, 1, magnetometers)`` with **microtesla** in
it, as the metadata's ``unit`` says. Where the magnetometers sit the files do not say: the layout's pitch stands for
nothing, unless one is given to `paxisim.Recording.load`.
What the robot and the load cell say is brought to the sensor's times, and is NaN where neighbouring readings are
more than `MAX_GAP` apart, or what is asked for: the covariates are ``load`` (N) and ``robot_x``, ``robot_y``,
``robot_z`` (m).

Source of the format: the repository notvenky/eFlesh, characterization/datasets.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs import schemas
from paxisim.logs.recording_arrays import Method, RecordingArrays
from paxisim.logs.resample import resample_log
from paxisim.logs.stream import Log, Stream

SENSOR, STATES = ".sensor.csv", ".states.csv"
NEWTONS = 9.80665e-3  # a gram-force
MAX_GAP = 2.0  # s
_NO_READING = -1.0


def read_eflesh(
    path: Path, align: Method | Mapping[str, Method] = "linear", max_gap: float | None = None
) -> RecordingArrays:
    """Read ``NAME.sensor.csv`` and the ``NAME.states.csv`` beside it.

    Args:
        path: The former.
        align: How the robot and the load cell are interpolated, as in `paxisim.Recording.load`.
        max_gap: Seconds; default: `MAX_GAP`.

    Raises:
        InvalidValueError: Not such files; the message has the line.
        FileNotFoundError: One of them is missing.
    """
    states = path.with_name(path.name.removesuffix(SENSOR) + STATES)
    if not states.exists():
        raise FileNotFoundError(f"{path.name} needs the robot and the load cell beside it: there is no {states}")
    field, robot = _table(path), _table(states)
    if field.shape[1] < 4 or field.shape[1] % 3 != 1:
        raise InvalidValueError(
            f"{path}: expected a time and x, y, z of each magnetometer in every row, got {field.shape[1]} values"
        )
    if robot.shape[1] != 5:
        raise InvalidValueError(f"{states}: expected time, x, y, z and force in every row, got {robot.shape[1]} values")
    pressed = robot[:, 4] != _NO_READING
    if not pressed.any():
        raise InvalidValueError(f"{states}: the load cell has no reading at all")
    magnetometers = (field.shape[1] - 1) // 3
    readings = np.moveaxis(field[:, 1:].reshape(-1, magnetometers, 3), 1, 2)[:, None, :, None].astype(np.float32)
    at = _nanoseconds(states, robot)
    streams = {
        "measured": Stream(_nanoseconds(path, field), readings),
        schemas.COVARIATE + "load": Stream(at[pressed], robot[pressed, 4] * NEWTONS),
        **{f"{schemas.COVARIATE}robot_{axis}": Stream(at, robot[:, i] * 1e-3) for i, axis in enumerate("xyz", start=1)},
    }
    layout = TaxelLayout(1, magnetometers, (1e-2, 1e-2)).to_dict()
    about = {"source": path.name, "sensor": "eflesh", "unit": "uT", "layout": layout, "pads": ("eflesh",)}
    return resample_log(Log(streams, about), align, MAX_GAP if max_gap is None else max_gap)


def _table(path: Path) -> NDArray[np.float64]:
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    if not lines:
        raise InvalidValueError(f"{path} is empty")
    try:
        table = np.loadtxt(lines, delimiter=",", ndmin=2, comments=None)
    except ValueError as error:
        raise InvalidValueError(
            f"{path}: rows must be numbers, all of one length, without a header: {error}"
        ) from error
    if not np.isfinite(table).all():
        raise InvalidValueError(f"{path}, line {int(np.argmin(np.isfinite(table).all(axis=1))) + 1} holds no number")
    return table


def _nanoseconds(path: Path, table: NDArray[np.float64]) -> NDArray[np.int64]:
    if np.any(np.diff(table[:, 0]) < 0):
        raise InvalidValueError(f"{path}: time runs back in line {int(np.argmax(np.diff(table[:, 0]) < 0)) + 2}")
    return np.round(table[:, 0] * 1e9).astype(np.int64)
