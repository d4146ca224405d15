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
    """Streams simulated in the scene with the fitted values.

    Attributes:
        simulated: ``(T, pads, 3, rows, cols)`` float32 newtons, with all fitted values.
        without: The same with the numbers of one cause at their nominal values, by cause.
        parameters: Numbers of the scene by name.
        values: Fitted values by name, in SI units.
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
        episode: ``(T,)`` the recording's number of each sample's episode.
        measured: ``(T, pads, 3, rows, cols)`` float32 newtons.
        simulated: Simulated stream as recorded, of the same shape.
        extended: Mean reading predicted by the extended model fitted to other episodes, of the same shape.
        covariates: Covariates by name, ``(T,)`` each.
        pads: Names of the pads.
        layout: Layout of the taxels.
        step: Newtons per count, 0 if the sensor does not quantise.
        alive: ``(pads, 3, rows, cols)`` channels in use, without those that the sensor does not measure.
        calibrated: Whether each channel estimates the whole load (see `paxisim.calibrate_readout`). If so, the sum of
            the channels is not the force on the pad.
        in_scene: Streams simulated in the scene with the fitted values; None if no scene was given.
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
        """Return a pad's name for a title, such as "pad left" or "pad0"."""
        return pad_in_words(self.pads[number])

    @property
    def numbers(self) -> NDArray[np.int64]:
        """The recording's number of each of `episodes`."""
        return self.episode[[span.start for span in self.episodes]]

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
        """``(T,)`` True where no taxel is pressed."""
        return np.abs(self.simulated).max(axis=(1, 2, 3, 4)) < 0.01 * max(self.peak, 1e-9)


def pad_in_words(name: str) -> str:
    """Return the name of a pad, preceded by the word "pad" unless the name starts with it."""
    return name if name.startswith("pad") else f"pad {name}"
