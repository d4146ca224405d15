"""Repeats: what a motion that is repeated tells, and what it cannot: a sensor that settles, and speed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from paxisim.diagnose.diagnosis import LeftOver
from paxisim.diagnose.problem import FloatArray, Problem
from paxisim.logs.aligned import episode_spans
from paxisim.recording import Recording

ALIKE = 0.15  # of its peak, by which the load of a repeated motion may differ
LEAST = 5  # like episodes, of which the later half tells what is usual
UNUSUAL = 2.0  # times the largest distance among the later half
SPEEDS = 2.0  # times by which the slowest and the fastest pass differ where there is one speed
MEMORY = ("creep", "hysteresis")
"""Causes that differ only in what the speed does to them."""

_HAS_LOAD = 0.5  # of the recording's largest load, that an episode with a load reaches
_PHASES = 100
_LOADED = 0.02  # of the peak


def settled(recording: Recording) -> tuple[Recording, tuple[LeftOver, ...], tuple[str, ...]]:
    """The recording without the first episodes, in which the sensor had not settled; what they show; and a warning."""
    count, off = settling(recording)
    if not count:
        return recording, (), ()
    first = "the first episode" if count == 1 else f"the first {count} episodes"
    left = LeftOver(f"under load {first} read otherwise than the later ones of the same motion", off, UNUSUAL)
    warning = (
        f"{first}, of a motion that is repeated, read otherwise than the later ones ({off:.1f} times as far off as "
        "those are): the sensor had not settled. They are left out; the model is that of the settled sensor"
    )
    return recording[_loaded(recording)[count].start :], (left,), (warning,)


def _loaded(recording: Recording) -> list[slice]:
    """The episodes with a load."""
    assert recording.simulated is not None
    load = np.abs(recording.simulated).max(axis=(1, 2, 3, 4))
    return [span for span in episode_spans(recording.episode) if load[span].max() > _HAS_LOAD * load.max()]


def settling(recording: Recording) -> tuple[int, float]:
    """How many episodes at the beginning read otherwise than the later ones of the same motion.

    A fresh or rested gel is stiffer in its first presses (Mullins' effect). Told only where one motion is repeated
    throughout; a zero that drifts does not count, as what each episode reads at rest is taken off.

    Args:
        recording: With both streams; episodes without a load are passed over.

    Returns:
        Their number, at most half of the episodes; and how far off the first is, over the most that any of the later
        half is from the others of it.
    """
    assert recording.measured is not None
    assert recording.simulated is not None
    load = np.abs(recording.simulated).max(axis=(1, 2, 3, 4)).astype(np.float64)
    error = (recording.measured - recording.simulated).reshape(len(load), -1).astype(np.float64)
    spans = _loaded(recording)
    if len(spans) < LEAST:
        return 0, 0.0
    loads, errors = [], []
    for span in spans:
        pressed = span.start + np.flatnonzero(load[span] > _LOADED * load.max())
        time = recording.time[pressed[0] : pressed[-1] + 1]
        at = np.linspace(time[0], time[-1], _PHASES)
        inside = slice(pressed[0], pressed[-1] + 1)
        loads.append(np.interp(at, time, load[inside]))
        rest = np.setdiff1d(np.arange(span.start, span.stop), pressed)
        zero = error[rest].mean(axis=0) if len(rest) else error[pressed[0]]
        errors.append(np.stack([np.interp(at, time, c) for c in (error[inside] - zero).T], axis=1))
    usual = np.median(loads, axis=0)
    if max(np.sqrt(np.mean((one - usual) ** 2)) for one in loads) > ALIKE * usual.max():
        return 0, 0.0
    steps = np.abs(np.diff(error, axis=0))
    shapes = np.array(errors) / np.maximum(np.median(steps, axis=0), 1e-3)
    later = len(spans) - len(spans) // 2
    most = max(
        _distance(shapes[i], np.delete(shapes, [*range(len(spans) - later), i], axis=0))
        for i in range(len(spans) - later, len(spans))
    )
    off = np.array([_distance(shape, shapes[-later:]) for shape in shapes]) / max(most, 1e-12)
    usual_again = np.flatnonzero(off[: len(spans) // 2] <= UNUSUAL)
    return int(usual_again[0]) if len(usual_again) else len(spans) // 2, float(off[0])


def _distance(shape: FloatArray, others: FloatArray) -> float:
    return float(np.sqrt(np.mean((shape - others.mean(axis=0)) ** 2)))


def one_speed(problem: Problem) -> bool:
    """Whether every load was put on and taken off at about the same speed."""
    speeds = []
    for span in problem.episodes:
        load, time = np.abs(problem.simulated[span]).max(axis=(1, 2, 3, 4)), problem.time[span]
        low, high = 0.2 * problem.peak, 0.8 * problem.peak
        passes = np.flatnonzero(np.diff((load > low).astype(int)))
        over = np.flatnonzero(load > high)
        if not len(over) or not len(passes):
            continue
        rise, fall = passes[passes < over[0]], passes[passes >= over[-1]]
        if len(rise):
            speeds.append((high - low) / max(time[over[0]] - time[rise[-1]], 1e-9))
        if len(fall):
            speeds.append((high - low) / max(time[fall[0] + 1] - time[over[-1]], 1e-9))
    return len(speeds) >= 2 and max(speeds) < SPEEDS * min(speeds)


def with_untold(
    problem: Problem, rivals: Mapping[str, tuple[str, ...]], searched: Sequence[str]
) -> Mapping[str, tuple[str, ...]]:
    """The rivals, with those memories that only other speeds could tell apart.

    Args:
        problem: The recording.
        rivals: By cause that was found, those that do as well by the data.
        searched: The causes that were looked for.
    """
    if not one_speed(problem):
        return rivals
    out = dict(rivals)
    for name in MEMORY:
        if name in rivals:
            others = [other for other in MEMORY if other != name and other in searched]
            out[name] = tuple(dict.fromkeys([*rivals[name], *others]))
    return out
