"""Streams: the tensors behind a diagnosis, kept in memory for the pictures of its report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.problem import peak_of
from paxisim.layout import TaxelLayout
from paxisim.logs.recording_arrays import episode_spans
from paxisim.scene.parameters import SceneParameter


@dataclass(frozen=True, eq=False, repr=False)
class InScene:
    """What the scene simulates with the values that a diagnosis found.

    Attributes:
        simulated: ``(T, pads, 3, rows, cols)`` float32 newtons, with all of them.
        without: The same, with those of one cause left at their nominal values, by cause.
        parameters: The scene's numbers by name.
        values: By name, the values that were found, in SI units.
    """

    simulated: NDArray[np.float32]
    without: Mapping[str, NDArray[np.float32]]
    parameters: Mapping[str, SceneParameter]
    values: Mapping[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class Streams:
    """Measured, simulated and extended tensors on one clock; they are not saved with a diagnosis.

    Attributes:
        time: ``(T,)`` seconds.
        episode: ``(T,)`` the number of each sample's episode, 0, 1, ...
        measured: ``(T, pads, 3, rows, cols)`` float32 newtons.
        simulated: The same, as recorded.
        extended: The same, the mean reading predicted by the extended model fitted to other episodes.
        covariates: ``(T,)`` each, by name.
        pads: Names of the pads.
        layout: Layout of the taxels.
        step: Newtons per count, 0 if the sensor does not quantise.
        alive: ``(pads, 3, rows, cols)`` channels in use, without those that the sensor does not measure.
        calibrated: Whether each channel is an estimate of the load, see `paxisim.calibrate_readout`, so that their sum
            is not the force on the pad.
        in_scene: What the scene simulates with the values that were found; None if the scene was not given.
    """

    time: NDArray[np.float64]
    episode: NDArray[np.int64]
    measured: NDArray[np.float32]
    simulated: NDArray[np.float32]
    extended: NDArray[np.float32]
    covariates: Mapping[str, NDArray[np.float64]]
    pads: tuple[str, ...]
    layout: TaxelLayout
    step: float = 0.0
    alive: NDArray[np.bool_] | Literal[True] = True
    calibrated: bool = False
    in_scene: InScene | None = None

    def pad(self, number: int) -> str:
        """A pad in words, "pad left" or "pad0"."""
        return pad_in_words(self.pads[number])

    @property
    def episodes(self) -> tuple[slice, ...]:
        """The samples of each episode."""
        return episode_spans(self.episode)

    @property
    def peak(self) -> float:
        """Peak force (N) on the most loaded taxel in the simulation, 99.5% quantile over time."""
        return peak_of(self.simulated)

    @property
    def at_rest(self) -> NDArray[np.bool_]:
        """``(T,)`` whether no taxel is pressed."""
        return np.abs(self.simulated).max(axis=(1, 2, 3, 4)) < 0.01 * max(self.peak, 1e-9)


def pad_in_words(name: str) -> str:
    """The name of a pad, after the word "pad" unless it begins with it."""
    return name if name.startswith("pad") else f"pad {name}"
