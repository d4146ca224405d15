"""Recordings of eFlesh, a magnet-based sensor whose channels are magnetic fields, pressed next to a load cell.

A recording consists of two CSV files without a header in the same folder, as eFlesh's characterisation writes them:

- ``sensor.csv`` (raw fields), ``sensor_post_baselines.csv`` (fields without those at rest) or ``NAME.sensor.csv``: Unix
  time (s), then x, y and z of each magnetometer in turn, in microtesla.
- ``states.csv`` or ``NAME.states.csv``: Unix time (s), the robot's x, y and z (mm), and, if there was a load cell, its
  force in grams-force; -1 means that there is no new reading.

The magnetometers are the taxels of a single row, so the tensor is ``(T, 1, 3, 1, magnetometers)`` in **microtesla**, as
the metadata's ``unit`` states. The files do not contain the positions of the magnetometers: the layout's pitch is
meaningless unless a layout is given to `paxisim.Recording.load`.
The robot and load cell readings are resampled to the sensor's times. They are NaN where neighbouring readings are more
than `MAX_GAP`, or the given maximum, apart; without a load cell, the default is that of other recordings, because the
robot then rests at each place. The covariates are ``load`` (N) and ``robot_x``, ``robot_y``, ``robot_z`` (m).

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

SENSOR_NAMES = ("sensor.csv", "sensor_post_baselines.csv")
SENSOR_SUFFIX, STATES_NAME = ".sensor.csv", "states.csv"
NEWTONS = 9.80665e-3  # newtons per gram-force
MAX_GAP = 2.0  # s
_NO_READING = -1.0


def is_eflesh(path: Path) -> bool:
    """Return whether a path is that of a sensor's file; a plain table of such a name has a header."""
    if path.name not in SENSOR_NAMES:
        return path.name.endswith(SENSOR_SUFFIX)
    if not path.is_file() or not path.with_name(STATES_NAME).is_file():
        return False
    with open(path, "rb") as file:
        return file.read(1).isdigit()


def read_eflesh(
    path: Path, align: Method | Mapping[str, Method] = "linear", max_gap: float | None = None
) -> RecordingArrays:
    """Read the file of the sensor and that of the states beside it.

    Args:
        path: Path of the sensor's file.
        align: Interpolation of the robot and load cell readings, as in `paxisim.Recording.load`.
        max_gap: Longest interval (s) that is interpolated; default: `MAX_GAP`.

    Raises:
        InvalidValueError: A file does not have this format; the message names the file and, where possible, the line.
        FileNotFoundError: One of the files is missing.
    """
    states = path.with_name(
        STATES_NAME if path.name in SENSOR_NAMES else f"{path.name.removesuffix(SENSOR_SUFFIX)}.{STATES_NAME}"
    )
    if not states.exists():
        raise FileNotFoundError(f"{path.name} needs the robot and load cell readings beside it: there is no {states}")
    field, robot = read_rows(path, ","), read_rows(states, ",")
    if field.shape[1] < 4 or field.shape[1] % 3 != 1:
        raise InvalidValueError(
            f"{path}: every row must hold a time and x, y, z of each magnetometer, got {field.shape[1]} values"
        )
    if robot.shape[1] not in (4, 5):
        raise InvalidValueError(
            f"{states}: every row must hold time, x, y, z and, with a load cell, force, got {robot.shape[1]} values"
        )
    magnetometers = (field.shape[1] - 1) // 3
    readings = np.moveaxis(field[:, 1:].reshape(-1, magnetometers, 3), 1, 2)[:, None, :, None].astype(np.float32)
    at = _nanoseconds(states, robot)
    streams = {
        "measured": Stream(_nanoseconds(path, field), readings),
        **{f"{schemas.COVARIATE}robot_{axis}": Stream(at, robot[:, i] * 1e-3) for i, axis in enumerate("xyz", start=1)},
    }
    if robot.shape[1] == 5:
        pressed = robot[:, 4] != _NO_READING
        if not pressed.any():
            raise InvalidValueError(f"{states}: the load cell has no readings")
        streams[schemas.COVARIATE + "load"] = Stream(at[pressed], robot[pressed, 4] * NEWTONS)
        max_gap = MAX_GAP if max_gap is None else max_gap
    layout = TaxelLayout(1, magnetometers, (1e-2, 1e-2), pitch_known=False).to_dict()
    about = {"source": path.name, "sensor": "eflesh", "unit": "uT", "layout": layout, "pads": ("eflesh",)}
    return resample_log(Log(streams, about), align, max_gap)


def read_rows(path: Path, delimiter: str | None) -> NDArray[np.float64]:
    """Return the rows ``(T, columns)`` of a file without a header; the delimiter None is white space.

    Raises:
        InvalidValueError: A row is malformed or not finite; the message has its line.
        FileNotFoundError: The file does not exist.
    """
    try:
        lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    except UnicodeDecodeError as error:
        raise InvalidValueError(
            f"{path}: expected a text of numbers, got the byte {error.object[error.start]:#04x}"
        ) from error
    if not lines:
        raise InvalidValueError(f"{path} is empty")
    try:
        table = np.loadtxt(lines, delimiter=delimiter, ndmin=2, comments=None)
    except ValueError as error:
        raise InvalidValueError(
            f"{path}, line {_malformed(lines, delimiter)}: every row must hold the same number of numeric values, "
            "without a header"
        ) from error
    if not np.isfinite(table).all():
        raise InvalidValueError(f"{path}, line {int(np.argmin(np.isfinite(table).all(axis=1))) + 1} is not finite")
    return table


def _malformed(lines: list[str], delimiter: str | None) -> int:
    """Return the number of the first line that is not numeric, or not as long as the first one."""
    for i, line in enumerate(lines):
        cells = line.split(delimiter)
        try:
            if [float(cell) for cell in cells] and len(cells) == len(lines[0].split(delimiter)):
                continue
        except ValueError:
            pass
        return i + 1
    return 1


def _nanoseconds(path: Path, table: NDArray[np.float64]) -> NDArray[np.int64]:
    if np.any(np.diff(table[:, 0]) < 0):
        raise InvalidValueError(f"{path}: time decreases in line {int(np.argmax(np.diff(table[:, 0]) < 0)) + 2}")
    return np.round(table[:, 0] * 1e9).astype(np.int64)
