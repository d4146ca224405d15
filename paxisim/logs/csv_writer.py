"""write_csv: a recording as a plain CSV table, with the columns of `paxisim.logs.columns`.

The first line is ``# {JSON}`` with all that columns cannot hold, as in the schema of a Parquet table.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from paxisim.errors import InvalidValueError
from paxisim.files import whole_file
from paxisim.logs.about import about_text
from paxisim.logs.columns import to_columns
from paxisim.logs.recording_arrays import RecordingArrays

_ROWS = 1024  # written at once


def write_csv(path: Path, recording: RecordingArrays) -> None:
    """Write a plain table, which `paxisim.logs.csv` restores completely.

    Raises:
        InvalidValueError: A name has a line break, or the metadata cannot be written as JSON.
    """
    about, columns = about_text(recording), to_columns(recording)
    broken = next((name for name in columns if "\n" in name or "\r" in name), None)
    if broken is not None:
        raise InvalidValueError(f"a CSV file cannot hold a name with a line break, {broken!r}: write .parquet or .npz")
    with whole_file(path) as temporary, open(temporary, "x", encoding="utf-8", newline="") as file:
        file.write(f"# {about}\n")
        table = csv.writer(file, lineterminator="\n")
        table.writerow(columns)
        for start in range(0, len(recording.time), _ROWS):
            parts = (values[start : start + _ROWS] for values in columns.values())
            # the shortest text that gives the same number; an unknown one is empty
            table.writerows(zip(*(np.where(np.isnan(part), "", part.astype(str)) for part in parts), strict=True))
