"""Encoder steps: the resolution of a stream, which its values show no longer once they are interpolated.

An encoder's readings are multiples of its step. At the times of another clock they are interpolated, so the step is
estimated before and kept in the metadata of the recording (``encoder_steps``), in the stream's unit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_KEY = "encoder_steps"


def resolution(values: NDArray[np.float64]) -> float:
    """Estimate the step size of an encoder from its readings; 0 if they show no steps.

    Readings show a step if all differences between them are multiples of the smallest one, and values repeat.
    """
    known = np.unique(values[np.isfinite(values)])
    if not 2 <= len(known) <= 0.5 * np.isfinite(values).sum():
        return 0.0
    gaps = np.diff(known)
    largest = float(np.abs(known).max())
    gaps = gaps[gaps > 1e-6 * largest]  # drops rounding errors of values that were once float32
    if not len(gaps):
        return 0.0
    step = float(gaps.min())
    counts = np.round(gaps / step)
    step = float(gaps.sum() / counts.sum())
    return step if np.all(np.abs(gaps / step - counts) < 0.02 * np.maximum(counts, 1)) else 0.0


def with_steps(metadata: Mapping[str, Any], readings: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return metadata with the steps of streams that are about to be interpolated.

    Args:
        metadata: Metadata of the recording, with steps found before.
        readings: ``(T,)`` or ``(T, columns)`` readings by name of the covariate; others are skipped.
    """
    steps = _noted(metadata)
    for name, values in readings.items():
        if values.ndim in (1, 2) and name not in steps and np.issubdtype(values.dtype, np.number):
            own = [float(f"{resolution(column):.6g}") for column in values.reshape(len(values), -1).T]
            if any(own):
                steps[name] = own if values.ndim == 2 else own[0]
    return {**metadata, _KEY: steps} if steps else dict(metadata)


def noted_step(metadata: Mapping[str, Any], name: str, column: int | None) -> float:
    """Return the step of a stream, or of one of its columns, from the metadata; 0 if none is noted."""
    own = _noted(metadata).get(name, 0.0)
    if column is not None:
        own = own[column] if isinstance(own, Sequence) and column < len(own) else 0.0
    # files may have been written by another program
    return float(own) if isinstance(own, (int, float)) and 0 < own < np.inf else 0.0


def _noted(metadata: Mapping[str, Any]) -> dict[str, Any]:
    found = metadata.get(_KEY)
    return dict(found) if isinstance(found, Mapping) else {}
