"""Redraw: GCS drawn anew for each history that is sampled from the replay buffer."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import paxisim


def can_redraw(gcs: paxisim.GCS | None) -> bool:
    """Whether its chains can be drawn anew for a few frames.

    Not so if they remember what was before those, as with creep, or need covariates, which the buffer does not keep.
    """
    if gcs is None:
        return False
    chain = gcs.sample(np.random.default_rng(0))
    return not chain.has_memory and not chain.covariate_names


class Redraw:
    """Convolution and scaling drawn anew for each sample, one draw for all of its frames.

    The paper draws once an episode. A policy that learns from some hundred episodes then knows each of them by its dead
    taxels and remembers where its hole was: it does well on what it has seen, and on the episode that it is in. With
    other draws at every update there is nothing to recognise. The surface stays the episode's own.
    """

    def __init__(self, gcs: paxisim.GCS, encoding: Any, layout: paxisim.TaxelLayout, seed: int) -> None:
        """Draw from `gcs` for pads of `layout`, and encode as the policy's history does."""
        self._gcs, self._encoding, self._layout = gcs, encoding, layout
        self._rng = np.random.default_rng(seed)

    def __call__(self, frames: NDArray[np.float32]) -> NDArray[np.float32]:
        """Raw frames ``(batch, k, pads, 3, rows, cols)`` (N) as encoded ones ``(batch, k, channels, rows, cols)``."""
        chain = self._gcs.sample(self._rng, (len(frames), 1), layout=self._layout, pads=frames.shape[2])
        return np.asarray(self._encoding.encode(chain(frames)), dtype=np.float32)
