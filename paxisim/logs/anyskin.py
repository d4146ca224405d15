"""Text logs of AnySkin: the fields of its magnetometers as numpy writes them, one row per sample.

- ``anyskin_viz --record`` writes x, y and z of each magnetometer in turn, in microtesla, without those at rest. It has
  no times: the rows come at the frame rate of the viewer, which is 60 Hz at most.
- Rows that `AnySkinProcess.get_data` returned begin with a Unix time (s).

The magnetometers are the taxels of a single row, so the tensor is ``(T, 1, 3, 1, magnetometers)`` in **microtesla**, as
the metadata's ``unit`` states. The file does not contain their positions: the layout's pitch is meaningless unless a
layout is given to `paxisim.Recording.load`.

Source of the format: the repository raunaqbhirangi/anyskin, anyskin/visualizations/anyskin_viz.py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.clock import UNIX_FROM, put_in_order
from paxisim.logs.eflesh import read_rows
from paxisim.logs.recording_arrays import RecordingArrays


def read_anyskin(path: Path, rate: float | None = None) -> RecordingArrays:
    """Read a text log.

    Args:
        path: The file.
        rate: Samples per second, needed for a file without times.

    Raises:
        InvalidValueError: The file does not have this format, or lacks times and there is no `rate`, or has both.
        FileNotFoundError: The file does not exist.
    """
    rows = read_rows(path, None)
    columns = rows.shape[1]
    if columns % 3 == 2 or columns < 3:
        raise InvalidValueError(
            f"{path}: every row must hold x, y, z of each magnetometer, after a time or without one, got {columns} "
            "values"
        )
    start = None
    if columns % 3 == 1:
        if rate is not None:
            raise InvalidValueError(f"{path} has times of its own, so it needs no rate")
        rows = np.column_stack(list(put_in_order(path, {"time": rows[:, 0], "fields": rows[:, 1:]}).values()))
        start = float(rows[0, 0]) if rows[0, 0] >= UNIX_FROM else None
        seconds, rows = rows[:, 0] - rows[0, 0], rows[:, 1:]
    elif rate is None:
        raise InvalidValueError(
            f"{path} has no times, only fields: state its samples per second with rate (paxisim convert --rate); "
            "AnySkin's viewer records 60 or fewer"
        )
    else:
        seconds = np.arange(len(rows)) / rate
    count = rows.shape[1] // 3
    return RecordingArrays(
        seconds,
        np.moveaxis(rows.reshape(-1, count, 3), 1, 2)[:, None, :, None].astype(np.float32),
        layout=TaxelLayout(1, count, (1e-2, 1e-2), pitch_known=False),
        pads=("anyskin",),
        metadata={
            "source": path.name,
            "sensor": "anyskin",
            "unit": "uT",
            **({} if start is None else {"start": start}),
        },
    )
