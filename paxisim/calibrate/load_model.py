"""Load model: an estimate of the load from all channels of a sensor, by linear or quadratic ridge regression."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from paxisim.calibrate.fit import blocks_of, is_lower
from paxisim.calibrate.lagged import MAX_VALUES, Array, Sums, block_sums
from paxisim.calibrate.linear import LinearCalibration
from paxisim.calibrate.loads import Load, values_of
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

Kind = Literal["best", "linear", "quadratic"]
"""Terms of a load model; ``"best"`` chooses linear or quadratic by the held-out error."""
RIDGES = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
"""Regularisation strengths that are tried, in units of the variance of the terms."""
MAX_ALIGNED_SHARE = 0.5
"""Largest share of the held-out squared error that may be left for loads to be shifted by the delay in the fit."""
MAX_SQUARED_CHANNELS = 48
"""Maximum number of channels of a quadratic model, which has one term per pair of channels."""


@dataclass(frozen=True, eq=False, repr=False)
class LoadModel:
    """Estimate of the load from all channels at once; a `LinearCalibration` gives one estimate per channel instead.

    Live use cannot undo a delay, so the error is that of the load at the time of the channels.

    Attributes:
        loads: Components of the load.
        used: ``(pads, 3, rows, cols)`` mask of the channels that the model uses.
        quadratic: Whether the model includes squares and products of the channels.
        ridge: Regularisation strength chosen by the held-out error.
        delay: Delay of the channels after the loads that the model was fitted to (s).
        center: ``(channels,)`` mean of each used channel, in channel units.
        spread: ``(channels,)`` standard deviation of each used channel, in channel units.
        weights: ``(1 + terms, loads)`` weights (N or N m): a constant, then one for each term.
        error: ``(loads,)`` root-mean-square error on held-out data (N, N m), as applied live.
        explained: ``(loads,)`` share of the variance explained on held-out data.
    """

    loads: tuple[Load, ...]
    used: NDArray[np.bool_]
    quadratic: bool
    ridge: float
    delay: float
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
        when = "at the same time"
        if self.delay:
            when = f"{abs(1e3 * self.delay):.1f} ms {'earlier' if self.delay > 0 else 'later'}"
        lines = [
            f"load from all {self.used.sum()} channels together, {kind}, ridge {self.ridge:g}",
            f"fitted to the load {when}",
            "error on held-out data, of the load at the same time, as live",
        ]
        for load, error, explained in zip(self.loads, self.error, self.explained, strict=True):
            lines.append(f"{load.name:{width}}  {error:>8.3g} {load.unit:<4} explained {explained:.2%}")
        return "\n".join(lines)


def fit_load_model(recording: Recording, readout: LinearCalibration, *, kind: Kind = "best") -> LoadModel:
    """Fit the load to all channels that a readout uses; held-out blocks choose the regularisation.

    The loads are shifted by the readout's delay if this removes at least half of the held-out squared error of a linear
    model. Otherwise the delay may be hysteresis, and a shift would only add to the error in live use.

    Args:
        recording: The recording that the readout was fitted to, with the loads in its covariates.
        readout: LinearCalibration that provides the used channels and the delay.
        kind: ``"linear"`` or ``"quadratic"``, which adds squares and products of the channels. ``"best"`` is quadratic
            if that lowers the held-out error by more than one standard error, and linear for more than 48 channels.

    Raises:
        InvalidValueError: There is no such kind, there are too many channels for a quadratic model, or the recording
            does not fit the readout.
    """
    if kind not in get_args(Kind):
        raise InvalidValueError(f"the kind of a load model must be 'best', 'linear' or 'quadratic', got {kind!r}")
    count = int(readout.used.sum())
    if kind == "quadratic" and count > MAX_SQUARED_CHANNELS:
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
    channels = recording.measured[:, readout.used].astype(np.float64)
    block = blocks_of(recording, values)
    linear, errors = _fit(readout, channels, values, values, block)
    target, delay = values, 0.0
    if readout.delay:
        shifted = readout.earlier(recording, values, readout.delay)
        aligned = _fit(readout, channels, shifted, values, block, readout.delay)
        if aligned[1].sum() < MAX_ALIGNED_SHARE * errors.sum():
            linear, errors = aligned
            target, delay = shifted, readout.delay
    if kind == "linear" or count > MAX_SQUARED_CHANNELS:
        return linear
    quadratic, lower = _fit(readout, channels, target, values, block, delay, quadratic=True)
    return quadratic if kind == "quadratic" or is_lower(lower, errors) else linear


def _fit(
    readout: LinearCalibration,
    channels: Array,
    target: Array,
    live: Array,
    block: NDArray[np.intp],
    delay: float = 0.0,
    quadratic: bool = False,
) -> tuple[LoadModel, Array]:
    """Return the model with the ridge of the lowest held-out error, and this error by block.

    Args:
        readout: The readout that chose the channels.
        channels: ``(T, channels)`` used channels.
        target: ``(T, loads)`` loads to fit; their held-out error chooses the ridge.
        live: ``(T, loads)`` loads at the time of the channels, for the error of the model.
        block: ``(T,)`` block number of each sample, from 0.
        delay: Delay by which `target` is shifted (s).
        quadratic: Whether to add squares and products of the channels.

    Returns:
        The model, and ``(blocks,)`` mean squared errors of `target`, with each load scaled to unit variance.
    """
    center, spread = channels.mean(axis=0), np.maximum(channels.std(axis=0), 1e-12)
    scaled = (channels - center) / spread
    stride = -(-len(scaled) * _terms(scaled[:1], quadratic).shape[1] // MAX_VALUES)
    level, scatter = live.mean(axis=0), np.maximum(live.std(axis=0), 1e-12)
    terms = _terms(scaled[::stride], quadratic)
    mean, size = terms[:, 1:].mean(axis=0), np.maximum(terms[:, 1:].std(axis=0), 1e-12)
    terms[:, 1:] = (terms[:, 1:] - mean) / size
    values = np.concatenate([(target - level) / scatter, (live - level) / scatter], axis=1)
    sums = block_sums(terms, values[::stride], block[::stride], int(block.max()) + 1)
    count = len(readout.loads)
    fitted = Sums(sums.count, sums.xx, sums.xy[..., :count], sums.yy[:, :count])
    judged = Sums(sums.count, sums.xx, sums.xy[..., count:], sums.yy[:, count:])
    others = fitted.without()
    solutions = [others.solve(ridge) for ridge in RIDGES]
    errors = [fitted.squares(solution) for solution in solutions]  # (blocks, loads) each
    best = int(np.argmin([squares.sum() for squares in errors]))
    squares = judged.squares(solutions[best]).sum(axis=0) / sums.count.sum()
    variance = judged.yy.sum(axis=0) / sums.count.sum()
    solved = fitted.total().solve(RIDGES[best])[0]
    # back to terms built from the standardised channels
    solved[1:] /= size[:, None]
    solved[0] -= mean @ solved[1:]
    weights = solved * scatter
    weights[0] += level
    model = LoadModel(
        readout.loads,
        readout.used,
        quadratic,
        RIDGES[best],
        delay,
        center,
        spread,
        weights,
        np.sqrt(squares) * scatter,
        1 - squares / variance,
    )
    return model, errors[best].mean(axis=1) / sums.count


def _terms(scaled: Array, quadratic: bool) -> Array:
    """Return the terms ``(..., 1 + terms)``: a constant, the channels, and if `quadratic` each product of two."""
    parts = [np.ones((*scaled.shape[:-1], 1)), scaled]
    if quadratic:
        first, second = np.triu_indices(scaled.shape[-1])
        parts.append(scaled[..., first] * scaled[..., second])
    return np.concatenate(parts, axis=-1)
