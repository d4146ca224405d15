"""Redraw: a new draw of GCS for each history sampled from the replay buffer."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import paxisim


def can_redraw(gcs: paxisim.GCS | None) -> bool:
    """Return whether chains can be redrawn for a short history of frames.

    They cannot if they have memory of earlier frames, such as creep, or need covariates, which the buffer does not
    store.
    """
    if gcs is None:
        return False
    chain = gcs.sample(np.random.default_rng(0))
    return not chain.has_memory and not chain.covariate_names


class Redraw:
    """Convolution and scaling redrawn for each sample, with one draw for all of its frames.

    The paper draws once per episode. A policy that learns from a few hundred episodes can then recognise each of them
    by its dead taxels and memorise where its hole was. It overfits to the episodes it has seen, including the current
    one. Redrawing at every update prevents this. The surface stays that of the episode.
    """

    def __init__(self, gcs: paxisim.GCS, encoding: Any, layout: paxisim.TaxelLayout, seed: int) -> None:
        """Draw from `gcs` for pads of `layout`, and encode frames as the policy's history does."""
        self._gcs, self._encoding, self._layout = gcs, encoding, layout
        self.seed(seed)

    def seed(self, seed: int) -> None:
        """Begin new random draws."""
        self._rng = np.random.default_rng(seed)

    def __call__(self, frames: NDArray[np.float32]) -> NDArray[np.float32]:
        """Encode raw frames ``(batch, k, pads, 3, rows, cols)`` (N) to ``(batch, k, channels, rows, cols)``."""
        chain = self._gcs.sample(self._rng, (len(frames), 1), layout=self._layout, pads=frames.shape[2])
        return np.asarray(self._encoding.encode(chain(frames)), dtype=np.float32)
