"""Score: how far a model's readings are from the measured ones, as a figure that is the same everywhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Score:
    """Normalised RMSE of the simulation and of a model on one recording.

    The normalised RMSE is the RMS of the difference over all samples and channels that both streams know, divided by
    the RMS of the measured force there. `zeroed` is the same after the mean difference of each channel was subtracted,
    because a sensor's zero changes from session to session.

    Attributes:
        simulation: Normalised RMSE of the simulated forces.
        model: Normalised RMSE of the model's readings.
        zeroed_simulation: That of the simulated forces, zeroed.
        zeroed_model: That of the model's readings, zeroed.
        pads: Normalised RMSE of the simulation and of the model, by pad.
        samples: Number of samples.
    """

    simulation: float
    model: float
    zeroed_simulation: float
    zeroed_model: float
    pads: dict[str, tuple[float, float]]
    samples: int

    def __str__(self) -> str:
        """The figures as a table."""
        rows = [("all pads", self.simulation, self.model), ("zeroed", self.zeroed_simulation, self.zeroed_model)]
        rows += [(name, *both) for name, both in self.pads.items()] if len(self.pads) > 1 else []
        width = max(len(name) for name, *_ in rows)
        head = f"{'normalised RMSE':<{max(width, 15)}}  simulation   model"
        lines = [f"{name:<{max(width, 15)}}  {before:>10.1%}  {after:>6.1%}" for name, before, after in rows]
        return "\n".join([head, *lines, f"{self.samples} samples"])


def score(recording: Recording, modelled: Recording) -> Score:
    """Score a model.

    Args:
        recording: Recording with measured and simulated forces.
        modelled: The same with the model's readings as the simulated tensor, from `paxisim.augment.read_recording`.

    Raises:
        InvalidValueError: A stream is missing or not in newtons, or no sample has both.
    """
    if recording.measured is None or recording.simulated is None or modelled.simulated is None:
        raise InvalidValueError("a score needs measured and simulated forces: replay the recording first")
    if recording.unit != "N":
        raise InvalidValueError(f"measured is in {recording.unit}, expected N: convert it with paxisim calibrate")
    streams = (recording.measured, recording.simulated, modelled.simulated)
    known = np.logical_and.reduce([np.isfinite(stream).all(axis=(1, 2, 3, 4)) for stream in streams])
    if not known.any():
        raise InvalidValueError("measured and simulated do not overlap: no sample has both")
    measured, simulated, model = (stream[known].astype(np.float64) for stream in streams)
    if not measured.any():
        raise InvalidValueError("measured is 0 throughout: there is nothing to compare with")
    pads = {
        name: (_error(measured[:, i], simulated[:, i]), _error(measured[:, i], model[:, i]))
        for i, name in enumerate(recording.pads)
        if measured[:, i].any()
    }
    before, after = (_error(measured, _zeroed(measured, other)) for other in (simulated, model))
    return Score(_error(measured, simulated), _error(measured, model), before, after, pads, int(known.sum()))


def _error(measured: FloatArray, other: FloatArray) -> float:
    return float(np.sqrt(np.sum((measured - other) ** 2) / np.sum(measured**2)))


def _zeroed(measured: FloatArray, other: FloatArray) -> FloatArray:
    return other + np.mean(measured - other, axis=0)
