"""Encoder: the force error caused by encoder steps, as determined by a replay and considered by a diagnosis."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.recording import Recording

MIN_FORCE_FRACTION = 0.002
"""Fraction of the peak force below which the relative error is not evaluated."""
_BINS = 12


@dataclass(frozen=True)
class EncoderError:
    """Force change caused by half an encoder step.

    The position error of a replay is at most half a step. Because the steps also hide part of the speed, half a step is
    used as the standard deviation. The error affects all taxels in contact at once, in proportion to their force.

    Attributes:
        episode: Number of the episode with the highest total normal force.
        newtons: Change of its peak (N).
        peak: Its peak total normal force (N).
        forces: Total normal forces (N), increasing.
        shares: Relative change at each of these forces.
    """

    episode: int
    newtons: float
    peak: float
    forces: tuple[float, ...] = ()
    shares: tuple[float, ...] = ()

    @classmethod
    def of(cls, episode: int, total: NDArray[np.float64], changed: Sequence[NDArray[np.float64]]) -> EncoderError:
        """Return the error of an episode.

        Args:
            episode: Number of the episode.
            total: ``(T,)`` total normal force (N).
            changed: Total normal forces with each encoder moved by half a step, one array per encoder. The errors are
                combined as independent.
        """
        peak = float(total.max())
        newtons = float(np.sqrt(sum((float(one.max()) - peak) ** 2 for one in changed)))
        squares = np.sum([(one - total) ** 2 for one in changed], axis=0)
        edges = peak * np.geomspace(MIN_FORCE_FRACTION, 1.0, _BINS + 1)
        forces, shares = [], []
        for low, high in itertools.pairwise(edges):
            inside = (total >= low) & (total <= high)
            if inside.any():
                forces.append(float(total[inside].mean()))
                shares.append(float(np.sqrt(squares[inside].mean()) / forces[-1]))
        return cls(episode, newtons, peak, tuple(forces), tuple(shares))

    @classmethod
    def from_recording(cls, recording: Recording) -> EncoderError | None:
        """Return the error stored by the replay of a recording; None without a replay or without encoder steps."""
        replay = recording.metadata.get("replay")
        said = replay.get("encoder_error") if isinstance(replay, Mapping) else None
        if not isinstance(said, Mapping):
            return None
        with contextlib.suppress(KeyError, TypeError, ValueError):  # the entry may be from another version or edited
            error = cls(**{**said, "forces": tuple(said["forces"]), "shares": tuple(said["shares"])})
            if error.forces and np.isfinite([*error.forces, *error.shares]).all():
                return error
        return None

    def variance(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the variance (N^2) of a simulated force ``(T, pads, 3, rows, cols)``, of the same shape."""
        total = force[:, :, 2].sum(axis=(1, 2, 3))
        share = np.interp(total, self.forces, self.shares)
        return (share[:, None, None, None, None] * force) ** 2
