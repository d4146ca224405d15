"""Calibrate: a linear readout that lets sensors whose channels are not in newtons be diagnosed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.recording import Recording

LEAST = 0.1
"""Least share of a channel's variance that the reference must explain for the channel to be used."""


@dataclass(frozen=True, eq=False)
class Readout:
    """Linear response of each channel to a load: ``channel = offset + gain * load``.

    The unit of the channels is not that of a force; it may be microtesla, counts or farad. Inverted, each channel is an
    estimate of the load in newtons, with its own noise: ``(channel - offset) / gain``. A diagnosis can compare these
    estimates with the load, which then serves as the simulation of every channel.

    Attributes:
        gain: ``(pads, 3, rows, cols)`` channel units per newton.
        offset: ``(pads, 3, rows, cols)`` reading without load, in channel units.
        used: ``(pads, 3, rows, cols)`` whether the channel responds to the load.
        reference: Name of the covariate that holds the load (N).
        unit: Unit of the channels.
    """

    gain: NDArray[np.float64]
    offset: NDArray[np.float64]
    used: NDArray[np.bool_]
    reference: str
    unit: str = ""

    def to_force(self, channels: NDArray[np.floating]) -> NDArray[np.float64]:
        """Convert ``(..., pads, 3, rows, cols)`` channels to estimates of the load (N); unused channels give 0."""
        gain = np.where(self.used, self.gain, 1.0)
        return np.where(self.used, (np.asarray(channels, dtype=np.float64) - self.offset) / gain, 0.0)

    def to_channels(self, force: NDArray[np.floating]) -> NDArray[np.float64]:
        """Convert ``(..., pads, 3, rows, cols)`` newtons to channels in their own unit."""
        return self.offset + np.where(self.used, self.gain, 0.0) * np.asarray(force, dtype=np.float64)

    def apply(self, recording: Recording) -> Recording:
        """Convert a recording for diagnosis: channels to newtons, with the load as the simulated stream.

        Args:
            recording: Of the same sensor, with the channels in `measured` and the covariate `reference`. Samples
                without a known load are dropped.

        Raises:
            UnknownNameError: The covariate is missing.
            InvalidValueError: The shape differs, `measured` is missing, or the load is never known.
        """
        load = _load(recording, self.reference)
        assert recording.measured is not None
        if recording.measured.shape[1:] != self.gain.shape:
            raise InvalidValueError(
                f"the readout has shape {self.gain.shape} (pads, 3, rows, cols), but the recording has "
                f"{recording.measured.shape[1:]}"
            )
        known = np.isfinite(load)
        recording = recording[known]
        assert recording.measured is not None
        simulated = load[known][:, None, None, None, None] * self.used
        return replace(
            recording,
            measured=self.to_force(recording.measured),
            simulated=simulated,
            covariates={name: v for name, v in recording.covariates.items() if name != self.reference},
            metadata={**recording.metadata, "unit": "N", "readout": {"reference": self.reference, "unit": self.unit}},
        )


def calibrate_readout(recording: Recording, reference: str) -> Readout:
    """Fit the linear readout of a sensor whose channels are not in newtons, using a load measured by a reference.

    Each channel gets a straight line by least squares. Nonlinearity, delay and memory are left to the diagnosis.

    Example:
        ```python
        press = paxisim.Recording.load("press_1.sensor.csv")
        readout = paxisim.calibrate_readout(press, "load")
        found = paxisim.diagnose(readout.apply(press))
        ```

    Args:
        recording: With the channels in `measured`, in any unit.
        reference: Name of the covariate that holds the load, ``(T,)`` newtons, NaN where unknown.

    Raises:
        UnknownNameError: There is no such covariate.
        InvalidValueError: `measured` is missing, the load is constant or mostly unknown, or no channel responds to it.
    """
    load = _load(recording, reference)
    assert recording.measured is not None
    channels = recording.measured.astype(np.float64)
    known = np.isfinite(load) & np.isfinite(channels).all(axis=(1, 2, 3, 4))
    if known.sum() < 10 or np.ptp(load[known]) == 0:
        raise InvalidValueError(
            f"a readout needs a varying load: {reference!r} is known at {int(known.sum())} samples"
            + ("" if known.sum() < 10 else " and constant")
        )
    load, channels = load[known] - load[known].mean(), channels[known]
    mean = channels.mean(axis=0)
    gain = np.tensordot(load, channels - mean, 1) / np.sum(load**2)
    variance = channels.var(axis=0)
    used = gain**2 * np.mean(load**2) > LEAST * np.maximum(variance, 1e-300)
    if not used.any():
        raise InvalidValueError(
            f"no channel correlates with {reference!r}: does it belong to the same motion, on the same clock?"
        )
    offset = mean - gain * float(_load(recording, reference)[known].mean())
    return Readout(gain, offset, used, reference, str(recording.metadata.get("unit", "")))


def _load(recording: Recording, reference: str) -> NDArray[np.float64]:
    if recording.measured is None:
        raise InvalidValueError("a readout is fitted to the measured tensor, but the recording has none")
    if reference not in recording.covariates:
        raise UnknownNameError("covariate", reference, recording.covariates)
    load = recording.covariates[reference]
    if load.ndim != 1:
        raise InvalidValueError(f"the load must be a single value per sample, but {reference!r} has shape {load.shape}")
    return load
