"""LowPass: a first-order lag, such as a sensor's filter."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.transform import Covariates, State, StatefulTransform, keep

_BLOCK = 16  # frames that one matrix advances
_SPAN = 256 * _BLOCK  # frames whose matrices are in memory at the same time


@dataclass(frozen=True, eq=False)
class LowPass(StatefulTransform):
    """A first-order low-pass filter: ``tau dy/dt = x - y``, without filtering if tau = 0.

    The input is assumed to be piecewise linear between frames (first-order hold), for which the step below is exact at
    any `dt`. A zero-order hold would add half a frame of spurious latency.

    Attributes:
        tau: ``(...)`` time constant (s); the cut-off frequency is ``1 / (2 pi tau)``.
    """

    stage: ClassVar[str] = "electronics"

    tau: Any = parameter(0.0, unit="s", low=0.0, typical=(0.01, 0.16))

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return the previous frame and the output's lead over it."""
        return (keep(x), namespace(x).zeros_like(x))

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        before, ahead = state
        ahead = lag(x - before, ahead, self.broadcast_parameter("tau", x), dt)
        return x + ahead, (keep(x), ahead)

    def between_frames(self, step: float) -> LowPass:
        """See `Transform.between_frames`."""
        return self

    def sweep(self, x: NDArray[np.floating], steps: NDArray[np.float64]) -> NDArray[np.floating] | None:
        """See `Transform.sweep`."""
        return None if np.ndim(self.tau) else x + lag_sequence(x, [(1.0, float(self.tau))], steps)


def lag(change: Any, ahead: Any, tau: Any, dt: Any) -> Any:
    """Advance ``q - x`` by one step of ``tau dq/dt = x - q``, exactly for a linear x.

    This form loses no precision if x is constant, however small `dt` is compared to `tau`.

    Args:
        change: Change of x during the step.
        ahead: q - x before the step.
        tau: Time constant (s); with 0, q equals x.
        dt: Time step (s); with 0, x jumps.

    Returns:
        q - x after the step.
    """
    xp = namespace(change)
    lags = tau > 1e-30 * dt  # else the division would be by zero or nearly zero
    z = dt / xp.where(lags, tau, xp.ones_like(tau))
    run = xp.where(z > 0, z, xp.ones_like(z))
    share = xp.where(z > 0, -xp.expm1(-run) / run, xp.ones_like(z))
    return xp.where(lags, xp.exp(-z) * ahead - share * change, xp.zeros_like(ahead))


def lag_sequence(
    x: NDArray[np.floating], modes: Sequence[tuple[float, float]], steps: NDArray[np.float64]
) -> NDArray[np.floating]:
    """Apply several lags to a whole sequence and return the sum of ``scale (q - x)``.

    A block of frames is one matrix product, whose columns are the changes of x in the block and the leads before it.

    Args:
        x: ``(time, ...)`` sequence; q equals x at the first frame.
        modes: ``(scale, tau)`` of each lag, with tau in s.
        steps: ``(time,)`` or ``(time, *batch)`` time since the previous frame (s).
    """
    clocks = steps.reshape(len(steps), -1)
    own = x.reshape(*clocks.shape, -1)
    scales, taus = np.array(modes, dtype=np.float64).reshape(-1, 2).T
    spans = (clocks[first : first + _SPAN] for first in range(1, len(clocks), _SPAN))
    matrices = chain.from_iterable(_block_matrices(span, scales, taus, x.dtype) for span in spans)
    out, columns = np.zeros_like(own), np.zeros((own.shape[1], _BLOCK + len(modes), own.shape[2]), x.dtype)
    columns_by_frame, leads = columns.swapaxes(0, 1), np.s_[:, _BLOCK:]
    for start, matrix in zip(range(1, len(x), _BLOCK), matrices, strict=True):
        part = slice(start, min(start + _BLOCK, len(x)))
        count = part.stop - start
        np.subtract(own[part], own[start - 1 : part.stop - 1], out=columns_by_frame[:count])
        advanced = matrix @ columns
        out[part] = advanced[:, :count].swapaxes(0, 1)
        columns[leads] = advanced[leads]
    return out.reshape(x.shape)


def _block_matrices(
    steps: NDArray[np.float64], scales: NDArray[np.float64], taus: NDArray[np.float64], dtype: np.dtype
) -> NDArray[np.floating]:
    """``(blocks, streams, frames + modes, frames + modes)`` matrices that advance lags by a block of frames.

    Columns are the changes of x in the frames of the block and the lead of each mode before it. Rows are the scaled sum
    of the leads at each frame, and the lead of each mode after the block.

    Args:
        steps: ``(time, streams)`` s; after the last frame time stands still.
        scales: ``(modes,)`` factors of the leads.
        taus: ``(modes,)`` s.
        dtype: Type of the matrices.
    """
    count, streams, modes = -(-len(steps) // _BLOCK), steps.shape[1], len(taus)
    dt = np.zeros((count * _BLOCK, streams, 1))
    dt[: len(steps), :, 0] = steps
    one, none = np.ones((*dt.shape[:2], modes)), np.zeros((*dt.shape[:2], modes))
    share, decay = lag(one, none, taus, dt), lag(none, one, taus, dt)  # after a change of 1, and after a lead of 1
    share, decay = (v.astype(dtype).reshape(count, _BLOCK, streams, modes) for v in (share, decay))
    responses = np.zeros((_BLOCK, count, streams, modes, _BLOCK + 1), dtype)  # of each frame, to each column
    before = np.zeros_like(responses[0])
    before[..., _BLOCK] = 1
    for frame in range(_BLOCK):
        np.multiply(decay[:, frame, ..., None], before, out=responses[frame])
        responses[frame, ..., frame] = share[:, frame]
        before = responses[frame]
    out = np.zeros((count, streams, _BLOCK + modes, _BLOCK + modes), dtype)
    factors = scales.astype(dtype)
    out[..., :_BLOCK, :_BLOCK] = np.einsum("ibsmj,m->bsij", responses[..., :_BLOCK], factors)
    out[..., :_BLOCK, _BLOCK:] = np.moveaxis(responses[..., _BLOCK] * factors, 0, 2)
    out[..., _BLOCK:, :_BLOCK] = before[..., :_BLOCK]
    own = np.arange(_BLOCK, _BLOCK + modes)
    out[..., own, own] = before[..., _BLOCK]
    return out
