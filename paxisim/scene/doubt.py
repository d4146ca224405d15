"""Doubt: spans of a replay in which the simulated hand has lost the object, or holds it otherwise than the real one.

Once an object has slipped out of the simulated fingers, their forces say nothing about the sensor. So the total normal
forces of each pad are compared within each grasp. What is marked here is more than a sensor's gain, latency, drift or
noise: for a while, one stream reads a large part of its peak while the other reads next to nothing, or their ratio
leaves that of the rest of the grasp by a factor of three.

A hand that presses what it holds on a table or pushes it along is in doubt meanwhile: how the force is shared between
pads and table depends on micrometres, which no encoder reports.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError
from paxisim.presses import PEAK_THRESHOLDS, Presses, find_presses, runs
from paxisim.recording import Recording
from paxisim.scene.closing import pad_normal, total_normal

_LASTS = 0.2  # s; longer than a sensor's latency and than the contact itself takes to begin
_LARGE, _NOTHING = 0.3, 0.05  # shares of a stream's peak in the grasp
_RUNS_AWAY = 3.0  # factor by which the ratio of the streams leaves its median over the grasp
_PRESSED = 0.05  # force of the surroundings beyond the object's weight, as a share of the grasp's peak normal force


@dataclass(frozen=True)
class Doubt:
    """A span of an episode in which the replay does not hold.

    Attributes:
        samples: The samples, within the episode.
        begin: Time (s) of the first sample.
        end: Time (s) of the last sample.
        why: What happens, in words.
    """

    samples: slice
    begin: float
    end: float
    why: str


def find_grasps(time: NDArray[np.float64], measured: NDArray[np.float32]) -> tuple[slice, ...]:
    """Divide an episode into grasps: after each loss of contact, the state of the object is unknown again.

    Args:
        time: ``(T,)`` times (s).
        measured: ``(T, pads, 3, rows, cols)`` measured forces (N).

    Returns:
        Spans that cover all samples, each with one grasp and half of the rest before and after it.
    """
    presses = _presses(time, total_normal(measured))
    cuts = () if presses is None else presses.cuts
    return tuple(slice(a, b) for a, b in pairwise((0, *cuts, len(time))))


def find_doubts(
    part: Recording, simulated: NDArray[np.float32], pressed: NDArray[np.float32] | None = None
) -> list[Doubt]:
    """Return the doubtful spans of an episode.

    Where streams part, the span lasts to the end of the grasp; where the object is pressed on something, to the moment
    at which a sensor with a delay has noticed the end.

    Args:
        part: The episode; without measured forces in newtons, there is nothing to doubt.
        simulated: ``(T, pads, 3, rows, cols)`` simulated forces (N), NaN where unknown.
        pressed: ``(T,)`` force (N) beyond its weight with which the surroundings push an object in the hand.
    """
    if part.measured is None or part.unit != "N":
        return []
    time, measured, pads = part.time, part.measured, part.pads
    ours, theirs = pad_normal(np.nan_to_num(measured)), pad_normal(np.nan_to_num(simulated))
    ours = ours - [_rest(time, stream) for stream in ours.T]
    found = []
    for span in find_grasps(time, measured):
        partings = []
        for pad, name in enumerate(pads):
            parting = _parting(time[span], _Stream(ours[:, pad], span), _Stream(theirs[:, pad], span))
            if parting is not None:
                partings.append((*parting, name))
        until = span.stop
        if partings:
            at, why, name = min(partings)
            samples = slice(span.start + at, span.stop)
            until = samples.start
            begin, end = float(time[samples.start]), float(time[span.stop - 1])
            found.append(Doubt(samples, begin, end, f"{name} {why}"))
        if pressed is not None:
            found += _pressings(time, theirs.sum(axis=1), pressed, slice(span.start, until))
    return found


def _pressings(
    time: NDArray[np.float64], total: NDArray[np.float64], pressed: NDArray[np.float32], span: slice
) -> list[Doubt]:
    """Return the spans of a grasp in which the object in the hand is pressed on something else."""
    peak = float(total[span].max(initial=0.0))
    found: list[Doubt] = []
    for a, b in runs(np.nan_to_num(pressed[span]) > _PRESSED * peak) if peak > 0 else ():
        if time[span.start + b - 1] - time[span.start + a] < _LASTS:
            continue
        begin, end = span.start + a, int(np.searchsorted(time[: span.stop], time[span.start + b - 1] + _LASTS, "right"))
        if found and begin <= found[-1].samples.stop:
            begin = found.pop().samples.start
        why = "what the hand holds is pressed on something else"
        found.append(Doubt(slice(begin, end), float(time[begin]), float(time[end - 1]), why))
    return found


def recorded_doubts(recording: Recording) -> tuple[float, str]:
    """Return the share of a replay that was in doubt and left out, from 0 to 1, and the doubts in words."""
    replay = recording.metadata.get("replay")
    share, doubts = (replay.get("in_doubt"), replay.get("doubts")) if isinstance(replay, Mapping) else (None, None)
    if not (isinstance(share, (int, float)) and 0 < share <= 1):  # the entry may be from another program or edited
        return 0.0, ""
    listed = [str(doubt) for doubt in doubts] if isinstance(doubts, Sequence) and not isinstance(doubts, str) else []
    words = "; ".join(listed[:3]) + ("; ..." if len(listed) > 3 else "")
    said = f"the replay is in doubt in {share:.0%} of its samples, which are left out"
    return float(share), f"{said}: {words}" if words else said


def held(time: NDArray[np.float64], measured: NDArray[np.float32]) -> tuple[float, float]:
    """Return the times (s) of the first and last measured contact of a grasp."""
    presses = _presses(time, total_normal(measured))
    spans = () if presses is None else presses.spans
    first, last = (spans[0].start, spans[-1].stop - 1) if spans else (0, -1)
    return float(time[first]), float(time[last])


def _rest(time: NDArray[np.float64], total: NDArray[np.float64]) -> float:
    """Return the level of a pad at rest (N), which a sensor's offset moves from 0."""
    presses = _presses(time, total)
    return 0.0 if presses is None else presses.rest


def _presses(time: NDArray[np.float64], total: NDArray[np.float64]) -> Presses | None:
    """Return the presses in a force ``(T,)``; None if there are too few samples to find any."""
    try:
        return find_presses(time, total)
    except InvalidValueError:
        return None


class _Stream:
    """Total normal force (N) of a pad in a grasp, and what it reaches."""

    def __init__(self, whole: NDArray[np.float64], span: slice) -> None:
        self.force = whole[span]
        self.peak = float(self.force.max(initial=0.0))
        self.peak_of_episode = float(whole.max(initial=0.0))

    def exceeds(self, share: float) -> NDArray[np.bool_]:
        """Where the force exceeds a share of the grasp's peak."""
        return np.asarray(self.force > share * self.peak)


def _parting(time: NDArray[np.float64], measured: _Stream, simulated: _Stream) -> tuple[int, str] | None:
    """Return the sample at which a pad's streams part in a grasp, and how; None if they do not."""
    if not (measured.peak_of_episode > 0 and simulated.peak_of_episode > 0):
        return None  # a stream that never touches does not diverge: `Agreement` reports it
    touches = measured.peak > _LARGE * measured.peak_of_episode
    meets = simulated.peak > PEAK_THRESHOLDS[1] * simulated.peak_of_episode
    if not touches or not meets:
        return (0, "touches nothing in the scene") if touches else None
    lost = _first(time, measured.exceeds(_LARGE) & ~simulated.exceeds(_NOTHING))
    if lost is not None:
        return lost, "loses the object in the scene"
    kept = _first(time, simulated.exceeds(_LARGE) & ~measured.exceeds(_NOTHING))
    if kept is not None:
        return kept, "lost the object, but not in the scene"
    both = measured.exceeds(_LARGE) & simulated.exceeds(_NOTHING)
    if not both.any():
        return None
    ratio = np.zeros(len(time))
    ratio[both] = np.log(simulated.force[both] / measured.force[both])
    ratio[both] -= np.median(ratio[both])
    away = _first(time, np.abs(ratio) > np.log(_RUNS_AWAY))
    return None if away is None else (away, f"differs from the scene by more than a factor of {_RUNS_AWAY:g}")


def _first(time: NDArray[np.float64], where: NDArray[np.bool_]) -> int | None:
    """Return the first sample of the first stretch that lasts long enough."""
    return next((a for a, b in runs(where) if time[b - 1] - time[a] >= _LASTS), None)
