"""A recording as a Parquet table, with the columns of `paxisim.logs.columns`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from paxisim.errors import InvalidValueError, MissingExtraError, UnsupportedError
from paxisim.logs import schemas
from paxisim.logs.aligned import Aligned
from paxisim.logs.atomic import whole_file
from paxisim.logs.columns import to_columns

_ROWS = 8192  # of a row group


def require_pyarrow() -> None:
    """Raise unless a Parquet file can be written.

    Raises:
        MissingExtraError: pyarrow is not installed.
        UnsupportedError: It does not work with what else is installed, as new versions do not with numpy 1.
    """
    try:
        import pyarrow.parquet  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtraError("pyarrow", "parquet", "a Parquet file") from error
    except ImportError as error:
        raise UnsupportedError(f"the pyarrow that is installed cannot be used: {error}") from error


def write_parquet(path: Path, recording: Aligned) -> None:
    """Write the table; the layout, the pads' names and the metadata are JSON under ``paxisim`` in its schema.

    Raises:
        MissingExtraError, UnsupportedError: See `require_pyarrow`.
        InvalidValueError: The metadata cannot be written as JSON.
    """
    require_pyarrow()
    import pyarrow as pa
    from pyarrow import parquet

    layout = recording.layout
    about: dict[str, Any] = {
        "format": schemas.FORMAT,
        "layout": None if layout is None else layout.to_dict(),
        "pads": recording.pads,
        "metadata": recording.metadata,
    }
    try:
        text = json.dumps(about)
    except (TypeError, ValueError) as error:
        raise InvalidValueError(f"the metadata cannot be written as JSON: {error}") from error
    columns = to_columns(recording)
    schema = pa.schema(
        [(name, pa.from_numpy_dtype(values.dtype)) for name, values in columns.items()], metadata={"paxisim": text}
    )
    with whole_file(path) as temporary, parquet.ParquetWriter(temporary, schema) as writer:
        for start in range(0, len(recording.time), _ROWS):
            arrays = [pa.array(values[start : start + _ROWS]) for values in columns.values()]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
