"""check_fields: convert the fields of a recording, check them against each other and fill in defaults."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.recording_arrays import RecordingArrays, episode_starts

# reserved names: files store these as separate fields
_FIELDS_NOT_METADATA = ("format", "layout", "pads", "time_zero_ns", "episode_clocks")
# fewer samples than this may share the time of a coarse clock
_FEW = 8


def check_fields(given: RecordingArrays) -> RecordingArrays:
    """Return the fields with the dtypes and defaults of `paxisim.Recording`; arrays that already match are not copied.

    Raises:
        InvalidValueError: Shapes do not match, there is no tensor or no sample, or time is not finite or decreases
            within an episode.
    """
    time = numbers("time", given.time, np.float64)
    if time.ndim != 1 or not len(time):
        raise InvalidValueError(f"time must be (T,) with at least one sample, got shape {time.shape}")
    measured, simulated = (
        None if value is None else _tensor(name, value, len(time))
        for name, value in (("measured", given.measured), ("simulated", given.simulated))
    )
    tensor = measured if measured is not None else simulated
    if tensor is None:
        raise InvalidValueError("a recording needs a tensor: give measured, simulated or both")
    if simulated is not None and simulated.shape != tensor.shape:
        raise InvalidValueError(f"measured and simulated must have one shape, got {tensor.shape} and {simulated.shape}")
    layout = _layout(given.layout, tensor.shape)
    pads = _pads(given.pads, tensor.shape[1])
    covariates = {name: _covariate(name, value, len(time)) for name, value in given.covariates.items()}
    episode = _episode(given.episode, len(time))
    _check_order(time, episode)
    taken = [name for name in _FIELDS_NOT_METADATA if name in given.metadata]
    if taken:
        raise InvalidValueError(f"metadata must not hold {taken[0]!r}, which is a reserved name")
    return RecordingArrays(time, measured, simulated, covariates, episode, layout, pads, dict(given.metadata))


def check_rate(rate: float) -> None:
    """Check a number of samples per second.

    Raises:
        InvalidValueError: It is not above 0, or above 1e6.
    """
    if not 0 < rate <= 1e6:
        raise InvalidValueError(f"rate must be a number of samples a second, above 0 and up to 1e6, got {rate!r}")


def numbers(name: str, value: Any, dtype: type) -> NDArray[Any]:
    """Return `value` as an array of the given dtype, with NaN where it is masked; error messages call it `name`.

    Raises:
        InvalidValueError: The value is not numeric, its rows differ in length, or a number is infinite or too large
            for the dtype.
    """
    try:
        array = np.asarray(value)
        if array.dtype.kind not in "biuf":
            raise TypeError(f"dtype {array.dtype}")
        if np.ma.is_masked(value):
            array = np.where(np.ma.getmaskarray(value), np.nan, array)
        with np.errstate(over="ignore"):
            array = np.ascontiguousarray(array, dtype=dtype) if array.ndim else array.astype(dtype)
    except (TypeError, ValueError) as error:
        raise InvalidValueError(f"{name} must be an array of numbers: {error}") from error
    # without a mask of the array's size, as np.isinf would make
    if array.size and any(np.isinf(extreme.reduce(array, axis=None)) for extreme in (np.fmax, np.fmin)):
        raise InvalidValueError(
            f"{name} holds a number that is infinite or too large for {array.dtype}; use NaN for unknown values"
        )
    return array


def _tensor(name: str, value: Any, samples: int) -> NDArray[np.float32]:
    tensor = numbers(name, value, np.float32)
    if tensor.ndim != 5 or tensor.shape[2] != 3 or 0 in tensor.shape:
        raise InvalidValueError(f"{name} must have shape (T, pads, 3, rows, cols), got {tensor.shape}")
    if len(tensor) != samples:
        raise InvalidValueError(f"{name} has {len(tensor)} samples, time has {samples}")
    return tensor


def _layout(layout: Any, shape: tuple[int, ...]) -> TaxelLayout:
    rows, cols = shape[-2:]
    if layout is None:
        return TaxelLayout(rows, cols, (1e-3, 1e-3), pitch_known=False)
    if not isinstance(layout, TaxelLayout):
        raise InvalidValueError(f"layout must be a TaxelLayout, got {type(layout).__name__}")
    if (rows, cols) != (layout.rows, layout.cols):
        raise InvalidValueError(f"layout has {layout.rows}x{layout.cols} taxels, the tensors have {rows}x{cols}")
    return layout


def _pads(given: Any, count: int) -> tuple[str, ...]:
    if isinstance(given, str):
        raise InvalidValueError(f"pads must be a sequence of names, got the string {given!r}")
    pads = tuple(str(name) for name in given) or tuple(f"pad{i}" for i in range(count))
    if len(pads) != count or len(set(pads)) != count:
        raise InvalidValueError(f"pads must be {count} different names, one per pad, got {list(pads)}")
    return pads


def _covariate(name: Any, value: Any, samples: int) -> NDArray[np.float64]:
    if not isinstance(name, str) or not name:
        raise InvalidValueError(f"covariates must have names, got {name!r}")
    covariate = numbers(f"covariates[{name!r}]", value, np.float64)
    if covariate.ndim == 0 or len(covariate) != samples or not covariate.size:
        raise InvalidValueError(
            f"covariates[{name!r}] must have shape ({samples}, ...) to match time, got {covariate.shape}"
        )
    return covariate


def _episode(given: Any, samples: int) -> NDArray[np.int64]:
    if given is None:
        return np.zeros(samples, dtype=np.int64)
    whole = numbers("episode", given, np.float64)
    if whole.shape != (samples,):
        raise InvalidValueError(f"episode must have shape {(samples,)} to match time, got {whole.shape}")
    if not np.all(np.isfinite(whole)) or np.any(whole != np.round(whole)):
        raise InvalidValueError("episode must hold whole numbers")
    return np.asarray(given).astype(np.int64)


def _check_order(time: NDArray[np.float64], episode: NDArray[np.int64]) -> None:
    if not np.all(np.isfinite(time)):
        raise InvalidValueError(f"time must be finite, sample {int(np.argmin(np.isfinite(time)))} is not")
    starts = episode_starts(episode)
    found, counts = np.unique(episode[starts], return_counts=True)
    if counts.max() > 1:
        number = found[counts.argmax()]
        raise InvalidValueError(f"the samples of an episode must be adjacent; those of episode {number} are not")
    steps = np.delete(np.diff(time), starts[1:] - 1)
    if len(time) >= _FEW and len(steps) and not steps.any():
        raise InvalidValueError(f"all {len(time)} samples have one time, {time[0]:.9g} s: time must increase")
    back = np.diff(time) < 0
    back[starts[1:] - 1] = False
    if back.any():
        at = int(back.argmax())
        raise InvalidValueError(
            f"time must not decrease within an episode: sample {at + 1} is at {time[at + 1]:.9g} s, "
            f"the one before at {time[at]:.9g} s"
        )
