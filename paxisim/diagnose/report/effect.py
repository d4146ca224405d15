"""Effect: the contribution of one cause to the simulated stream, with all other causes present."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.chain import Chain
from paxisim.augment.recorded import read_through
from paxisim.augment.transform import Transform
from paxisim.diagnose.causes.kinds import Cause
from paxisim.diagnose.causes.vocabulary import cause, known_causes
from paxisim.diagnose.known import MEMBER
from paxisim.diagnose.report.style import AXES
from paxisim.diagnose.result import FoundCause, Streams

Series = NDArray[np.float64]
Channel = tuple[int, ...]  # pad, axis, row, column


@dataclass(frozen=True, eq=False)
class Effect:
    """The effect of a cause as the diagnosis found it.

    `model` is the output of the extended model `chain` for the simulated stream, ``(T, pads, 3, rows, cols)`` float32
    newtons, and `without` that of the model without the cause.
    """

    cause: FoundCause
    streams: Streams
    model: NDArray[np.float32]
    without: NDArray[np.float32]
    chain: Chain

    @property
    def member(self) -> Transform:
        """Transform of the cause, without the chain that wraps a transform placed later than its stage."""
        return unwrapped(self.chain[self.cause.name])

    @property
    def about(self) -> Cause | None:
        """The registered cause; None if no cause of that name is registered any more."""
        return cause(self.cause.name) if self.cause.name in known_causes() else None

    @property
    def forces(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """``(T, pads, 3, rows, cols)`` N each: measured, model without the cause, full model."""
        return self.streams.measured, self.without, self.model

    @cached_property
    def energy(self) -> Series:
        """``(episodes, pads, 3, rows, cols)`` N^2, energy that the cause adds to each channel in use."""
        added = [np.sum((self.model[s] - self.without[s]) ** 2, axis=0, dtype=float) for s in self.streams.episodes]
        return np.where(self.streams.alive, added, 0.0)

    @cached_property
    def reduced(self) -> Series:
        """``(episodes, pads, 3, rows, cols)`` N^2, cut of the squared error; -inf on channels without an effect."""
        affected = self.energy.sum(axis=0) > 1e-6 * self.energy.sum(axis=0).max()
        less = np.array([np.sum(self.nearer(s), axis=0) for s in self.streams.episodes], dtype=np.float64)
        return np.where(affected, less, -np.inf)

    def nearer(self, where: tuple[slice | int, ...] | slice) -> Series:
        """Reduction of the squared error (N^2) by the cause, for each selected sample and channel."""
        measured, without, model = (force[where].astype(float) for force in self.forces)
        return np.asarray((measured - without) ** 2 - (measured - model) ** 2, dtype=np.float64)

    @cached_property
    def axes(self) -> list[tuple[int, int]]:
        """Pairs of pad and axis, most affected first."""
        order = np.argsort(-self.energy.sum(axis=(0, 3, 4)).ravel(), kind="stable")
        return [divmod(int(i), 3) for i in order]

    @cached_property
    def channel(self) -> Channel:
        """The channel whose error the cause reduces most."""
        return largest(self.reduced.sum(axis=0))

    def most_affected(self, *where: int) -> list[int]:
        """The episodes, most affected first, by pad and axis (and row and column)."""
        energy = self.energy[(slice(None), *where)].reshape(len(self.energy), -1).sum(axis=1)
        return np.argsort(-energy, kind="stable").tolist()

    def sums(self, pad: int, axis: int) -> tuple[Series, ...]:
        """Force on a pad along an axis (N), or mean of calibrated channels: measured, without the cause, full model."""
        share = 1 / self.streams.measured[0, pad, axis].size if self.streams.calibrated else 1.0
        return tuple(share * force[:, pad, axis].sum(axis=(1, 2), dtype=float) for force in self.forces)

    def at(self, channel: Channel) -> tuple[Series, ...]:
        """Force on a channel (N): measured, model without the cause, full model."""
        return tuple(force[(slice(None), *channel)].astype(float) for force in self.forces)

    def place(self, channel: Channel) -> str:
        """Description of a channel, for a title."""
        pad, axis, row, col = channel
        return f"{self.streams.pad(pad)}, taxel ({row}, {col}), {AXES[axis]}"

    @property
    def deviation(self) -> str:
        """What a deviation is, for the start of an alternative text."""
        return f"Measured force minus force in the model without {self.cause.name}"


def effects(causes: tuple[FoundCause, ...], chain: Chain, streams: Streams) -> list[Effect]:
    """Return the effect of each cause that has a member in the chain or belongs to the scene."""
    chain = _lacking(chain, MEMBER)  # the streams are already seen through a sensor that was known beforehand
    inside = streams.in_scene
    scene = streams.simulated if inside is None else inside.simulated
    model, out = run(chain, streams, scene), []
    for found in causes:
        if found.name in chain.names:
            out.append(Effect(found, streams, model, run(_lacking(chain, found.name), streams, scene), chain))
        elif inside is not None and found.name in inside.without:
            out.append(Effect(found, streams, model, run(chain, streams, inside.without[found.name]), chain))
    return out


def run(chain: Chain, streams: Streams, simulated: NDArray[np.float32] | None = None) -> NDArray[np.float32]:
    """``(T, pads, 3, rows, cols)`` float32 N, output of the chain for the simulated stream, or for another one.

    Memory continues over episodes as in the diagnosis.
    """
    simulated = streams.simulated if simulated is None else simulated
    return read_through(chain, simulated, streams.time, streams.covariates, streams.episodes)


def _lacking(chain: Chain, name: str) -> Chain:
    kept = [(n, member) for n, member in zip(chain.names, chain, strict=True) if n != name]
    return Chain([member for _, member in kept], [n for n, _ in kept])


def unwrapped(member: Transform) -> Transform:
    """Return the transform inside the chain that wraps a transform placed later than its stage."""
    return member[0] if isinstance(member, Chain) and len(member) == 1 else member


def largest(values: np.ndarray) -> tuple[int, ...]:
    """Return the index of the largest value."""
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(values)), values.shape))


def elapsed(streams: Streams, number: int) -> Series:
    """``(T,)`` seconds since the start of an episode."""
    time = streams.time[streams.episodes[number]]
    return time - time[0]


def windows(streams: Streams, seconds: float, least: int) -> tuple[float, list[slice]]:
    """Return the sampling interval (s), and the samples of half-overlapping windows for spectra.

    A window has at least `least` samples, but is no longer than most episodes; shorter episodes are left out.
    """
    interval = float(np.median(np.diff(streams.time[streams.episodes[0]])))
    typical = int(np.median([span.stop - span.start for span in streams.episodes]))
    size = min(typical, max(least, round(seconds / interval)))
    starts = [at for s in streams.episodes for at in range(s.start, s.stop - size + 1, max(1, size // 2))]
    return interval, [slice(start, start + size) for start in starts]
