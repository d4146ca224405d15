"""Quality of a sensor's readings at rest: rate, jitter, lost frames, noise, drift, silent taxels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.hw.frame import Frame
from paxisim.layout import TaxelLayout

MIN_FRAMES = 20
"""Minimum number of frames for `measure_quality`."""

_BLOCKS = 20


@dataclass(frozen=True, eq=False)
class SensorQuality:
    """Statistics of the frames of a sensor at rest; ``str()`` gives a table of at most 80 columns.

    Attributes:
        layout: Taxel layout of the pads.
        pads: Names of the pads.
        unit: Unit of the forces in the frames; N below stands for this unit.
        nominal_rate: Frame rate stated by the profile (Hz); None if no source states it.
        time: ``(T,)`` time since the first frame (s).
        intervals: ``(T - 1,)`` interval between the arrivals of successive frames (s), divided evenly if frames were
            lost in between.
        lost: Number of frames missing between the first and the last, from their sequence numbers.
        total: ``(T, pads, 3)`` sum over taxels (N).
        noise: ``(pads, 3, rows, cols)`` standard deviation of each taxel from frame to frame (N), hence without drift:
            the root of half the mean square of successive differences.
        total_noise: ``(pads, 3)`` the same for the total (N).
        drift: ``(pads, 3)`` slope of the total (N per minute).
        drift_error: ``(pads, 3)`` standard error of the drift (N per minute), from the scatter about the line of the
            means over twentieths of the time; it therefore includes slow noise.
        zero: ``(pads, rows, cols)`` True where a taxel read 0 on all axes in all frames.
        constant: ``(pads, rows, cols)`` True where a taxel always read the same value, other than 0.
    """

    layout: TaxelLayout
    pads: tuple[str, ...]
    unit: str
    nominal_rate: float | None
    time: NDArray[np.float64]
    intervals: NDArray[np.float64]
    lost: int
    total: NDArray[np.float64]
    noise: NDArray[np.float64]
    total_noise: NDArray[np.float64]
    drift: NDArray[np.float64]
    drift_error: NDArray[np.float64]
    zero: NDArray[np.bool_]
    constant: NDArray[np.bool_]

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.time)

    @property
    def rate(self) -> float:
        """Frame rate (Hz) from the median interval."""
        return 1 / max(float(np.median(self.intervals)), 1e-9)

    @property
    def mean_rate(self) -> float:
        """Mean frame rate (Hz), not counting lost frames."""
        return (self.frames - 1) / max(float(self.time[-1]), 1e-9)

    @property
    def jitter(self) -> float:
        """Standard deviation of the intervals (s)."""
        return float(self.intervals.std())

    @property
    def slow_interval(self) -> float:
        """99th percentile of the intervals (s)."""
        return float(np.percentile(self.intervals, 99))

    @property
    def touched(self) -> NDArray[np.bool_]:
        """``(pads,)`` True where the total changed far more than noise explains: something moved or was touched."""
        change = np.ptp(self.total, axis=0)
        least = 1.0 if self.unit == "N" else 0.0  # no source states how much the field of an untouched sensor changes
        return np.any(change > least + 10 * self.total_noise, axis=-1)

    def __str__(self) -> str:
        """Return the table."""
        nominal = "" if self.nominal_rate is None else f", nominally {self.nominal_rate:g}"
        seconds = float(self.time[-1])
        lines = [
            f"frames  {self.frames} in {seconds:.1f} s, {self.lost} lost",
            f"rate    {self.rate:.1f} Hz (median{nominal}), {self.mean_rate:.1f} Hz on average",
            f"jitter  {1e3 * self.jitter:.2f} ms standard deviation; 99 % of the intervals are below "
            f"{1e3 * self.slow_interval:.1f} ms,",
            f"        the longest is {1e3 * self.intervals.max():.1f} ms",
            "",
            f"{'pad':<12}axis  {'mean total':>12}{'taxel noise':>13}{'total noise':>13}   drift of total",
        ]
        typical = np.median(self.noise, axis=(-2, -1))
        for i, pad in enumerate(self.pads):
            for j, axis in enumerate("xyz"):
                lines.append(
                    f"{pad[:11] if j == 0 else '':<12}{axis:<5} {self.total[:, i, j].mean():>+9.2f} {self.unit}"
                    f" {typical[i, j]:>10.3f} {self.unit} {self.total_noise[i, j]:>10.3f} {self.unit}"
                    f"  {self.drift[i, j]:>+8.{_digits(self.drift[i, j])}f}"
                    f" ± {self.drift_error[i, j]:.{_digits(self.drift_error[i, j])}f} {self.unit}/min"
                )
        lines += ["", *self._remarks()]
        return "\n".join(lines)

    def _remarks(self) -> list[str]:
        lines = []
        for i, pad in enumerate(self.pads):
            zero, constant = int(self.zero[i].sum()), int(self.constant[i].sum())
            text = f"{pad[:11]}: {zero} of {self.layout.taxels} taxels always read 0"
            lines.append(text + (f", {constant} always the same, but not 0" if constant else ""))
            if self.touched[i]:
                change = np.ptp(self.total[:, i], axis=0).max()
                lines.append(
                    f"{pad[:11]}: its total changed by {change:.1f} {self.unit}: was it touched? If so, the "
                    "table shows that"
                )
        if self.zero.any() and self.unit == "N":
            lines += [
                "A 0 is no fault in a pad at rest: firmware sets small forces to 0. Only a press",
                "shows whether a taxel is dead.",
            ]
        if self.unit != "N" and (self.zero.any() or self.constant.any()):
            lines.append("Raw readings are never at rest: one that does not change at all is of a dead taxel.")
        elif self.constant.any():
            lines.append("A taxel that always reads the same value carries a steady load, or is stuck.")
        return lines


def _digits(value: float) -> int:
    """Return the number of decimals in the table; fewer for large values, so that they fit."""
    return 2 if abs(value) < 100 else 0


def measure_quality(
    frames: Sequence[Frame], layout: TaxelLayout, pads: Sequence[str], nominal_rate: float | None = None
) -> SensorQuality:
    """Measure the quality of the frames of a sensor at rest and untouched.

    Args:
        frames: Frames in the order in which they arrived.
        layout: Taxel layout of the frames.
        pads: Names of the pads.
        nominal_rate: Frame rate stated by the profile (Hz).

    Raises:
        InvalidValueError: There are fewer than `MIN_FRAMES` frames, they have another shape, or are out of order.
    """
    if len(frames) < MIN_FRAMES:
        raise InvalidValueError(f"expected at least {MIN_FRAMES} frames to judge, got {len(frames)}: record longer")
    force = np.stack([frame.force for frame in frames])
    layout.check(force, len(pads))
    time = np.array([frame.time for frame in frames], dtype=np.float64)
    arrival = np.array([frame.arrival for frame in frames], dtype=np.float64)
    steps = np.diff([frame.sequence for frame in frames])
    if np.any(steps < 1) or np.any(np.diff(arrival) < 0) or not time[-1] > time[0]:
        raise InvalidValueError("frames must be in the order in which they arrived, each once")
    time -= time[0]
    total = force.sum(axis=(-2, -1), dtype=np.float64)
    drift, drift_error = _drift(time, total)
    constant = np.all(force == force[0], axis=(0, 2))
    zero = constant & np.all(force[0] == 0, axis=1)
    return SensorQuality(
        layout=layout,
        pads=tuple(pads),
        unit=frames[0].unit,
        nominal_rate=nominal_rate,
        time=time,
        intervals=np.diff(arrival) / steps,
        lost=int(np.sum(steps - 1)),
        total=total,
        noise=_noise(force),
        total_noise=_noise(total),
        drift=drift,
        drift_error=drift_error,
        zero=zero,
        constant=constant & ~zero,
    )


def _noise(values: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.sqrt(np.mean(np.square(np.diff(values, axis=0), dtype=np.float64), axis=0) / 2)


def _drift(time: NDArray[np.float64], total: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Fit a line to the means over blocks of time; return its slope and standard error (N per minute)."""
    blocks = min(_BLOCKS, len(time) // 4)
    minutes = np.array([part.mean() for part in np.array_split(time, blocks)]) / 60
    means = np.array([part.mean(axis=0) for part in np.array_split(total, blocks)])
    away = (minutes - minutes.mean())[:, None, None]
    spread = np.sum(away**2)
    slope = np.sum(away * means, axis=0) / spread
    left = means - means.mean(axis=0) - away * slope
    return slope, np.sqrt(np.sum(left**2, axis=0) / (blocks - 2) / spread)
