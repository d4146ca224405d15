"""Parquet tables, with the columns of `paxisim.logs.columns`: those of paxisim, and those of LeRobot's data sets.

A column of LeRobot that holds a vector, such as ``observation.state``, becomes one array; where ``meta/info.json`` of
the data set names its components, a column for each, ``observation.state.NAME``. Images and texts are left out.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, MissingExtraError, UnsupportedError
from paxisim.logs.about import about_text, read_about
from paxisim.logs.aligned import Aligned
from paxisim.logs.atomic import whole_file
from paxisim.logs.columns import to_columns

_ROWS = 8192  # of a row group
_ABOUT = b"paxisim"


def require_pyarrow() -> None:
    """Raise unless a Parquet file can be read and written.

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

    text = about_text(recording)
    columns = to_columns(recording)
    schema = pa.schema(
        [(name, pa.from_numpy_dtype(values.dtype)) for name, values in columns.items()], metadata={_ABOUT: text}
    )
    with whole_file(path) as temporary, parquet.ParquetWriter(temporary, schema) as writer:
        for start in range(0, len(recording.time), _ROWS):
            arrays = [pa.array(values[start : start + _ROWS]) for values in columns.values()]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


def read_parquet(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """The columns of numbers, ``(T,)`` or ``(T, n)`` each, and the fields of `paxisim.logs.about` where it has them.

    Raises:
        MissingExtraError, UnsupportedError: See `require_pyarrow`.
        InvalidValueError: It is no Parquet file, or a vector has different lengths.
        FileNotFoundError: There is no such file.
    """
    require_pyarrow()
    import pyarrow as pa
    from pyarrow import parquet

    try:
        with open(path, "rb") as file:
            table = parquet.read_table(pa.PythonFile(file))
    except pa.ArrowException as error:
        raise InvalidValueError(f"{path} is no whole Parquet file: {str(error).splitlines()[0]}") from error
    if not table.num_rows:
        raise InvalidValueError(f"{path} has no rows")
    names = _component_names(path)
    columns: dict[str, NDArray[Any]] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        values = _numbers(f"{path}, column {name!r}", column)
        if values is not None and values.ndim == 2 and len(names.get(name, ())) == values.shape[1]:
            columns |= {f"{name}.{part}": values[:, i] for i, part in enumerate(names[name])}
        elif values is not None:
            columns[name] = values
    about = (table.schema.metadata or {}).get(_ABOUT)
    try:
        return columns, {} if about is None else read_about(path, orjson.loads(about))
    except orjson.JSONDecodeError as error:
        raise InvalidValueError(f"{path}: the text under 'paxisim' in its schema is not JSON: {error}") from error


def _numbers(place: str, column: Any) -> NDArray[Any] | None:
    """``(T,)`` or ``(T, n)``; null is NaN. None where it holds no numbers."""
    import pyarrow as pa

    kind, depth = column.type, 0
    while depth < 2 and (pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)):
        kind, depth = kind.value_type, depth + 1
    if depth > 1 or not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)):
        return None
    if not depth:
        return column.cast(pa.float64()).to_numpy()
    lengths = column.combine_chunks().value_lengths().to_numpy(zero_copy_only=False)
    if not np.all(lengths == lengths[0]) or not lengths[0]:
        raise InvalidValueError(f"{place}: every row must hold a vector of the same length")
    flat = column.combine_chunks().flatten().cast(pa.float64()).to_numpy(zero_copy_only=False)
    return flat.reshape(len(lengths), int(lengths[0]))


def _component_names(path: Path) -> dict[str, list[str]]:
    """Names of the components of each vector, from the description of the data set that the file lies in, if any."""
    try:
        features = json.loads((path.resolve().parents[2] / "meta" / "info.json").read_text(encoding="utf-8"))[
            "features"
        ]
        found = {name: feature.get("names") for name, feature in features.items()}
    except (OSError, LookupError, ValueError, AttributeError, TypeError, RecursionError):
        return {}
    lists = {
        name: next(iter(given.values()), None) if isinstance(given, dict) else given for name, given in found.items()
    }
    return {
        name: given
        for name, given in lists.items()
        if isinstance(given, list) and all(isinstance(part, str) for part in given) and len(set(given)) == len(given)
    }
