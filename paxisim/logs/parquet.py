"""Parquet tables with the columns of `paxisim.logs.columns`, written by paxisim or from LeRobot datasets.

A LeRobot column that holds a vector, such as ``observation.state``, becomes one array. If ``meta/info.json`` of the
dataset names the vector's components, each becomes a column ``observation.state.NAME``. Images and texts are skipped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, MissingExtraError, UnsupportedError
from paxisim.files import parse_json, whole_file
from paxisim.logs.about import about_text, covariate_shapes, read_about
from paxisim.logs.columns import take_covariates, to_columns
from paxisim.logs.limits import most_unpacked, refuse_unpacked
from paxisim.logs.parquet_footer import column_chunks
from paxisim.logs.recording_arrays import RecordingArrays

_ROWS = 8192  # per row group
_ABOUT = b"paxisim"
_RATIO = 1000  # limit on the compression ratio; 28 pads at rest, whose values are all zeros, reach 540
_NOT_WHOLE = (OSError, ValueError, MemoryError)  # errors that pyarrow raises besides its own


def require_pyarrow() -> None:
    """Check that Parquet files can be read and written.

    Raises:
        MissingExtraError: pyarrow is not installed.
        UnsupportedError: pyarrow does not work with other installed packages, as new versions with numpy 1.
    """
    try:
        import pyarrow.parquet  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtraError("pyarrow", "parquet", "a Parquet file") from error
    except ImportError as error:
        raise UnsupportedError(f"the installed pyarrow cannot be used: {error}") from error


def write_parquet(path: Path, recording: RecordingArrays) -> None:
    """Write the table; its schema has layout, pad names, shapes of covariates and metadata as JSON under ``paxisim``.

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
    """Return the numeric columns, each ``(T,)`` or ``(T, n)``, and what paxisim states in the schema, if it does.

    The latter are ``layout``, ``pads``, ``metadata`` and ``covariates``, whose columns are not among those returned.

    Raises:
        MissingExtraError, UnsupportedError: See `require_pyarrow`.
        InvalidValueError: The file is not a Parquet file, or a vector changes its length.
        FileNotFoundError: The file does not exist.
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
    text = (table.schema.metadata or {}).get(_ABOUT)
    if text is None:
        return columns, {}
    try:
        document = orjson.loads(text)
    except orjson.JSONDecodeError as error:
        raise InvalidValueError(f"{path}: the text under 'paxisim' in its schema is not JSON: {error}") from error
    about = read_about(path, document)
    return columns, about | {"covariates": take_covariates(columns, covariate_shapes(document))}


def read_table(path: Path, wanted: Callable[[Any], bool]) -> Any:
    """Return an Arrow table of the columns whose Arrow field satisfies `wanted`; it has at least one row.

    Raises:
        MissingExtraError, UnsupportedError: See `require_pyarrow`.
        InvalidValueError: The file is not a Parquet file, has no rows, or unpacks to far more than its size.
        FileNotFoundError: The file does not exist.
    """
    require_pyarrow()
    import pyarrow as pa
    from pyarrow import parquet

    with open(path, "rb") as file:
        try:
            source = parquet.ParquetFile(pa.PythonFile(file))
            names = [field.name for field in source.schema_arrow if wanted(field)]
            _check_size(path, names)
            # a short process would abort if it ended while pyarrow is still starting threads
            table = source.read(columns=names, use_threads=False)
        except InvalidValueError:
            raise
        except (pa.ArrowException, *_NOT_WHOLE) as error:
            said = (str(error).splitlines() or [type(error).__name__])[0]
            raise InvalidValueError(f"{path} is not a complete Parquet file: {said}") from error
    if not table.num_rows:
        raise InvalidValueError(f"{path} has no rows")
    return table


def _check_size(path: Path, names: Sequence[str]) -> None:
    """Check the declared size of the columns before anything is unpacked."""
    size, wanted = 0, set(names)
    for chunk in column_chunks(path):
        parts = ".".join(chunk.path).split(".")
        # pyarrow reads "a.b.c" also if only its prefix "a" or "a.b" is wanted
        if any(".".join(parts[:count]) in wanted for count in range(1, len(parts) + 1)):
            # a text may be stored only once for all rows, by dictionary encoding
            size += chunk.values * (chunk.size if chunk.is_text else 8)
    refuse_unpacked(path, size, most_unpacked(path, _RATIO))


def _is_numeric(field: Any) -> bool:
    return is_numeric(field.type, 1)


def is_numeric(kind: Any, most_nested: int) -> bool:
    """Return whether a column of an Arrow type holds numbers, in at most `most_nested` levels of lists."""
    import pyarrow as pa

    depth, kind = 0, _stored(kind)
    while _is_list(kind):
        depth, kind = depth + 1, _stored(kind.value_type)
    is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind)
    return depth <= most_nested and is_number


def is_text(kind: Any) -> bool:
    """Return whether a column of an Arrow type holds text."""
    import pyarrow as pa

    return pa.types.is_string(kind) or pa.types.is_large_string(kind)


def column_values(place: str, column: Any, dtype: type = np.float64) -> NDArray[Any]:
    """Return the numbers of a column as ``(T, ...)``; each row holds an array of the same shape, and null is NaN.

    Raises:
        InvalidValueError: A row is missing or differs in shape; the message names `place`.
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
    """Return the storage type of an extension type; LeRobot's tensors have one if its library is imported."""
    import pyarrow as pa

    return kind.storage_type if isinstance(kind, pa.BaseExtensionType) else kind


def _storage(array: Any) -> Any:
    import pyarrow as pa

    return array.storage if isinstance(array, pa.ExtensionArray) else array


def component_names(features: Any) -> dict[str, list[str]]:
    """Return the component names of each vector, if given, from ``features`` of a dataset's ``meta/info.json``."""
    found = {}
    for name, feature in features.items() if isinstance(features, dict) else ():
        given = feature.get("names") if isinstance(feature, dict) else None
        given = next(iter(given.values()), None) if isinstance(given, dict) else given
        if isinstance(given, list) and all(isinstance(part, str) for part in given) and len(set(given)) == len(given):
            found[name] = given
    return found


def _features_near(path: Path) -> Any:
    """Return the features described by the dataset that contains the file, or None."""
    try:
        return parse_json((path.resolve().parents[2] / "meta" / "info.json").read_bytes()).get("features")
    except (OSError, LookupError, InvalidValueError, AttributeError):
        return None
