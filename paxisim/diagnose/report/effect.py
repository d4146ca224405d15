"""Effect: what one cause does to the simulated stream, all other causes being there, and where it is seen best."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.chain import Chain
from paxisim.augment.drift import Drift
from paxisim.augment.transform import Transform
from paxisim.diagnose.diagnosis import FoundCause
from paxisim.diagnose.streams import Streams

Series = NDArray[np.float64]
Channel = tuple[int, int, int, int]  # pad, axis, row, column


@dataclass(frozen=True, eq=False)
class Effect:
    """A cause's effect.

    Attributes:
        cause: Which one.
        streams: What was recorded.
        model: ``(T, pads, 3, rows, cols)`` float32 newtons, of the whole extended model.
        without: The same, of the model that lacks the cause.
        chain: The extended model.
    """

    cause: FoundCause
    streams: Streams
    model: NDArray[np.float32]
    without: NDArray[np.float32]
    chain: Chain

    @property
    def member(self) -> Transform:
        """The cause's transform; a chain wraps one that stands later than its stage."""
        member = self.chain[self.cause.name]
        return member[0] if isinstance(member, Chain) and len(member) == 1 else member

    @cached_property
    def energy(self) -> Series:
        """``(episodes, pads, 3, rows, cols)`` N^2, what the cause adds to the channels that take part."""
        added = [np.sum((self.model[s] - self.without[s]) ** 2, axis=0, dtype=float) for s in self.streams.episodes]
        return np.where(self.streams.alive, added, 0.0)

    @cached_property
    def axes(self) -> list[tuple[int, int]]:
        """Pads and axes, the most affected first."""
        order = np.argsort(-self.energy.sum(axis=(0, 3, 4)).ravel(), kind="stable")
        return [divmod(int(i), 3) for i in order]

    @cached_property
    def channel(self) -> Channel:
        """The most affected channel."""
        at = np.unravel_index(int(np.argmax(self.energy.sum(axis=0))), self.energy.shape[1:])
        return (int(at[0]), int(at[1]), int(at[2]), int(at[3]))

    def best_episode(self, pad: int, axis: int) -> int:
        """The episode in which that pad's axis is affected most."""
        return int(np.argmax(self.energy[:, pad, axis].sum(axis=(1, 2))))

    def sums(self, pad: int, axis: int, span: slice | None = None) -> tuple[Series, Series, Series]:
        """A pad's whole force on an axis (N): measured, by the model without the cause, and by the whole model."""
        where = span or slice(None)
        arrays = (self.streams.measured, self.without, self.model)
        return tuple(a[where, pad, axis].sum(axis=(1, 2), dtype=float) for a in arrays)  # type: ignore[return-value]

    def at(self, channel: Channel, span: slice | None = None) -> tuple[Series, Series, Series]:
        """A channel's force (N): measured, by the model without the cause, and by the whole model."""
        where = (span or slice(None), *channel)
        arrays = (self.streams.measured, self.without, self.model)
        return tuple(a[where].astype(float) for a in arrays)  # type: ignore[return-value]

    def place(self, channel: Channel) -> str:
        """A channel in words."""
        pad, axis, row, col = channel
        return f"pad {self.streams.pads[pad]}, taxel ({row}, {col}), {'xyz'[axis]}"


def effects(causes: tuple[FoundCause, ...], chain: Chain, streams: Streams) -> list[Effect]:
    """The effect of each cause; those that the chain has no member of are left out."""
    model = run(chain, streams)
    return [
        Effect(cause, streams, model, run(_without(chain, cause.name), streams), chain)
        for cause in causes
        if cause.name in chain.names
    ]


def run(chain: Chain, streams: Streams) -> NDArray[np.float32]:
    """``(T, pads, 3, rows, cols)`` float32: the chain on the simulated stream, its memory begun anew in each episode.

    A drift alone goes on from one to the next.
    """
    parts = []
    for span in streams.episodes:
        elapsed = float(streams.time[span.start] - streams.time[0])
        members = [replace(m, start=m.start + elapsed) if isinstance(m, Drift) else m for m in chain]
        covariates = {name: values[span] for name, values in streams.covariates.items()}
        own = Chain(members, chain.names)
        parts.append(np.asarray(own.run(streams.simulated[span], streams.time[span], covariates), dtype=np.float32))
    return np.concatenate(parts)


def _without(chain: Chain, name: str) -> Chain:
    kept = [(n, m) for n, m in zip(chain.names, chain, strict=True) if n != name]
    return Chain([member for _, member in kept], [n for n, _ in kept])
