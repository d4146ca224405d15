"""Agreement: whether a replay met what was measured, before anything is concluded about the sensor.

A motion that was not followed, or an object that lies elsewhere, looks like an error of the sensor. So the total normal
forces of the two streams are compared, pad by pad and episode by episode: when contact begins and ends, how fast the
force rises, how high it goes, and contact that only one of the two has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

_CONTACT = 0.03  # share of a stream's peak from which there is contact
_LEAST = 0.05  # N; what is below at the peak is no contact
_MISSED = 0.5  # share of the time in contact that the other stream may lack
_RISE = 0.05  # s, over which a slope is taken
_CLEAR = 4.0  # standard deviations of the noise, from which a slope is one
_NEAR = (0.5, 2.0)  # ratio of peaks or slopes beyond which replay is in doubt, not the sensor's gain


@dataclass(frozen=True)
class PadAgreement:
    """One pad in one episode. Times are on the recording's clock (s); NaN where a stream has no contact.

    Attributes:
        episode: Number of the episode.
        pad: Name of the pad.
        measured_peak: Highest total normal force (N).
        simulated_peak: The same of the simulation.
        measured_contact: First and last time in contact.
        simulated_contact: The same of the simulation.
        measured_slope: How fast force rises (N/s): half of all its rise is faster.
        simulated_slope: The same of the simulation.
        only_measured: Seconds in which only the measured stream is in contact.
        only_simulated: Seconds in which only the simulated one is.
        shared: Seconds in which both are.
    """

    episode: int
    pad: str
    measured_peak: float
    simulated_peak: float
    measured_contact: tuple[float, float]
    simulated_contact: tuple[float, float]
    measured_slope: float
    simulated_slope: float
    only_measured: float
    only_simulated: float
    shared: float

    @property
    def problem(self) -> str:
        """What is wrong, with the numbers that a person needs to mend it; empty if nothing is."""
        where = f"episode {self.episode}, {self.pad}"
        measured, simulated = _span(self.measured_contact), _span(self.simulated_contact)
        if self.measured_peak > 0 and not self.simulated_peak > 0:
            return f"{where}: {self.measured_peak:.3g} N were measured ({measured}) where nothing touches in the scene"
        if self.simulated_peak > 0 and not self.measured_peak > 0:
            return f"{where}: {self.simulated_peak:.3g} N are simulated ({simulated}) where nothing was measured"
        if not self.measured_peak > 0:
            return ""
        late = np.subtract(self.measured_contact, self.simulated_contact)
        if self.only_measured > _MISSED * (self.shared + self.only_measured):
            return (
                f"{where}: contact was measured {measured}, but is simulated only {simulated}: the scene closes "
                f"{self.only_measured:.2g} s too short"
            )
        if self.only_simulated > _MISSED * (self.shared + self.only_simulated):
            return (
                f"{where}: contact is simulated {simulated}, but was measured only {measured}: the scene closes "
                f"{self.only_simulated:.2g} s too long"
            )
        ratios = {"peak": self.simulated_peak / self.measured_peak}
        if self.measured_slope > 0 and self.simulated_slope > 0:
            ratios["slope"] = self.simulated_slope / self.measured_slope
        for what, ratio in ratios.items():
            if not _NEAR[0] <= ratio <= _NEAR[1]:
                return (
                    f"{where}: the simulated {what} is {ratio:.2g} times the measured one (peaks "
                    f"{self.simulated_peak:.3g} and {self.measured_peak:.3g} N; contact begins {late[0]:+.3f} s and "
                    f"ends {late[1]:+.3f} s later than simulated)"
                )
        return ""


@dataclass(frozen=True)
class Agreement:
    """What `compare_streams` finds; as text, a few lines.

    Attributes:
        pads: Each pad in each episode.
    """

    pads: tuple[PadAgreement, ...]

    @property
    def problems(self) -> tuple[str, ...]:
        """Where replay, and not the sensor, is in doubt; empty if nowhere."""
        touched = any(max(one.measured_peak, one.simulated_peak) > 0 for one in self.pads)
        if not touched:
            return ("there is no contact anywhere, neither measured nor simulated",)
        return tuple(one.problem for one in self.pads if one.problem)

    @property
    def peak_ratio(self) -> float:
        """Median of simulated over measured peak, where both touch; NaN where nothing does."""
        return self._median(lambda one: one.simulated_peak / one.measured_peak)

    @property
    def slope_ratio(self) -> float:
        """Median of simulated over measured slope, where both touch; NaN where nothing does."""
        return self._median(
            lambda one: one.simulated_slope / one.measured_slope if one.measured_slope > 0 else float("nan")
        )

    @property
    def begins_late(self) -> float:
        """Median of how much later contact begins in the measured stream (s); NaN where nothing touches."""
        return self._median(lambda one: one.measured_contact[0] - one.simulated_contact[0])

    @property
    def ends_late(self) -> float:
        """Median of how much later contact ends in the measured stream (s); NaN where nothing touches."""
        return self._median(lambda one: one.measured_contact[1] - one.simulated_contact[1])

    def _median(self, of) -> float:
        values = [of(one) for one in self.pads if one.measured_peak > 0 and one.simulated_peak > 0]
        return float(np.nanmedian(values)) if np.isfinite(values).any() else float("nan")

    def __str__(self) -> str:
        """The medians and the problems."""
        lines = []
        if np.isfinite(self.peak_ratio):
            lines.append(
                f"Simulated over measured, median of pads and episodes: peak {self.peak_ratio:.3f}, "
                f"slope {self.slope_ratio:.3f}"
            )
            lines.append(f"Measured contact begins {self.begins_late:+.3f} s and ends {self.ends_late:+.3f} s later")
        problems = self.problems
        if not problems:
            return "\n".join([*lines, "The replay met what was measured."])
        lines.append(
            f"Replay is in doubt in {len(problems)} of {len(self.pads)} cases; mend the scene before a diagnosis:"
        )
        lines += [f"  {problem}" for problem in problems[:8]]
        if len(problems) > 8:
            lines.append(f"  and {len(problems) - 8} more")
        return "\n".join(lines)


def compare_streams(recording: Recording) -> Agreement:
    """Compare the total normal forces of a recording's measured and simulated stream.

    Args:
        recording: Has both.

    Raises:
        InvalidValueError: It lacks one.
    """
    if recording.measured is None or recording.simulated is None:
        lacks = "measured" if recording.measured is None else "simulated"
        raise InvalidValueError(f"comparing the streams needs both, the recording has none that is {lacks}")
    measured, simulated = (
        tensor[:, :, 2].astype(np.float64).sum(axis=(-2, -1)) for tensor in (recording.measured, recording.simulated)
    )
    thresholds = [_threshold(measured), _threshold(simulated)]
    found = []
    for number in dict.fromkeys(recording.episode.tolist()):
        mine = recording.episode == number
        for pad, name in enumerate(recording.pads):
            streams = measured[mine, pad], simulated[mine, pad]
            found.append(_compare(number, name, recording.time[mine], streams, thresholds))
    return Agreement(tuple(found))


def _threshold(total: NDArray[np.float64]) -> float:
    """The force from which a stream is in contact: above a share of its peak, and above its noise."""
    known = total[np.isfinite(total)]
    if not len(known):
        return np.inf
    return max(_CONTACT * float(known.max()), 6 * _noise(known), _LEAST)


def _compare(
    episode: int,
    pad: str,
    time: NDArray[np.float64],
    streams: tuple[NDArray[np.float64], NDArray[np.float64]],
    thresholds: list[float],
) -> PadAgreement:
    both = np.isfinite(streams[0]) & np.isfinite(streams[1])
    time, totals = time[both], [stream[both] for stream in streams]
    touching = [total > threshold for total, threshold in zip(totals, thresholds, strict=True)]
    width = np.gradient(time) if len(time) > 1 else np.zeros(len(time))
    peaks, spans, slopes = [], [], []
    for total, touches in zip(totals, touching, strict=True):
        at = np.flatnonzero(touches)
        peaks.append(float(total.max()) if len(at) else 0.0)
        spans.append((float(time[at[0]]), float(time[at[-1]])) if len(at) else (float("nan"), float("nan")))
        slopes.append(_slope(time, total, touches))
    return PadAgreement(
        episode=episode,
        pad=pad,
        measured_peak=peaks[0],
        simulated_peak=peaks[1],
        measured_contact=spans[0],
        simulated_contact=spans[1],
        measured_slope=slopes[0],
        simulated_slope=slopes[1],
        only_measured=float(width[touching[0] & ~touching[1]].sum()),
        only_simulated=float(width[touching[1] & ~touching[0]].sum()),
        shared=float(width[touching[0] & touching[1]].sum()),
    )


def _slope(time: NDArray[np.float64], total: NDArray[np.float64], touches: NDArray[np.bool_]) -> float:
    if touches.sum() < 3:
        return 0.0
    at = np.arange(time[0], time[-1], _RISE)  # neighbouring frames may repeat a reading, or differ by noise
    if len(at) < 3:
        return 0.0
    rates = np.gradient(np.interp(at, time, total), at)
    noise = _noise(total) / (np.sqrt(2) * _RISE)
    rising = np.sort(rates[(np.interp(at, time, touches) > 0.5) & (rates > _CLEAR * noise)])
    # weighted by how much it rises: a long hold may rise often, but never far
    risen = np.cumsum(rising)
    return float(rising[np.searchsorted(risen, 0.5 * risen[-1])]) if len(rising) else 0.0


def _noise(total: NDArray[np.float64]) -> float:
    """Standard deviation (N) of a stream's noise, from neighbouring samples."""
    return float(1.4826 * np.median(np.abs(np.diff(total))) / np.sqrt(2)) if len(total) > 1 else 0.0


def _span(contact: tuple[float, float]) -> str:
    return f"from {contact[0]:.2f} s to {contact[1]:.2f} s"
