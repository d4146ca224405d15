"""Aligned: the arrays of a recording over one time axis, as they are read from and written to files."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout

Method = Literal["linear", "nearest", "previous"]


@dataclass(frozen=True, eq=False)
class Aligned:
    """The fields of `paxisim.Recording`, not yet checked."""

    time: NDArray[np.float64]
    measured: NDArray[np.float32] | None = None
    simulated: NDArray[np.float32] | None = None
    covariates: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    episode: NDArray[np.int64] | None = None
    layout: TaxelLayout | None = None
    pads: tuple[str, ...] = ()
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def known(self) -> Aligned:
        """Only the samples at which nothing is NaN.

        Raises:
            InvalidValueError: There is none.
        """
        known = np.ones(len(self.time), dtype=bool)
        for array in (self.measured, self.simulated, *self.covariates.values()):
            if array is not None:
                # a sum is NaN where a part is, and needs no array of the same size
                known &= ~np.isnan(array.reshape(len(array), -1).sum(axis=1))
        if known.all():
            return self
        if not known.any():
            raise InvalidValueError("no sample is left: there is none at which all streams are known")
        return replace(
            self,
            time=self.time[known],
            measured=None if self.measured is None else self.measured[known],
            simulated=None if self.simulated is None else self.simulated[known],
            covariates={name: value[known] for name, value in self.covariates.items()},
            episode=None if self.episode is None else self.episode[known],
        )

    def choose(self, pads: tuple[str, ...]) -> Aligned:
        """Only the pads of these names, in this order; the covariate ``resultant`` likewise, where it has a row a pad.

        The recording must have its pads' names, as one that was checked does.

        Raises:
            UnknownNameError: There is no such pad.
        """
        for name in pads:
            if name not in self.pads:
                raise UnknownNameError("pad", name, self.pads)
        index = [self.pads.index(name) for name in pads]
        covariates = dict(self.covariates)
        resultant = covariates.get("resultant")
        if resultant is not None and resultant.shape[1:] == (len(self.pads), 3):
            covariates["resultant"] = resultant[:, index]
        return replace(
            self,
            measured=None if self.measured is None else self.measured[:, index],
            simulated=None if self.simulated is None else self.simulated[:, index],
            covariates=covariates,
            pads=pads,
        )


class CountsToForce(Protocol):
    """What reading a board's counts needs; `paxisim.hw.profile.Profile` has it."""

    @property
    def layout(self) -> TaxelLayout:
        """The taxels of the tensor that `to_force` gives."""
        ...

    def to_force(self, counts: NDArray[np.int16]) -> NDArray[np.float32]:
        """``(..., N, 3)`` counts -> ``(..., 3, rows, cols)`` newtons."""
        ...


def episode_starts(episode: NDArray[np.integer]) -> NDArray[np.intp]:
    """Index of the first sample of each episode, from each sample's number ``(T,)``."""
    return np.flatnonzero(np.diff(episode, prepend=episode[0] - 1))


def episode_spans(episode: NDArray[np.integer]) -> tuple[slice, ...]:
    """The samples of each episode, from each sample's number ``(T,)``."""
    edges = [*episode_starts(episode).tolist(), len(episode)]
    return tuple(slice(a, b) for a, b in itertools.pairwise(edges))
