"""Agreement: check whether a replay agrees with the measurement, before drawing conclusions about the sensor.

A motion that was not followed, or an object in a different place, looks like a sensor error. The total normal forces of
the two streams are therefore compared for each pad and episode: start and end of contact, typical force, peak, and
contact that appears in only one of the streams.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.recording import Recording
from paxisim.scene.clocks import Lags, find_lags
from paxisim.scene.closing import pad_normal

_CONTACT = 0.03  # contact threshold as a fraction of a stream's peak
_LEAST = 0.05  # N; lower bound of the contact threshold
_MISSED = 0.5  # largest fraction of the contact time that the other stream may miss
_NEAR = (0.5, 2.0)  # accepted ratios of forces; outside, the replay is in doubt rather than the sensor's gain


@dataclass(frozen=True)
class PadAgreement:
    """Comparison of one pad in one episode.

    Times are on the recording's clock (s); NaN if a stream has no contact.

    Attributes:
        episode: Number of the episode.
        pad: Name of the pad.
        measured_peak: Highest measured total normal force (N), 0 without contact, NaN if both streams are never known.
        simulated_peak: Highest simulated total normal force (N), likewise.
        measured_contact: First and last time of contact in the measured stream.
        simulated_contact: First and last time of contact in the simulated stream.
        force_ratio: Simulated over measured total normal force: the median while both are in contact, NaN if they never
            are. Unlike the peaks, it hardly depends on short overshoots.
        only_measured: Time (s) for which only the measured stream is in contact.
        only_simulated: Time (s) for which only the simulated stream is in contact.
        shared: Time (s) for which both streams are in contact.
    """

    episode: int
    pad: str
    measured_peak: float
    simulated_peak: float
    measured_contact: tuple[float, float]
    simulated_contact: tuple[float, float]
    force_ratio: float
    only_measured: float
    only_simulated: float
    shared: float

    @property
    def problem(self) -> str:
        """Description of a disagreement, with the numbers needed to correct it; empty if there is none."""
        where = f"episode {self.episode}, {self.pad}"
        if np.isnan(self.measured_peak):
            return f"{where}: the streams are never known together"
        measured, simulated = _span(self.measured_contact), _span(self.simulated_contact)
        if self.measured_peak > 0 and not self.simulated_peak > 0:
            return f"{where}: {self.measured_peak:.3g} N were measured ({measured}), but nothing touches in the scene"
        if self.simulated_peak > 0 and not self.measured_peak > 0:
            return f"{where}: {self.simulated_peak:.3g} N are simulated ({simulated}), but nothing was measured"
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
        if not _NEAR[0] <= self.force_ratio <= _NEAR[1]:
            return (
                f"{where}: the simulated force is typically {self.force_ratio:.2g} times the measured one (peaks "
                f"{self.simulated_peak:.3g} and {self.measured_peak:.3g} N; contact begins {late[0]:+.3f} s and "
                f"ends {late[1]:+.3f} s later than simulated)"
            )
        return ""


@dataclass(frozen=True)
class Agreement:
    """Result of `compare_streams`; its text is a short summary.

    Attributes:
        pads: The comparison of each pad in each episode.
        lags: By how much measured contacts come after simulated ones.
    """

    pads: tuple[PadAgreement, ...]
    lags: Lags

    @property
    def problems(self) -> tuple[str, ...]:
        """Disagreements that put the replay, rather than the sensor, in doubt; empty if there are none."""
        touched = any(max(one.measured_peak, one.simulated_peak) > 0 for one in self.pads)
        if not touched and not any(np.isnan(one.measured_peak) for one in self.pads):
            return ("there is no contact anywhere, neither measured nor simulated",)
        clocks = [str(self.lags)] if self.lags.of_clocks else []
        return (*clocks, *(one.problem for one in self.pads if one.problem))

    @property
    def peak_ratio(self) -> float:
        """Median ratio of simulated to measured peak over cases with contact in both; NaN if there are none."""
        return self._median(lambda one: one.simulated_peak / one.measured_peak)

    @property
    def force_ratio(self) -> float:
        """Median of `PadAgreement.force_ratio` over cases with contact in both; NaN if there are none."""
        return self._median(lambda one: one.force_ratio)

    @property
    def begins_late(self) -> float:
        """Median time (s) by which contact begins later in the measured stream; NaN if no case has contact in both."""
        return self._median(lambda one: one.measured_contact[0] - one.simulated_contact[0])

    @property
    def ends_late(self) -> float:
        """Median time (s) by which contact ends later in the measured stream; NaN if no case has contact in both."""
        return self._median(lambda one: one.measured_contact[1] - one.simulated_contact[1])

    def _median(self, of) -> float:
        values = [of(one) for one in self.pads if one.measured_peak > 0 and one.simulated_peak > 0]
        return float(np.nanmedian(values)) if np.isfinite(values).any() else float("nan")

    def __str__(self) -> str:
        """Return the medians and the problems as text."""
        lines = []
        if np.isfinite(self.peak_ratio):
            lines.append(
                f"Simulated over measured, median of pads and episodes: force {self.force_ratio:.3f}, "
                f"peak {self.peak_ratio:.3f}"
            )
            lines.append(f"Measured contact begins {self.begins_late:+.3f} s and ends {self.ends_late:+.3f} s later")
        if str(self.lags) and not self.lags.of_clocks:
            lines.append(str(self.lags))
        problems = self.problems
        if not problems:
            return "\n".join([*lines, "The replay met what was measured."])
        of_pads = sum(bool(one.problem) for one in self.pads)
        doubtful = f" in {of_pads} of {len(self.pads)} cases" if of_pads else ""
        lines.append(f"Replay is in doubt{doubtful}; correct the scene before a diagnosis:")
        lines += [f"  {problem}" for problem in problems[:8]]
        if len(problems) > 8:
            lines.append(f"  and {len(problems) - 8} more")
        return "\n".join(lines)


def compare_streams(recording: Recording) -> Agreement:
    """Compare the total normal forces of a recording's measured and simulated stream.

    Args:
        recording: A recording with both streams.

    Raises:
        InvalidValueError: The recording lacks a stream.
    """
    if recording.measured is None or recording.simulated is None:
        lacks = "measured" if recording.measured is None else "simulated"
        raise InvalidValueError(f"comparing the streams needs both, but the recording has no {lacks} stream")
    measured, simulated = pad_normal(recording.measured), pad_normal(recording.simulated)
    thresholds = [_threshold(measured), _threshold(simulated)]
    found = []
    for number in dict.fromkeys(recording.episode.tolist()):
        mine = recording.episode == number
        for pad, name in enumerate(recording.pads):
            streams = measured[mine, pad], simulated[mine, pad]
            found.append(_compare(number, name, recording.time[mine], streams, thresholds))
    return Agreement(tuple(found), find_lags(recording))


def _threshold(total: NDArray[np.float64]) -> float:
    """Return the contact threshold of a stream (N), from its peak, its noise and a lower bound."""
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
    peaks, spans = [], []
    for total, touches in zip(totals, touching, strict=True):
        at = np.flatnonzero(touches)
        peaks.append(float(total.max()) if len(at) else 0.0 if len(time) else float("nan"))
        spans.append((float(time[at[0]]), float(time[at[-1]])) if len(at) else (float("nan"), float("nan")))
    shared = touching[0] & touching[1]
    return PadAgreement(
        episode=episode,
        pad=pad,
        measured_peak=peaks[0],
        simulated_peak=peaks[1],
        measured_contact=spans[0],
        simulated_contact=spans[1],
        force_ratio=float(np.median(totals[1][shared] / totals[0][shared])) if shared.any() else float("nan"),
        only_measured=float(width[touching[0] & ~touching[1]].sum()),
        only_simulated=float(width[touching[1] & ~touching[0]].sum()),
        shared=float(width[shared].sum()),
    )


def _noise(total: NDArray[np.float64]) -> float:
    """Estimate the standard deviation (N) of a stream's noise from differences of adjacent samples."""
    return float(1.4826 * np.median(np.abs(np.diff(total))) / np.sqrt(2)) if len(total) > 1 else 0.0


def _span(contact: tuple[float, float]) -> str:
    return f"from {contact[0]:.2f} s to {contact[1]:.2f} s"
