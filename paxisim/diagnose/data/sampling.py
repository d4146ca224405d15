"""Sampling: the frames of a recording that suffice for a fit, and those that suffice to compare a prediction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.pieces import FloatArray
from paxisim.diagnose.rules import FITTING


@dataclass(frozen=True, eq=False)
class Sampling:
    """Strides at which the frames of each episode are used.

    Attributes:
        episodes: Samples of each episode.
        simulated: ``(T, pads, 3, rows, cols)`` newtons.
        weight: ``(T, pads, 3, rows, cols)`` weights of a residual.
        interval: Interval between frames, in seconds.
        samples: Number of compared values if all frames are used.
    """

    episodes: Sequence[slice]
    simulated: FloatArray
    weight: FloatArray
    interval: float
    samples: int

    @cached_property
    def compared(self) -> int:
        """Stride of the frames that suffice to compare a prediction."""
        return max(1, round(self.samples / FITTING.values))

    @cached_property
    def fitted(self) -> int:
        """Stride of the frames that suffice for a fit: between them the simulation is linear to within the noise.

        A small recording is not thinned. Models with memory also assume a linear input between frames.
        """
        most = min(self.compared, int(FITTING.interval / max(self.interval, 1e-9)))
        for stride in range(most, 1, -1):
            if self._bend(stride) < FITTING.interpolation:
                return stride
        return 1

    def frames(self, stride: int) -> list[NDArray[np.intp]]:
        """Indices of every `stride`-th frame, by episode."""
        return [np.arange(span.start, span.stop, stride) for span in self.episodes]

    def at(self, stride: int, values: NDArray[Any]) -> NDArray[Any]:
        """Select from ``(T, ...)`` values those at every `stride`-th frame of each episode."""
        return values if stride == 1 else values[np.concatenate(self.frames(stride))]

    def _bend(self, stride: int) -> float:
        """Mean squared error of interpolating the simulation linearly between every n-th frame, in noise units."""
        total = 0.0
        for span in self.episodes:
            kept, middle = self.simulated[span][::stride], self.simulated[span][stride // 2 :: stride]
            count = min(len(kept) - 1, len(middle))
            if count > 0:
                way = (stride // 2) / stride
                off = kept[:count] * (1 - way) + kept[1 : count + 1] * way - middle[:count]
                total += float(np.sum((off * self.weight[span][stride // 2 :: stride][:count]) ** 2))
        return total * stride / self.samples
