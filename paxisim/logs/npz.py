"""A recording as a numpy archive.

Keys: ``time``, ``measured``, ``simulated``, ``episode``, ``covariate/NAME`` as in `paxisim.Recording`, and ``about``, a
JSON text with the layout, the pads' names and the metadata. Only ``time`` and a tensor are required.

An archive of another program is read if the caller states which of its arrays these are. A tensor may then have other
axes, in words of `paxisim.logs.axes.WORDS`, and the rate may take the place of ``time``.
"""

from __future__ import annotations

import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.files import whole_file
from paxisim.layout import TaxelLayout
from paxisim.logs import schemas
from paxisim.logs.about import about_text, read_about
from paxisim.logs.axes import given_axes, on_grid, tensor_of
from paxisim.logs.limits import most_unpacked, refuse_unpacked
from paxisim.logs.recording_arrays import RecordingArrays

# errors of numpy and zipfile for data that are not an archive, or a damaged one
_NOT_WHOLE = (
    ValueError,
    TypeError,
    LookupError,
    SyntaxError,
    RecursionError,
    MemoryError,
    OverflowError,
    struct.error,
    tokenize.TokenError,
    RuntimeError,
    AttributeError,
    NotImplementedError,
    EOFError,
    OSError,
    zipfile.BadZipFile,
    zlib.error,
)
_RATIO = 100  # limit on the compression ratio; paxisim itself does not compress
_ARRAYS = ("time", "measured", "simulated", "episode")


def write_npz(path: Path, recording: RecordingArrays) -> None:
    """Write the arrays without loss of precision.

    Raises:
        InvalidValueError: The metadata cannot be written as JSON, or a value is infinite.
    """
    arrays = {name: getattr(recording, name) for name in _ARRAYS if getattr(recording, name) is not None}
    arrays |= {schemas.COVARIATE + name: value for name, value in recording.covariates.items()}
    _refuse_infinite(arrays)
    text = about_text(recording)
    with whole_file(path) as temporary, open(temporary, "xb") as file:
        np.savez(file, about=np.array(text), **arrays)


def read_npz(
    path: Path,
    names: Mapping[str, str] | None = None,
    axes: Mapping[str, str] | None = None,
    rate: float | None = None,
    layout: TaxelLayout | None = None,
) -> RecordingArrays:
    """Read what `write_npz` wrote, or an archive with the same keys or others.

    Args:
        path: The file.
        names: Key in the archive of ``time``, ``measured``, ``simulated``, ``episode`` or a covariate.
        axes: Axes of a tensor by its key in the archive; default: those of `RecordingArrays`.
        rate: Samples per second, for an archive without times.
        layout: Layout of the taxels of a tensor with an axis of taxels.

    Raises:
        InvalidValueError: The file is not an npz file, is damaged, or lacks time or a tensor; or the axes do not fit.
        UnknownNameError: There is no array of a stated name.
    """
    with open(path, "rb") as file:
        try:
            with np.load(file, allow_pickle=False) as archive:
                _check_sizes(path, archive.zip)
                # uses the names in the zip, because numpy accepts both "a" and "a.npy" for the array "a"
                members = archive.zip.namelist()
                arrays: dict[str, Any] = {name.removesuffix(".npy"): archive[name] for name in members}
            plain = [name for name, values in arrays.items() if not isinstance(values, np.ndarray)]
            if plain:
                raise ValueError(f"{plain[0]!r} is not an array")
            about = orjson.loads(str(arrays["about"])) if "about" in arrays else {}
        except InvalidValueError:
            raise
        except _NOT_WHOLE as error:
            raise InvalidValueError(f"{path} is not a complete npz file: {error}") from error
    arrays = _renamed(path, arrays, names or {}, axes or {}, layout)
    if rate is not None:
        if "time" in arrays:
            raise InvalidValueError(f"{path} has times of its own, so it needs no rate")
        tensor = arrays.get("measured", arrays.get("simulated"))
        arrays["time"] = np.arange(len(tensor) if tensor is not None and tensor.ndim else 0) / rate
    if "time" not in arrays or not {"measured", "simulated"} & arrays.keys():
        found = ", ".join(arrays) or "nothing"
        raise InvalidValueError(
            f"{path} must hold 'time' and 'measured' or 'simulated' (or both), got {found}; say which they "
            "are with names (paxisim convert --names measured=KEY), and the samples per second with rate (--rate)"
        )
    _refuse_infinite(arrays, f"{path}: ")
    return RecordingArrays(
        **{name: arrays[name] for name in _ARRAYS if name in arrays},
        covariates={
            name.removeprefix(schemas.COVARIATE): value
            for name, value in arrays.items()
            if name.startswith(schemas.COVARIATE)
        },
        **read_about(path, about),
    )


def _renamed(
    path: Path, arrays: dict[str, Any], names: Mapping[str, str], axes: Mapping[str, str], layout: TaxelLayout | None
) -> dict[str, Any]:
    """Return the arrays by the keys of a recording; a tensor whose axes are given has those of one."""
    for key in (*names.values(), *axes):
        if key not in arrays:
            raise UnknownNameError("array", key, arrays)
    for key, text in axes.items():
        if arrays[key].dtype.kind not in "biuf":
            raise InvalidValueError(f"{path}: {key} must be an array of numbers, got dtype {arrays[key].dtype}")
        own = given_axes(key, arrays[key].shape[1:], text)
        tensor = tensor_of(arrays[key], own)
        arrays[key] = on_grid(tensor, layout) if "taxels" in own else tensor
    kept = {key: values for key, values in arrays.items() if key not in names.values()}
    return kept | {name if name in _ARRAYS else schemas.COVARIATE + name: arrays[key] for name, key in names.items()}


def _check_sizes(path: Path, archive: zipfile.ZipFile) -> None:
    """Check the declared sizes of the archive's members and of their arrays before anything is unpacked."""
    members = archive.infolist()
    refuse_unpacked(path, sum(member.file_size for member in members), most_unpacked(path, _RATIO))
    for member in members:
        with archive.open(member) as file:
            version = np.lib.format.read_magic(file)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, dtype = read(file)
            size = math.prod(shape) * dtype.itemsize
            # numpy allocates the array before it reads the data
            if min(shape, default=0) < 0 or size > member.file_size:
                raise ValueError(f"{member.filename} declares {size} bytes of numbers, but holds {member.file_size}")


def _refuse_infinite(arrays: Mapping[str, NDArray[Any]], where: str = "") -> None:
    for name, values in arrays.items():
        if values.dtype.kind == "f" and np.isinf(values).any():  # consistent with MCAP files and tables
            raise InvalidValueError(
                f"{where}{name!r} holds an infinite value, which a file cannot store; use NaN for unknown values"
            )
