"""LinearCalibration: the response of a sensor's channels to a load, for channels that are not in newtons."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paxisim.calibrate.loads import Excitation, Load, values_of
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.recording_arrays import episode_spans
from paxisim.presses import MIN_SAMPLES, find_presses
from paxisim.recording import Recording

LEVER_ARM = 0.01
"""Lever arm (m) at which a torque counts as a force, for the scale of a channel."""
AXES = "xyz"
MAX_LISTED_CHANNELS = 30
"""Maximum number of listed channels; if there are more, those with the most unexplained variance are listed."""
MAX_WITH_ERRORS = 3
"""Maximum number of loads for which gains are listed with their intervals."""


@dataclass(frozen=True, eq=False, repr=False)
class LinearCalibration:
    """Response of each channel to a load: an offset, and a gain or a polynomial of higher degree for each load.

    The channels are not in a unit of force, but for example in microtesla, counts or farads. After subtracting `offset`
    and dividing by `scale`, a channel estimates the component of the load along its most sensitive direction. A
    diagnosis can compare these estimates with the load cell's value of the same component, which then serves as the
    simulation.

    Attributes:
        loads: Components of the load, and the covariates that hold them.
        coefficients: ``(degree, loads, pads, 3, rows, cols)`` channel units per newton (or N m), its square, ...
        offset: ``(pads, 3, rows, cols)`` reading without load, in channel units.
        gain: ``(loads, pads, 3, rows, cols)`` mean slope over the calibration, in channel units per newton (or N m);
            for degree 1 the coefficient itself.
        gain_error: Half-widths of the 95 % intervals of `gain`; infinite for loads that the data do not excite.
        used: ``(pads, 3, rows, cols)`` whether the loads explain the channel; unused channels are set to zero.
        delay: Delay of all channels after the loads (s); 0 if `delay_interval` contains 0.
        delay_interval: Ends of the 95 % interval of the delay (s); infinite where the delay is at the end of the
            search, because it may be larger.
        error: ``(pads, 3, rows, cols)`` root-mean-square error on held-out data, in channel units.
        explained: ``(pads, 3, rows, cols)`` share of the variance explained on held-out data; negative if the mean
            would do better.
        excitation: How well the data excite each load.
        ridge: Regularisation strength chosen by cross-validation; 0 for none.
        blocks: Number of blocks of the recording that were held out in turn.
        unit: Unit of the channels.
    """

    loads: tuple[Load, ...]
    coefficients: NDArray[np.float64]
    offset: NDArray[np.float64]
    gain: NDArray[np.float64]
    gain_error: NDArray[np.float64]
    used: NDArray[np.bool_]
    delay: float
    delay_interval: tuple[float, float]
    error: NDArray[np.float64]
    explained: NDArray[np.float64]
    excitation: Excitation
    ridge: float
    blocks: int
    unit: str = ""

    @property
    def scale(self) -> NDArray[np.float64]:
        """Channel units per newton, ``(pads, 3, rows, cols)``; 1 for unused channels.

        The scale is the norm of the gain vector, with torques at a lever arm of 10 mm. Its sign is that of the gain of
        the load that changes the channel most, so for a single load it is the gain itself.
        """
        lever = np.array([LEVER_ARM if load.is_torque else 1.0 for load in self.loads]).reshape(-1, 1, 1, 1, 1)
        if len(self.loads) == 1:
            length = self.gain[0] * lever[0]
        else:
            moved = np.abs(self.gain) * self.excitation.spread.reshape(-1, 1, 1, 1, 1)
            most = np.take_along_axis(self.gain, moved.argmax(axis=0)[None], axis=0)[0]
            length = np.where(most < 0, -1.0, 1.0) * np.sqrt(np.sum((self.gain * lever) ** 2, axis=0))
        return np.where(self.used & (length != 0), length, 1.0)

    def to_force(self, channels: NDArray[np.floating]) -> NDArray[np.float64]:
        """Convert ``(..., pads, 3, rows, cols)`` channels to estimates of the load (N); unused channels give 0."""
        return np.where(self.used, (np.asarray(channels, dtype=np.float64) - self.offset) / self.scale, 0.0)

    def to_channels(self, force: NDArray[np.floating]) -> NDArray[np.float64]:
        """Convert ``(..., pads, 3, rows, cols)`` newtons to channels in their own unit."""
        return self.offset + np.where(self.used, self.scale, 0.0) * np.asarray(force, dtype=np.float64)

    def expected(self, loads: NDArray[np.floating]) -> NDArray[np.float64]:
        """Return the values ``(..., pads, 3, rows, cols)`` (N) that `to_force` should give under known loads.

        Args:
            loads: ``(..., loads)`` newtons and newton-metres.
        """
        values = np.asarray(loads, dtype=np.float64)
        relative = np.where(self.used, self.coefficients / self.scale, 0.0)
        powers = [values ** (power + 1) for power in range(len(relative))]
        return np.sum([np.tensordot(x, own, 1) for x, own in zip(powers, relative, strict=True)], axis=0)

    def apply(self, recording: Recording) -> Recording:
        """Convert a recording for diagnosis: channels to newtons, with the load as the simulated stream.

        The load is shifted by `delay`, so that both streams are aligned. A recording with a single episode is cut into
        episodes between its presses (`paxisim.find_presses`).

        Args:
            recording: Recording of the same sensor, with the channels in `measured` and the loads in its covariates.
                Samples without a known load are dropped.

        Returns:
            The calibrated recording. ``metadata["readout"]`` holds the delay, the loads, the unit of the channels and
            the unused channels as ``[pad, axis, row, column]``; these are 0 in both streams.

        Raises:
            UnknownNameError: A covariate is missing.
            InvalidValueError: The shape differs, `measured` is missing, or the load is never known.
        """
        recording, values = self.beside_loads(recording, self.delay)
        assert recording.measured is not None
        return self.as_newtons(
            recording, self.to_force(recording.measured), self.expected(values), used=self.used, delay=self.delay
        )

    def beside_loads(self, recording: Recording, delay: float) -> tuple[Recording, NDArray[np.float64]]:
        """Return the samples with a known load, in episodes of one press, and the loads ``(T, loads)``, delayed.

        Raises:
            UnknownNameError: A covariate is missing.
            InvalidValueError: The shape differs, `measured` is missing, or the load is never known.
        """
        values = values_of(recording, self.loads)
        if recording.measured is None:
            raise InvalidValueError("a readout is applied to the measured tensor, but the recording has none")
        if recording.measured.shape[1:] != self.offset.shape:
            raise InvalidValueError(
                f"the readout has shape {self.offset.shape} (pads, 3, rows, cols), but the recording has "
                f"{recording.measured.shape[1:]}"
            )
        known = np.isfinite(values).all(axis=1)
        if not known.any():
            raise InvalidValueError("the load is not known at any sample of the recording")
        recording, values = recording[known], values[known]
        values = self.earlier(recording, values, delay)
        if len(np.unique(recording.episode)) == 1 and len(recording) >= MIN_SAMPLES:
            recording = replace(recording, episode=find_presses(recording.time, values).episode)
        return recording, values

    @staticmethod
    def earlier(recording: Recording, values: NDArray[np.float64], delay: float) -> NDArray[np.float64]:
        """Return the loads ``(T, loads)`` delayed (s); the first and last load of an episode are held."""
        return delayed(recording.time, recording.episode, values, delay) if delay else values

    def as_newtons(
        self,
        recording: Recording,
        measured: NDArray[np.floating],
        simulated: NDArray[np.floating],
        *,
        used: NDArray[np.bool_],
        delay: float,
        layout: TaxelLayout | None = None,
    ) -> Recording:
        """Return a recording in newtons, with what the calibration did in its metadata, see `apply`.

        Args:
            recording: The recording in the unit of the channels.
            measured: ``(T, pads, 3, rows, cols)`` newtons.
            simulated: The same of the loads.
            used: ``(pads, 3, rows, cols)`` channels that are not 0 throughout.
            delay: Delay of the loads (s).
            layout: Layout of the taxels. Default: that of the recording.
        """
        taken = {load.covariate for load in self.loads}
        about = {
            "loads": {load.name: load.covariate for load in self.loads},
            "unit": self.unit,
            "delay": delay,
            "unused": [[recording.pads[p], AXES[k], int(r), int(c)] for p, k, r, c in np.argwhere(~used)],
        }
        return replace(
            recording,
            measured=measured,
            simulated=simulated,
            covariates={name: v for name, v in recording.covariates.items() if name not in taken},
            layout=layout or recording.layout,
            metadata={**recording.metadata, "unit": "N", "readout": about},
        )

    def __repr__(self) -> str:
        """One-line summary."""
        names = ", ".join(load.name for load in self.loads)
        return (
            f"LinearCalibration({int(self.used.sum())} of {self.used.size} channels from {names}, "
            f"degree {len(self.coefficients)}, delay {1e3 * self.delay:.1f} ms)"
        )

    def __str__(self) -> str:
        """Table of the delay, the loads and the channels."""
        return "\n".join([*_delay(self), "", *_loads(self), "", *_channels(self)])


def delayed(
    time: NDArray[np.float64], episode: NDArray[np.integer], values: NDArray[np.float64], delay: float
) -> NDArray[np.float64]:
    """Return ``(T, columns)`` values of `delay` seconds before each sample; an episode's first and last are held."""
    out = np.empty_like(values)
    for span in episode_spans(episode):
        for k in range(values.shape[1]):
            out[span, k] = np.interp(time[span] - delay, time[span], values[span, k])
    return out


def _delay(readout: LinearCalibration) -> list[str]:
    low, high = (1e3 * end for end in readout.delay_interval)
    what = "the channels follow the loads" if readout.delay > 0 else "the loads follow the channels"
    size = f"{abs(1e3 * readout.delay):.1f} ms"
    if np.isinf(readout.delay_interval).any():
        lines = [f"delay: {what} by {size} or more, the end of the search"]
    elif low <= 0 <= high:
        lines = [f"delay: none, 95% interval {low:.1f} to {high:.1f} ms"]
    else:
        lines = [f"delay: {what} by {size}, 95% interval {low:.1f} to {high:.1f} ms"]
    return [*lines, f"held out in turn: {readout.blocks} blocks; regularisation (ridge): {readout.ridge:g}"]


def _loads(readout: LinearCalibration) -> list[str]:
    width = max(4, *(len(load.name) for load in readout.loads))
    lines = [f"{'load':{width}}  {'changes by':>14}  {'by itself':>9}"]
    found = readout.excitation
    for k, load in enumerate(readout.loads):
        said = "" if found.separable[k] else "not excited" if not found.excited[k] else "not excited by itself"
        size = f"{found.spread[k]:.3g} {load.unit}"
        lines.append(f"{load.name:{width}}  {size:>14}  {found.alone[k]:>9.0%}  {said}".rstrip())
    return lines


def _channels(readout: LinearCalibration) -> list[str]:
    unit = readout.unit or "units"
    shifted = ", loads shifted by the delay" if readout.delay else ""
    count, few = int(readout.used.sum()), len(readout.loads) <= MAX_WITH_ERRORS
    width = 17 if few else 10
    lines = [
        f"gains in {unit} per N or N m" + (", ± half widths of 95% intervals" if few else ""),
        f"error: root mean square on held-out data, in {unit}{shifted}",
        f"{'channel':11}"
        + "".join(f"{load.name:>{width}}" for load in readout.loads)
        + f"{'error':>8} {'explained':>9}",
    ]
    used = np.flatnonzero(readout.used)
    order = used[np.argsort(readout.explained.ravel()[used], kind="stable")]
    for flat in np.sort(order[:MAX_LISTED_CHANNELS]):
        at = tuple(int(i) for i in np.unravel_index(flat, readout.used.shape))
        pad, axis, row, col = at
        gains = [
            f"{gain:.3g} ±{error:.1g}" if few else f"{gain:.3g}"
            for gain, error in zip(readout.gain[(..., *at)], readout.gain_error[(..., *at)], strict=True)
        ]
        name = f"{pad}: {row},{col} {'xyz'[axis]}"
        lines.append(
            f"{name:11}"
            + "".join(f"{gain:>{width}}" for gain in gains)
            + f"{readout.error[at]:>8.3g} {readout.explained[at]:>9.2%}"
        )
    if count > MAX_LISTED_CHANNELS:
        lines.append(f"... the {MAX_LISTED_CHANNELS} least explained of {count} channels")
    if count < readout.used.size:
        lines.append(
            f"not related to any load, set to zero: {readout.used.size - count} of {readout.used.size} channels"
        )
    return lines
