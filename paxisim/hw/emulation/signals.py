"""Signals: forces over time that act on an emulated sensor, recorded or synthetic."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.errors import InvalidValueError
from paxisim.hw.emulation.pads import Signal as Signal
from paxisim.hw.profiles.load import as_profile
from paxisim.hw.profiles.profile import Profile
from paxisim.recording import Recording


def from_recording(
    recording: Recording,
    profile: str | os.PathLike[str] | Profile,
    *,
    which: Literal["measured", "simulated"] | None = None,
    interpolate: bool = False,
    loop: bool = True,
) -> Signal:
    """Play a recording at its own speed, its episodes one after another.

    Args:
        recording: Recording of forces in the profile's wire layout or its pooled layout, see `spread`.
        profile: Profile of the pads that feel the forces.
        which: Tensor to play. Default: the measured one, or the simulated one if nothing was measured.
        interpolate: Whether to interpolate linearly between samples; otherwise the earlier sample is held.
        loop: Whether to start again after the last sample; otherwise it is held.

    Raises:
        InvalidValueError: The recording lacks the tensor, or its unit or pads differ from those of the profile.
    """
    if which is None:
        which = "simulated" if recording.measured is None else "measured"
    force = getattr(recording, which)
    if force is None:
        raise InvalidValueError(f"the recording has no {which} tensor to play")
    unit, profile = recording.unit if which == "measured" else "N", as_profile(profile)
    if unit != profile.unit:
        raise InvalidValueError(f"the {which} tensor is in {unit}, but profile {profile.name!r} feels {profile.unit}")
    return from_arrays(recording.time, force, profile, interpolate=interpolate, loop=loop)


def from_arrays(
    time: ArrayLike,
    force: ArrayLike,
    profile: str | os.PathLike[str] | Profile,
    *,
    interpolate: bool = False,
    loop: bool = True,
) -> Signal:
    """Play samples at their own speed.

    Args:
        time: ``(T,)`` seconds. Where the time does not increase, as between two episodes, one median interval passes.
        force: ``(T, pads, 3, rows, cols)`` newtons in the profile's wire layout or its pooled layout, see `spread`.
        profile: Profile of the pads that feel the forces.
        interpolate: See `from_recording`.
        loop: See `from_recording`.

    Raises:
        InvalidValueError: There is no sample, or the shapes do not match.
    """
    profile = as_profile(profile)
    samples = spread(np.asarray(force, dtype=np.float32), profile)
    moments = np.asarray(time, dtype=np.float64)
    if moments.ndim != 1 or samples.shape[:-4] != moments.shape or not len(moments):
        raise InvalidValueError(
            f"expected times of shape (T,) and forces of shape (T, pads, 3, rows, cols) with T of at least 1, "
            f"got {moments.shape} and {samples.shape}"
        )
    steps = np.diff(moments)
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 1.0
    starts = np.concatenate([[0.0], np.cumsum(np.where(steps > 0, steps, usual))])
    return _Played(starts, samples, float(starts[-1]) + usual, interpolate, loop)


@dataclass(frozen=True, eq=False)
class _Played:
    """Samples that begin at `starts` (s) and last `length` (s) altogether."""

    starts: NDArray[np.float64]
    samples: NDArray[np.float32]
    length: float
    interpolate: bool
    loop: bool

    def __call__(self, now: float) -> NDArray[np.floating]:
        now = now % self.length if self.loop else now
        earlier = max(int(np.searchsorted(self.starts, now, side="right")) - 1, 0)
        later = earlier + 1
        if later == len(self.starts) or not self.interpolate:
            return self.samples[earlier]
        share = (now - self.starts[earlier]) / (self.starts[later] - self.starts[earlier])
        return self.samples[earlier] * (1 - share) + self.samples[later] * share


def spread(force: NDArray[np.floating], profile: Profile) -> NDArray[np.floating]:
    """Convert forces on a profile's pads to forces on the taxels of its wire layout.

    Args:
        force: ``(..., pads, 3, rows, cols)`` newtons in the wire layout, which is returned unchanged, or in the pooled
            layout of the driver's output. Each pooled value is spread evenly over its taxels.
        profile: Profile of the pads.

    Raises:
        InvalidValueError: The forces have neither layout.
    """
    wire, pooled, pads = profile.wire_layout, profile.layout, len(profile.slots)
    shape = force.shape[-4:]
    if shape == (pads, *wire.shape):
        return force
    if shape == (pads, *pooled.shape):
        rows, cols = profile.pool
        return np.repeat(np.repeat(force, rows, axis=-2), cols, axis=-1) / (rows * cols)
    also = "" if pooled.shape == wire.shape else f" or {(pads, *pooled.shape)}"
    raise InvalidValueError(
        f"profile {profile.name!r} has pads of shape {(pads, *wire.shape)}{also} (pads, 3, rows, cols), "
        f"but the forces are of shape {shape}; write a profile file of your own with the number of pads "
        "and their pooling"
    )


LARGEST: Mapping[str, float] = {"N": 20.0, "uT": 2000.0, "counts": 20_000.0}
"""Default maximum of the sum over a pad in `press`, by unit. In published recordings of eFlesh one of five chips
reaches 3000 uT. The value for counts is a placeholder."""


def press(profile: str | os.PathLike[str] | Profile, *, force: float | None = None, period: float = 4.0) -> Signal:
    """Return a demonstration signal: a soft patch presses on each pad, drags to the right and down, and lifts.

    Args:
        profile: Profile of the pads.
        force: Maximum normal force of the patch (sum over the pad, in the profile's unit). Shear along x grows to half
            the normal force. Default: the value in `LARGEST`.
        period: Duration of one press (s); each pad starts a quarter of it later than the one before.
    """
    profile = as_profile(profile)
    largest = LARGEST[profile.unit] if force is None else force
    layout, pads = profile.wire_layout, len(profile.slots)
    positions = layout.positions[:, :2]
    low, high = positions.min(axis=0), positions.max(axis=0)
    size = np.maximum(high - low, layout.pitch[::-1])
    width = np.maximum(0.15 * size, 0.7 * np.max(layout.pitch))

    def signal(now: float) -> NDArray[np.floating]:
        phase = (now / period - 0.25 * np.arange(pads)) % 1.0
        pressed = np.sin(np.pi * np.clip(phase / 0.8, 0, 1)) ** 2
        dragged = np.clip((phase - 0.2) / 0.6, 0, 1)
        centre = low + size * (0.3 + 0.4 * dragged[:, None])
        patch = np.exp(-0.5 * np.sum(((positions - centre[:, None]) / width) ** 2, axis=-1))
        normal = largest * pressed[:, None] * patch / patch.sum(axis=1, keepdims=True)
        shear = 0.5 * dragged[:, None] * normal
        return np.stack([shear, 0.6 * shear, normal], axis=1).reshape(pads, *layout.shape)

    return signal
