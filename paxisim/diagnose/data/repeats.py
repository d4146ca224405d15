"""Repeats: detect a sensor that has not settled, and motions too uniform in speed to separate memory effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.data.problem import FloatArray, Problem
from paxisim.diagnose.rules import STREAMS
from paxisim.logs.recording_arrays import episode_spans
from paxisim.recording import Recording

_HAS_LOAD = 0.5  # share of the largest load that an episode must reach to count as loaded
_PHASES = 100  # points at which the presses are compared
_LOADED = 0.02  # load above which a sample is pressed, relative to the peak load


def settled(recording: Recording, alive: NDArray[np.bool_]) -> tuple[Recording, str, float]:
    """The recording without its initial unsettled episodes, a name for them, and their distance; see `settling`.

    The name is empty if the sensor had settled.
    """
    count, off = settling(recording, alive)
    if not count:
        return recording, "", off
    first = "the first episode" if count == 1 else f"the first {count} episodes"
    return recording[_loaded(recording)[count].start :], first, off


def _loaded(recording: Recording) -> list[slice]:
    """The loaded episodes."""
    assert recording.simulated is not None
    load = np.abs(recording.simulated).max(axis=(1, 2, 3, 4))
    return [span for span in episode_spans(recording.episode) if load[span].max() > _HAS_LOAD * load.max()]


def settling(recording: Recording, alive: NDArray[np.bool_]) -> tuple[int, float]:
    """How many initial episodes read differently from the later ones of the same motion.

    A fresh or rested gel is stiffer in its first presses (Mullins effect). This can be detected only if the whole
    recording repeats one motion. Drift has no influence, because the reading at rest is subtracted in each episode.

    Args:
        recording: Recording with both streams; episodes without load are ignored.
        alive: ``(pads, 3, rows, cols)`` the channels to look at.

    Returns:
        Their number, at most half of the episodes; and the distance of the first episode, relative to the largest
        distance within the later half.
    """
    assert recording.measured is not None
    assert recording.simulated is not None
    load = np.abs(recording.simulated).max(axis=(1, 2, 3, 4)).astype(np.float64)
    error = ((recording.measured - recording.simulated) * alive).reshape(len(load), -1).astype(np.float64)
    spans = _loaded(recording)
    if len(spans) < STREAMS.repeats:
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
    if max(np.sqrt(np.mean((one - usual) ** 2)) for one in loads) > STREAMS.same_load * usual.max():
        return 0, 0.0
    steps = np.abs(np.diff(error, axis=0))
    shapes = np.array(errors) / np.maximum(np.median(steps, axis=0), 1e-3)
    later = len(spans) - len(spans) // 2
    most = max(
        _distance(shapes[i], np.delete(shapes, [*range(len(spans) - later), i], axis=0))
        for i in range(len(spans) - later, len(spans))
    )
    off = np.array([_distance(shape, shapes[-later:]) for shape in shapes]) / max(most, 1e-12)
    usual_again = np.flatnonzero(off[: len(spans) // 2] <= STREAMS.unsettled)
    return int(usual_again[0]) if len(usual_again) else len(spans) // 2, float(off[0])


def _distance(shape: FloatArray, others: FloatArray) -> float:
    return float(np.sqrt(np.mean((shape - others.mean(axis=0)) ** 2)))


def one_speed(problem: Problem) -> bool:
    """Whether all loads were applied and released at about the same speed, each on the way to its own maximum."""
    times = []
    for span in problem.episodes:
        load, time = np.abs(problem.simulated[span]).max(axis=(1, 2, 3, 4)), problem.time[span]
        top = float(load.max())
        if top < _LOADED * problem.peak:
            continue
        passes = np.flatnonzero(np.diff((load > 0.2 * top).astype(int)))
        over = np.flatnonzero(load > 0.8 * top)
        rise, fall = passes[passes < over[0]], passes[passes >= over[-1]]
        if len(rise):
            times.append(time[over[0]] - time[rise[-1]])
        if len(fall):
            times.append(time[fall[0] + 1] - time[over[-1]])
    return len(times) >= 2 and max(times) < STREAMS.speeds * max(min(times), 1e-9)


def with_memory_effects(
    problem: Problem, rivals: Mapping[str, tuple[str, ...]], remembering: Sequence[str]
) -> Mapping[str, tuple[str, ...]]:
    """The rivals, plus memory effects that only other speeds could separate.

    Args:
        problem: The recording.
        rivals: Rivals of each named cause.
        remembering: Names of the memory effects in the search, which only motions at several speeds can separate.
    """
    if not one_speed(problem):
        return rivals
    out = dict(rivals)
    for name in remembering:
        if name in rivals:
            others = [other for other in remembering if other != name]
            out[name] = tuple(dict.fromkeys([*rivals[name], *others]))
    return out
