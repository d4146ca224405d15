"""A recording as a numpy archive.

Keys: ``time``, ``measured``, ``simulated``, ``episode``, ``covariate/NAME`` as in `paxisim.Recording`, and ``about``, a
JSON text with the layout, the pads' names and the metadata. Only ``time`` and a tensor are required.
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

from paxisim.errors import InvalidValueError
from paxisim.files import whole_file
from paxisim.logs import schemas
from paxisim.logs.about import about_text, read_about
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


def read_npz(path: Path) -> RecordingArrays:
    """Read what `write_npz` wrote, or an archive with the same keys.

    Raises:
        InvalidValueError: The file is not an npz file, is damaged, or lacks time or a tensor.
    """
    with open(path, "rb") as file:
        try:
            with np.load(file, allow_pickle=False) as archive:
                _check_sizes(path, archive.zip)
                # uses the names in the zip, because numpy accepts both "a" and "a.npy" for the array "a"
                names = archive.zip.namelist()
                arrays: dict[str, Any] = {name.removesuffix(".npy"): archive[name] for name in names}
            plain = [name for name, values in arrays.items() if not isinstance(values, np.ndarray)]
            if plain:
                raise ValueError(f"{plain[0]!r} is not an array")
            about = orjson.loads(str(arrays["about"])) if "about" in arrays else {}
        except InvalidValueError:
            raise
        except _NOT_WHOLE as error:
            raise InvalidValueError(f"{path} is not a complete npz file: {error}") from error
    if "time" not in arrays or not {"measured", "simulated"} & arrays.keys():
        found = ", ".join(arrays) or "nothing"
        raise InvalidValueError(f"{path} must hold 'time' and 'measured' or 'simulated' (or both), got {found}")
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
