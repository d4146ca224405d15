"""Background: the field that a magnetometer reads without contact, as a function of the robot's joints."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.document import DocumentFile
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.recording import Recording

MAX_VALUES = 16
"""Maximum number of values that all covariates of a background have together."""
MAX_BUMPS = 512
"""Maximum number of bumps that a file may hold."""
RANGE_MARGIN = 0.05
"""Share of its range by which a covariate may leave it without a warning."""


class BackgroundRangeWarning(UserWarning):
    """A covariate is outside the range that the background was fitted to; the value at the end of the range is used."""


@dataclass(frozen=True, eq=False, repr=False)
class Background(DocumentFile):
    """Field of a sensor that nothing touches, as a function of covariates; created by `fit_background`.

    The magnets of another finger, a magnetised part of the robot and the earth's field in a turning hand all depend on
    the robot's joints only. The field of each channel is a quadratic function of the covariates plus Gaussian bumps: of
    each value by itself, and of all values together.

    Attributes:
        covariates: Names of the covariates.
        sizes: Number of values per sample of each covariate.
        low: ``(values,)`` smallest value of each covariate in the fit.
        high: ``(values,)`` largest value.
        bumps: ``(bumps, values)`` centres of the Gaussian bumps, with each covariate scaled to -1 to 1.
        sharpness: ``(bumps, values)`` one over the standard deviation of each bump in each value, in the same scale; 0
            if it does not depend on the value.
        weights: ``(1 + values + values * (values + 1) / 2 + bumps, channels)`` weights of the constant, the values,
            their products and the bumps, in the channels' unit.
        used: ``(pads, 3, rows, cols)`` True for channels with known readings; the field of the others is 0.
        unit: Unit of the channels.
        before: ``(pads, 3, rows, cols)`` root mean square of each channel without contact about its mean, after removal
            of the drift.
        error: Root mean square of what is left of each channel on samples held out of the fit.
        noise: Standard deviation of the channels from one sample to the next.
        drift: Range of the slow drift of each channel during the recording, which no covariate explains.
        profile: Name of the profile that the sensor was recorded with; empty if the recording does not contain it.
    """

    covariates: tuple[str, ...]
    sizes: tuple[int, ...]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    bumps: NDArray[np.float64]
    sharpness: NDArray[np.float64]
    weights: NDArray[np.float64]
    used: NDArray[np.bool_]
    unit: str
    before: NDArray[np.float64]
    error: NDArray[np.float64]
    noise: NDArray[np.float64]
    drift: NDArray[np.float64]
    profile: str = ""

    FORMAT = "paxisim-background/1"
    ENTRIES = (
        "profile", "covariates", "sizes", "low", "high", "bumps", "sharpness", "weights", "used", "unit", "before",
        "error", "noise", "drift",
    )  # fmt: skip

    def field(self, covariates: Mapping[str, ArrayLike]) -> NDArray[np.float32]:
        """Return the field without contact.

        Args:
            covariates: Present value of each covariate, or ``(T, ...)`` values of several moments; more names do no
                harm.

        Returns:
            ``(pads, 3, rows, cols)`` or ``(T, pads, 3, rows, cols)`` in `unit`. NaN where a covariate is NaN.

        Raises:
            UnknownNameError: A covariate is missing.
            InvalidValueError: A covariate has another number of values.

        Warns:
            BackgroundRangeWarning: A covariate is outside the range of the fit.
        """
        values = side_by_side(covariates, self.covariates, self.sizes)
        beyond = RANGE_MARGIN * (self.high - self.low)
        out = np.flatnonzero(
            ((values < self.low - beyond) | (values > self.high + beyond)).reshape(-1, len(self.low)).any(0)
        )
        if out.size:
            name = np.repeat(self.covariates, self.sizes)[out[0]]
            warnings.warn(
                f"covariate {name!r} leaves the range of the background, {self.low[out[0]]:.4g} to "
                f"{self.high[out[0]]:.4g}; beyond it the field at its end is subtracted",
                BackgroundRangeWarning,
                stacklevel=2,
            )
        found = features(scaled(values, self.low, self.high), self.bumps, self.sharpness) @ self.weights
        field = np.zeros((*found.shape[:-1], *self.used.shape), dtype=np.float32)
        field[..., self.used] = found
        return field

    def read(
        self, channels: NDArray[np.floating], covariates: Mapping[str, ArrayLike]
    ) -> tuple[NDArray[np.float32], None]:
        """Return ``(pads, 3, rows, cols)`` channels without the background, and None for the force, which is unknown.

        Raises:
            UnknownNameError: A covariate is missing.
            InvalidValueError: A covariate has another number of values.
        """
        return (channels - self.field(covariates)).astype(np.float32), None

    def apply(self, recording: Recording) -> Recording:
        """Subtract the background from the measured tensor of a recording.

        The measured tensor is unknown (NaN) where a covariate is. ``metadata["background"]`` names the covariates.

        Args:
            recording: Recording of the same sensor with the covariates.

        Raises:
            UnknownNameError: A covariate is missing.
            InvalidValueError: The recording has no measured tensor, is of another sensor, or had a background
                subtracted before.

        Warns:
            BackgroundRangeWarning: A covariate is outside the range of the fit.
        """
        if recording.measured is None:
            raise InvalidValueError("a background is subtracted from the measured tensor, but the recording has none")
        if "background" in recording.metadata:
            raise InvalidValueError("a background was already subtracted from this recording")
        self.check(recording.measured.shape[1:], recording.unit)
        return replace(
            recording,
            measured=recording.measured - self.field(recording.covariates),
            metadata={**recording.metadata, "background": list(self.covariates)},
        )

    def check(self, shape: tuple[int, ...], unit: str) -> None:
        """Raise unless the background fits a sensor.

        Args:
            shape: Shape of the sensor's frames, ``(pads, 3, rows, cols)``.
            unit: Unit of the sensor's frames.

        Raises:
            InvalidValueError: The background belongs to another sensor.
        """
        check_sensor("background", self.used.shape, self.unit, shape, unit)

    def _entries(self) -> dict[str, Any]:
        return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in vars(self).items()}

    @classmethod
    def _from_entries(cls, entries: dict[str, Any]) -> Background:
        names, sizes = tuple(map(str, entries["covariates"])), tuple(map(int, entries["sizes"]))
        values, used = sum(sizes), np.array(entries["used"]).astype(bool)
        if not (names and len(names) == len(sizes) == len(set(names)) and min(sizes) > 0 and values <= MAX_VALUES):
            raise InvalidValueError(
                f"expected a size for each of 1 to {MAX_VALUES} covariates, got {names} and {sizes}"
            )
        if used.ndim != 4 or used.shape[1] != 3 or not used.any():
            raise InvalidValueError(f"used must be (pads, 3, rows, cols) with a channel in use, got shape {used.shape}")
        bumps = len(entries["bumps"])
        if not 1 <= bumps <= MAX_BUMPS:
            raise InvalidValueError(f"expected 1 to {MAX_BUMPS} bumps, got {bumps}")
        arrays = {
            "low": (values,),
            "high": (values,),
            "bumps": (bumps, values),
            "sharpness": (bumps, values),
            "weights": (1 + values + values * (values + 1) // 2 + bumps, int(used.sum())),
            "before": used.shape,
            "error": used.shape,
            "noise": used.shape,
            "drift": used.shape,
        }
        given = {name: _finite(entries, name, shape) for name, shape in arrays.items()}
        if not (given["high"] > given["low"]).all():
            raise InvalidValueError("high must be above low for each covariate")
        return cls(
            covariates=names,
            sizes=sizes,
            used=used,
            unit=str(entries["unit"]),
            profile=str(entries["profile"]),
            **given,
        )

    def __repr__(self) -> str:
        """One-line summary."""
        return f"Background({int(self.used.sum())} channels from {', '.join(self.covariates)})"

    def __str__(self) -> str:
        """What the channels read without contact, before and after."""
        unit = self.unit or "units"
        all_of = {
            name: float(np.sqrt(np.mean(getattr(self, name)[self.used] ** 2))) for name in ("before", "error", "noise")
        }
        pad, axis, row, col = np.unravel_index(np.where(self.used, self.error, -1).argmax(), self.used.shape)
        return "\n".join([
            f"background of {int(self.used.sum())} channels from {', '.join(self.covariates)}",
            f"without contact: {all_of['before']:.3g} {unit} about the mean",
            f"after subtraction: {all_of['error']:.3g} {unit} on held-out data (noise: {all_of['noise']:.3g} {unit})",
            f"largest: {self.error[pad, axis, row, col]:.3g} {unit}, pad {pad} {'xyz'[axis]} of taxel {row},{col} "
            f"({self.before[pad, axis, row, col]:.3g} before)",
            f"drift during the recording, not in the background: up to {self.drift[self.used].max():.3g} {unit}",
        ])  # fmt: skip


def check_sensor(what: str, own: tuple[int, ...], own_unit: str, shape: tuple[int, ...], unit: str) -> None:
    """Raise unless a calibration or background, named by `what`, fits frames of a shape and unit.

    Raises:
        InvalidValueError: It belongs to another sensor.
    """
    if shape != own:
        raise InvalidValueError(
            f"the {what} is of a sensor with frames of shape {own} (pads, 3, rows, cols), but this sensor's frames "
            f"have shape {shape}"
        )
    if unit != own_unit:
        raise InvalidValueError(f"the {what} is of channels in {own_unit}, but this sensor's are in {unit}")


def side_by_side(
    covariates: Mapping[str, ArrayLike], names: Iterable[str], sizes: Iterable[int]
) -> NDArray[np.float64]:
    """Return ``(values,)`` of one moment or ``(T, values)``, the values of the covariates one after another.

    Raises:
        UnknownNameError: A covariate is missing.
        InvalidValueError: A covariate has another number of values, or covariates have different numbers of samples.
    """
    found = []
    for name, size in zip(names, sizes, strict=True):
        if name not in covariates:
            raise UnknownNameError("covariate", name, covariates)
        try:
            value = np.asarray(covariates[name], dtype=np.float64)
        except (TypeError, ValueError):
            raise InvalidValueError(f"covariate {name!r} must be numbers, got {covariates[name]!r:.60}") from None
        shape = (size,) if value.size == size else (len(value) if value.ndim else 0, size)
        if value.size != np.prod(shape):
            raise InvalidValueError(f"covariate {name!r} must have {size} values, got shape {value.shape}")
        found.append(value.reshape(shape))
    if len({value.shape[:-1] for value in found}) > 1:
        raise InvalidValueError(f"covariates must have the same number of samples, got {[v.shape for v in found]}")
    return np.concatenate(found, axis=-1)


def scaled(values: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scale ``(..., values)`` from their range to -1 to 1; values beyond the range get its end."""
    return np.clip((2 * values - low - high) / (high - low), -1, 1)


def features(
    values: NDArray[np.float64], bumps: NDArray[np.float64], sharpness: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return ``(..., features)``: a constant, the scaled values, their products, and the bumps."""
    a, b = np.triu_indices(values.shape[-1])
    squared = sharpness**2
    distance = values**2 @ squared.T - 2 * values @ (squared * bumps).T + np.sum(squared * bumps**2, axis=-1)
    parts = (np.ones_like(values[..., :1]), values, values[..., a] * values[..., b], np.exp(-distance / 2))
    return np.concatenate(parts, axis=-1)


def _finite(entries: Mapping[str, Any], name: str, shape: tuple[int, ...]) -> NDArray[np.float64]:
    values = np.array(entries[name], dtype=np.float64)
    if values.shape != shape or not np.isfinite(values).all():
        raise InvalidValueError(f"{name} must be finite numbers of shape {shape}, got shape {values.shape}")
    return values
