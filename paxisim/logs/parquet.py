"""Parquet tables, with the columns of `paxisim.logs.columns`: those of paxisim, and those of LeRobot's data sets.

A column of LeRobot that holds a vector, such as ``observation.state``, becomes one array; where ``meta/info.json`` of
the data set names its components, a column for each, ``observation.state.NAME``. Images and texts are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, MissingExtraError, UnsupportedError
from paxisim.files import whole_file
from paxisim.logs.about import about_text, read_about
from paxisim.logs.columns import to_columns
from paxisim.logs.limits import most_unpacked, refuse_unpacked
from paxisim.logs.parquet_footer import column_chunks
from paxisim.logs.recording_arrays import RecordingArrays
from paxisim.logs.text import parse_json

_ROWS = 8192  # of a row group
_ABOUT = b"paxisim"
_RATIO = 1000  # of what a file unpacks to; that of 28 pads at rest, whose numbers are zeros, is 540
_NOT_WHOLE = (OSError, ValueError, MemoryError)  # of pyarrow, beside its own


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


def write_parquet(path: Path, recording: RecordingArrays) -> None:
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
    table = read_table(path, _is_numeric)
    names = component_names(_features_near(path))
    columns: dict[str, NDArray[Any]] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        values = column_values(f"{path}, column {name!r}", column)
        if values.ndim == 2 and len(names.get(name, ())) == values.shape[1]:
            columns |= {f"{name}.{part}": values[:, i] for i, part in enumerate(names[name])}
        else:
            columns[name] = values
    about = (table.schema.metadata or {}).get(_ABOUT)
    try:
        return columns, {} if about is None else read_about(path, orjson.loads(about))
    except orjson.JSONDecodeError as error:
        raise InvalidValueError(f"{path}: the text under 'paxisim' in its schema is not JSON: {error}") from error


def read_table(path: Path, wanted: Callable[[Any], bool]) -> Any:
    """The columns of a file whose fields, as Arrow has them, are wanted: an Arrow table with at least one row.

    Raises:
        MissingExtraError, UnsupportedError: See `require_pyarrow`.
        InvalidValueError: It is no Parquet file, has no rows, or unpacks to far more than its size.
        FileNotFoundError: There is no such file.
    """
    require_pyarrow()
    import pyarrow as pa
    from pyarrow import parquet

    with open(path, "rb") as file:
        try:
            source = parquet.ParquetFile(pa.PythonFile(file))
            names = [field.name for field in source.schema_arrow if wanted(field)]
            _check_size(path, names)
            # threads that pyarrow is still starting when a short process ends would abort it
            table = source.read(columns=names, use_threads=False)
        except InvalidValueError:
            raise
        except (pa.ArrowException, *_NOT_WHOLE) as error:
            said = (str(error).splitlines() or [type(error).__name__])[0]
            raise InvalidValueError(f"{path} is no whole Parquet file: {said}") from error
    if not table.num_rows:
        raise InvalidValueError(f"{path} has no rows")
    return table


def _check_size(path: Path, names: Sequence[str]) -> None:
    """Look at what the file says that it holds, before anything is unpacked."""
    size, wanted = 0, set(names)
    for chunk in column_chunks(path):
        parts = ".".join(chunk.path).split(".")
        # of "a.b.c" pyarrow also reads what goes on behind "a" or "a.b", where those are wanted
        if any(".".join(parts[:count]) in wanted for count in range(1, len(parts) + 1)):
            size += chunk.values * (chunk.size if chunk.is_text else 8)  # a text may be stored once for all rows
    refuse_unpacked(path, size, most_unpacked(path, _RATIO))


def _is_numeric(field: Any) -> bool:
    return is_numeric(field.type, 1)


def is_numeric(kind: Any, most_nested: int) -> bool:
    """Whether a column of that Arrow type holds numbers, in at most so many lists within one another."""
    import pyarrow as pa

    depth, kind = 0, _stored(kind)
    while _is_list(kind):
        depth, kind = depth + 1, _stored(kind.value_type)
    is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)
    return depth <= most_nested and is_number


def is_text(kind: Any) -> bool:
    """Whether a column of that Arrow type holds texts."""
    import pyarrow as pa

    return pa.types.is_string(kind) or pa.types.is_large_string(kind)


def column_values(place: str, column: Any, dtype: type = np.float64) -> NDArray[Any]:
    """``(T, ...)``: the numbers of a column, of which each row holds an array of the same shape; null is NaN.

    Raises:
        InvalidValueError: A row is missing, or has another shape; `place` is for the message.
    """
    import pyarrow as pa

    parts = []
    for array in column.chunks:
        shape = [len(array)]
        array = _storage(array)
        while _is_list(array.type):
            lengths = array.value_lengths().to_numpy(zero_copy_only=False)
            if not len(lengths) or not lengths[0] > 0 or not np.all(lengths == lengths[0]):
                raise InvalidValueError(f"{place}: every row must hold a vector of the same length")
            shape.append(int(lengths[0]))
            array = _storage(array.flatten())
        numbers = array.cast(pa.from_numpy_dtype(dtype), safe=False).to_numpy(zero_copy_only=False)
        parts.append(numbers.astype(dtype, copy=False).reshape(shape))
    if len({part.shape[1:] for part in parts}) > 1:
        raise InvalidValueError(f"{place}: every row must hold a vector of the same length")
    return np.concatenate(parts)


def _is_list(kind: Any) -> bool:
    import pyarrow as pa

    return pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind)


def _stored(kind: Any) -> Any:
    """What an extension type is stored as; LeRobot's tensors have one where its library is imported."""
    import pyarrow as pa

    return kind.storage_type if isinstance(kind, pa.BaseExtensionType) else kind


def _storage(array: Any) -> Any:
    import pyarrow as pa

    return array.storage if isinstance(array, pa.ExtensionArray) else array


def component_names(features: Any) -> dict[str, list[str]]:
    """Names of the components of each vector that has such, from ``features`` of a data set's ``meta/info.json``."""
    found = {}
    for name, feature in features.items() if isinstance(features, dict) else ():
        given = feature.get("names") if isinstance(feature, dict) else None
        given = next(iter(given.values()), None) if isinstance(given, dict) else given
        if isinstance(given, list) and all(isinstance(part, str) for part in given) and len(set(given)) == len(given):
            found[name] = given
    return found


def _features_near(path: Path) -> Any:
    """What the data set that the file lies in, if any, says of its features."""
    try:
        return parse_json((path.resolve().parents[2] / "meta" / "info.json").read_bytes()).get("features")
    except (OSError, LookupError, InvalidValueError, AttributeError):
        return None
