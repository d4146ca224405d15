"""Load model: an estimate of the load from all channels of a sensor, by a linear or quadratic fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.calibrate.fit import blocks_of, least_ridge
from paxisim.calibrate.lagged import MAX_VALUES, Array, block_sums
from paxisim.calibrate.linear import LinearCalibration
from paxisim.calibrate.loads import Load, values_of
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

MAX_SQUARED_CHANNELS = 48
"""Maximum number of channels of a quadratic model, which has one term per pair of channels."""


@dataclass(frozen=True, eq=False, repr=False)
class LoadModel:
    """Estimate of the load from all channels at once; a `LinearCalibration` gives one estimate per channel instead.

    Attributes:
        loads: Components of the load.
        used: ``(pads, 3, rows, cols)`` mask of the channels that the model uses.
        quadratic: Whether the model includes squares and products of the channels.
        center: ``(channels,)`` mean of each used channel, in channel units.
        spread: ``(channels,)`` standard deviation of each used channel, in channel units.
        weights: ``(1 + terms, loads)`` weights (N or N m): a constant, then one for each term.
        error: ``(loads,)`` root-mean-square error on held-out data (N, N m).
        explained: ``(loads,)`` share of the variance explained on held-out data.
    """

    loads: tuple[Load, ...]
    used: NDArray[np.bool_]
    quadratic: bool
    center: NDArray[np.float64]
    spread: NDArray[np.float64]
    weights: NDArray[np.float64]
    error: NDArray[np.float64]
    explained: NDArray[np.float64]

    def __call__(self, channels: NDArray[np.floating]) -> NDArray[np.float64]:
        """Convert ``(..., pads, 3, rows, cols)`` channels to ``(..., loads)`` newtons and newton-metres."""
        own = np.asarray(channels, dtype=np.float64)[..., self.used]
        return _terms((own - self.center) / self.spread, self.quadratic) @ self.weights

    def __repr__(self) -> str:
        """One-line summary."""
        kind = "quadratic" if self.quadratic else "linear"
        return f"LoadModel({', '.join(load.name for load in self.loads)} from {self.used.sum()} channels, {kind})"

    def __str__(self) -> str:
        """Table of the held-out error of each load."""
        kind = "quadratic" if self.quadratic else "linear"
        width = max(4, *(len(load.name) for load in self.loads))
        lines = [f"load from all {self.used.sum()} channels together, {kind}; error on held-out data"]
        for load, error, explained in zip(self.loads, self.error, self.explained, strict=True):
            lines.append(f"{load.name:{width}}  {error:>8.3g} {load.unit:<4} explained {explained:.2%}")
        return "\n".join(lines)


def fit_load_model(recording: Recording, readout: LinearCalibration, *, quadratic: bool = False) -> LoadModel:
    """Fit the load to all channels that a readout uses; held-out blocks choose the regularisation.

    Args:
        recording: The recording that the readout was fitted to, with the loads in its covariates.
        readout: LinearCalibration that provides the used channels and the delay.
        quadratic: Whether to add squares and products of the channels. With few presses, the held-out error shows
            whether they help.

    Raises:
        InvalidValueError: There are too many channels for a quadratic model, or the recording does not fit the readout.
    """
    count = int(readout.used.sum())
    if quadratic and count > MAX_SQUARED_CHANNELS:
        raise InvalidValueError(
            f"a quadratic model takes at most {MAX_SQUARED_CHANNELS} channels, as it has a term for each pair; the "
            f"readout uses {count}: fit a linear model"
        )
    if recording.measured is None or recording.measured.shape[1:] != readout.used.shape:
        raise InvalidValueError(
            f"the recording must have measured tensors of shape {readout.used.shape}, like the readout"
        )
    values = values_of(recording, readout.loads)
    known = np.isfinite(values).all(axis=1) & np.isfinite(recording.measured[:, readout.used]).all(axis=1)
    recording, values = recording[known], values[known]
    assert recording.measured is not None
    values = readout.earlier(recording, values)
    channels = recording.measured[:, readout.used].astype(np.float64)
    center, spread = channels.mean(axis=0), np.maximum(channels.std(axis=0), 1e-12)
    scaled = (channels - center) / spread
    stride = -(-len(scaled) * _terms(scaled[:1], quadratic).shape[1] // MAX_VALUES)
    level, scatter = values.mean(axis=0), np.maximum(values.std(axis=0), 1e-12)
    terms = _terms(scaled[::stride], quadratic)
    mean, size = terms[:, 1:].mean(axis=0), np.maximum(terms[:, 1:].std(axis=0), 1e-12)
    terms[:, 1:] = (terms[:, 1:] - mean) / size
    block = blocks_of(recording, values)
    sums = block_sums(terms, ((values - level) / scatter)[::stride], block[::stride], int(block.max()) + 1)
    ridge = least_ridge(sums)
    squares = sums.squares(sums.without().solve(ridge)).sum(axis=0) / sums.count.sum()
    variance = sums.yy.sum(axis=0) / sums.count.sum()
    solved = sums.total().solve(ridge)[0]
    # back to terms built from the standardised channels
    solved[1:] /= size[:, None]
    solved[0] -= mean @ solved[1:]
    weights = solved * scatter
    weights[0] += level
    error = np.sqrt(squares) * scatter
    return LoadModel(readout.loads, readout.used, quadratic, center, spread, weights, error, 1 - squares / variance)


def _terms(scaled: Array, quadratic: bool) -> Array:
    """Return the terms ``(..., 1 + terms)``: a constant, the channels, and if `quadratic` each product of two."""
    parts = [np.ones((*scaled.shape[:-1], 1)), scaled]
    if quadratic:
        first, second = np.triu_indices(scaled.shape[-1])
        parts.append(scaled[..., first] * scaled[..., second])
    return np.concatenate(parts, axis=-1)
