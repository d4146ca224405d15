"""Encoder: what the steps of encoders are worth in newtons, as a replay finds it and a diagnosis allows for it."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.recording import Recording

LIGHTEST = 0.002
"""Share of the peak force below which a change is not read as a share of the force."""
_BINS = 12


@dataclass(frozen=True)
class EncoderError:
    """What half an encoder step changes.

    The error of a replayed position is no larger. What a step hides of the speed adds to it, so half a step is taken
    for the standard deviation. All taxels in contact get the error at once, as a share of their force.

    Attributes:
        episode: The episode with the highest total normal force.
        newtons: The change of its peak (N).
        peak: The peak (N).
        forces: Total normal forces (N), increasing.
        shares: The change at each of them, as a share of it.
    """

    episode: int
    newtons: float
    peak: float
    forces: tuple[float, ...] = ()
    shares: tuple[float, ...] = ()

    @classmethod
    def of(cls, episode: int, total: NDArray[np.float64], changed: Sequence[NDArray[np.float64]]) -> EncoderError:
        """The error of an episode.

        Args:
            episode: Its number.
            total: ``(T,)`` total normal force (N).
            changed: The same with each encoder half a step further. Their errors add as independent ones.
        """
        peak = float(total.max())
        newtons = float(np.sqrt(sum((float(one.max()) - peak) ** 2 for one in changed)))
        squares = np.sum([(one - total) ** 2 for one in changed], axis=0)
        edges = peak * np.geomspace(LIGHTEST, 1.0, _BINS + 1)
        forces, shares = [], []
        for low, high in itertools.pairwise(edges):
            inside = (total >= low) & (total <= high)
            if inside.any():
                forces.append(float(total[inside].mean()))
                shares.append(float(np.sqrt(squares[inside].mean()) / forces[-1]))
        return cls(episode, newtons, peak, tuple(forces), tuple(shares))

    @classmethod
    def told_by(cls, recording: Recording) -> EncoderError | None:
        """What the replay of a recording says of its encoders; None if it was not replayed, or shows no steps."""
        replay = recording.metadata.get("replay")
        said = replay.get("encoder_error") if isinstance(replay, Mapping) else None
        if not isinstance(said, Mapping):
            return None
        with contextlib.suppress(KeyError, TypeError, ValueError):  # of another version, or written by hand
            error = cls(**{**said, "forces": tuple(said["forces"]), "shares": tuple(said["shares"])})
            if error.forces and np.isfinite([*error.forces, *error.shares]).all():
                return error
        return None

    def variance(self, force: NDArray[np.float64]) -> NDArray[np.float64]:
        """``(T, pads, 3, rows, cols)`` variance (N^2) of a simulated force of that shape."""
        total = force[:, :, 2].sum(axis=(1, 2, 3))
        share = np.interp(total, self.forces, self.shares)
        return (share[:, None, None, None, None] * force) ** 2
