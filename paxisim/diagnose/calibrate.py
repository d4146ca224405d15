"""Calibrate: a linear readout for sensors whose channels are no newtons, so that they can be diagnosed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.recording import Recording

LEAST = 0.1
"""Share of a channel's variance that goes with the reference, for the channel to be used."""


@dataclass(frozen=True, eq=False)
class Readout:
    """What each channel reads of a load: ``channel = offset + gain load``.

    The channels' own unit is not that of a force: microtesla, counts, farad. Read backwards, each channel is an
    estimate of the load in newtons, with a noise of its own: ``(channel - offset) / gain``. So a diagnosis can compare
    them with the load, which is then what the simulation says on every channel.

    Attributes:
        gain: ``(pads, 3, rows, cols)`` of each channel, in its unit a newton.
        offset: ``(pads, 3, rows, cols)`` its reading without load, in its unit.
        used: ``(pads, 3, rows, cols)`` whether the channel answers to the load at all.
        reference: Name of the covariate that is the load (N).
        unit: Of the channels.
    """

    gain: NDArray[np.float64]
    offset: NDArray[np.float64]
    used: NDArray[np.bool_]
    reference: str
    unit: str = ""

    def to_force(self, channels: NDArray[np.floating]) -> NDArray[np.float64]:
        """``(..., pads, 3, rows, cols)`` channels -> the load that each of them says (N), 0 where it says none."""
        gain = np.where(self.used, self.gain, 1.0)
        return np.where(self.used, (np.asarray(channels, dtype=np.float64) - self.offset) / gain, 0.0)

    def to_channels(self, force: NDArray[np.floating]) -> NDArray[np.float64]:
        """``(..., pads, 3, rows, cols)`` newtons a channel -> channels in their own unit."""
        return self.offset + np.where(self.used, self.gain, 0.0) * np.asarray(force, dtype=np.float64)

    def apply(self, recording: Recording) -> Recording:
        """A recording made ready for a diagnosis: newtons as read, beside the load as the simulated stream.

        Args:
            recording: With the channels in `measured`, of the same sensor, and the covariate `reference`. Samples at
                which the load is not known are left out.

        Raises:
            UnknownNameError: The covariate is missing.
            InvalidValueError: Another number of pads, rows or columns, no `measured`, or the load is never known.
        """
        load = _load(recording, self.reference)
        assert recording.measured is not None
        if recording.measured.shape[1:] != self.gain.shape:
            raise InvalidValueError(
                f"the readout is of {self.gain.shape} channels (pads, 3, rows, cols), the recording has "
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
    """Fit the linear readout of a sensor whose channels are no newtons, from a load that was measured beside it.

    A straight line a channel, by least squares; what is not straight, late or remembered is left to the diagnosis.

    Example:
        ```python
        press = paxisim.Recording.load("press_1.sensor.csv")
        readout = paxisim.calibrate_readout(press, "load")
        found = paxisim.diagnose(readout.apply(press))
        ```

    Args:
        recording: With the channels in `measured`, in whatever unit.
        reference: Name of the covariate that holds the load, ``(T,)`` newtons, NaN where it is not known.

    Raises:
        UnknownNameError: There is no such covariate.
        InvalidValueError: No `measured`, a load that is constant or hardly known, or no channel that answers to it.
    """
    load = _load(recording, reference)
    assert recording.measured is not None
    channels = recording.measured.astype(np.float64)
    known = np.isfinite(load) & np.isfinite(channels).all(axis=(1, 2, 3, 4))
    if known.sum() < 10 or np.ptp(load[known]) == 0:
        raise InvalidValueError(
            f"the readout is fitted to a load that changes: {reference!r} is known at {int(known.sum())} samples"
            + ("" if known.sum() < 10 else ", and constant")
        )
    load, channels = load[known] - load[known].mean(), channels[known]
    mean = channels.mean(axis=0)
    gain = np.tensordot(load, channels - mean, 1) / np.sum(load**2)
    variance = channels.var(axis=0)
    used = gain**2 * np.mean(load**2) > LEAST * np.maximum(variance, 1e-300)
    if not used.any():
        raise InvalidValueError(f"no channel goes with {reference!r}: is it of the same motion, on the same clock?")
    offset = mean - gain * float(_load(recording, reference)[known].mean())
    return Readout(gain, offset, used, reference, str(recording.metadata.get("unit", "")))


def _load(recording: Recording, reference: str) -> NDArray[np.float64]:
    if recording.measured is None:
        raise InvalidValueError("a readout is fitted to what was measured, the recording has no measured tensor")
    if reference not in recording.covariates:
        raise UnknownNameError("covariate", reference, recording.covariates)
    load = recording.covariates[reference]
    if load.ndim != 1:
        raise InvalidValueError(f"the load must be one number a sample, {reference!r} has shape {load.shape}")
    return load
