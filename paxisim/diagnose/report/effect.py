"""Effect: the contribution of one cause to the simulated stream, with all other causes present."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.chain import Chain
from paxisim.augment.clocked import Clocked
from paxisim.augment.transform import Transform
from paxisim.diagnose.causes.kinds import Cause
from paxisim.diagnose.causes.vocabulary import cause, known_causes
from paxisim.diagnose.known import MEMBER
from paxisim.diagnose.result import FoundCause, Streams

Series = NDArray[np.float64]
Channel = tuple[int, int, int, int]  # pad, axis, row, column


@dataclass(frozen=True, eq=False)
class Effect:
    """The effect of a cause.

    Attributes:
        cause: The cause, as the diagnosis found it.
        streams: The recorded and simulated tensors.
        model: ``(T, pads, 3, rows, cols)`` float32 newtons, output of the extended model.
        without: The same, output of the extended model without this cause.
        chain: The extended model.
    """

    cause: FoundCause
    streams: Streams
    model: NDArray[np.float32]
    without: NDArray[np.float32]
    chain: Chain

    @property
    def member(self) -> Transform:
        """Transform of the cause, without the chain that wraps a transform placed later than its stage."""
        return _unwrapped(self.chain[self.cause.name])

    @property
    def about(self) -> Cause | None:
        """The registered cause; None if no cause of that name is registered any more."""
        return cause(self.cause.name) if self.cause.name in known_causes() else None

    @cached_property
    def energy(self) -> Series:
        """``(episodes, pads, 3, rows, cols)`` N^2, energy that the cause adds to each channel in use."""
        added = [np.sum((self.model[s] - self.without[s]) ** 2, axis=0, dtype=float) for s in self.streams.episodes]
        return np.where(self.streams.alive, added, 0.0)

    @cached_property
    def reduced(self) -> Series:
        """``(episodes, pads, 3, rows, cols)`` N^2, reduction of the squared error by the cause.

        It is -inf on channels that the cause does not affect.
        """
        affected = self.energy.sum(axis=0) > 1e-6 * self.energy.sum(axis=0).max()
        less = np.array([np.sum(self.nearer(s), axis=0) for s in self.streams.episodes], dtype=np.float64)
        return np.where(affected, less, -np.inf)

    def nearer(self, where: tuple[slice | int, ...] | slice) -> Series:
        """Reduction of the squared error (N^2) by the cause, for each selected sample and channel."""
        measured, without, model = (a[where].astype(float) for a in (self.streams.measured, self.without, self.model))
        return np.asarray((measured - without) ** 2 - (measured - model) ** 2, dtype=np.float64)

    @cached_property
    def axes(self) -> list[tuple[int, int]]:
        """Pairs of pad and axis, most affected first."""
        order = np.argsort(-self.energy.sum(axis=(0, 3, 4)).ravel(), kind="stable")
        return [divmod(int(i), 3) for i in order]

    @cached_property
    def channel(self) -> Channel:
        """The channel whose error the cause reduces most."""
        at = np.unravel_index(int(np.argmax(self.reduced.sum(axis=0))), self.energy.shape[1:])
        return (int(at[0]), int(at[1]), int(at[2]), int(at[3]))

    def best_episode(self, pad: int, axis: int) -> int:
        """The episode in which this pad and axis is affected most."""
        return int(np.argmax(self.energy[:, pad, axis].sum(axis=(1, 2))))

    def sums(self, pad: int, axis: int, span: slice | None = None) -> tuple[Series, Series, Series]:
        """Total force on a pad along an axis (N): measured, model without the cause, full model.

        For calibrated channels, each of which estimates the load, it is the mean instead.
        """
        where = span or slice(None)
        arrays = (self.streams.measured, self.without, self.model)
        share = 1 / self.streams.measured[0, pad, axis].size if self.streams.calibrated else 1.0
        return tuple(share * a[where, pad, axis].sum(axis=(1, 2), dtype=float) for a in arrays)  # type: ignore[return-value]

    def at(self, channel: Channel, span: slice | None = None) -> tuple[Series, Series, Series]:
        """Force on a channel (N): measured, model without the cause, full model."""
        where = (span or slice(None), *channel)
        arrays = (self.streams.measured, self.without, self.model)
        return tuple(a[where].astype(float) for a in arrays)  # type: ignore[return-value]

    def place(self, channel: Channel) -> str:
        """Description of a channel, for a title."""
        pad, axis, row, col = channel
        return f"{self.streams.pad(pad)}, taxel ({row}, {col}), {'xyz'[axis]}"


def effects(causes: tuple[FoundCause, ...], chain: Chain, streams: Streams) -> list[Effect]:
    """Return the effect of each cause that has a member in the chain or belongs to the scene.

    The streams are already seen through a sensor that was known beforehand.
    """
    found_beside = [(name, member) for name, member in zip(chain.names, chain, strict=True) if name != MEMBER]
    chain = Chain([member for _, member in found_beside], [name for name, _ in found_beside])
    inside = streams.in_scene
    scene = streams.simulated if inside is None else inside.simulated
    model, out = run(chain, streams, scene), []
    for found in causes:
        if found.name in chain.names:
            out.append(Effect(found, streams, model, run(_without(chain, found.name), streams, scene), chain))
        elif inside is not None and found.name in inside.without:
            out.append(Effect(found, streams, model, run(chain, streams, inside.without[found.name]), chain))
    return out


def run(chain: Chain, streams: Streams, simulated: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """``(T, pads, 3, rows, cols)`` float32 N, output of the chain for the simulated stream, or for another one.

    The state is reset at the start of each episode, except for drift and failures, which continue across episodes.
    """
    parts = []
    simulated = streams.simulated if simulated is None else simulated
    for span in streams.episodes:
        elapsed = float(streams.time[span.start] - streams.time[0])
        members = [_continued(member, elapsed) for member in chain]
        covariates = {name: values[span] for name, values in streams.covariates.items()}
        own = Chain(members, chain.names)
        parts.append(np.asarray(own.run(simulated[span], streams.time[span], covariates), dtype=np.float32))
    return np.concatenate(parts)


def _unwrapped(member: Transform) -> Transform:
    return member[0] if isinstance(member, Chain) and len(member) == 1 else member


def _continued(member: Transform, elapsed: float) -> Transform:
    """Return a member advanced by `elapsed` seconds."""
    if isinstance(member, Chain):
        return Chain([_continued(m, elapsed) for m in member], member.names)
    return member.later(elapsed) if isinstance(member, Clocked) else member


def _without(chain: Chain, name: str) -> Chain:
    kept = [(n, m) for n, m in zip(chain.names, chain, strict=True) if n != name]
    return Chain([member for _, member in kept], [n for n, _ in kept])
