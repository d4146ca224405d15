"""Evidence: what a diagnosis says of each named cause, and warnings about results that a reader should not rely on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.causes.kinds import AXES, BaselineCause, FittedCause
from paxisim.diagnose.data.directions import followed
from paxisim.diagnose.data.problem import FloatArray, Problem, showing
from paxisim.diagnose.data.repeats import with_memory_effects
from paxisim.diagnose.explain.explanation import Explanation, Named, reading_without
from paxisim.diagnose.explain.heldout import SquaredErrors, by_episode, gain_of, survives
from paxisim.diagnose.explain.intervals import parameters_of
from paxisim.diagnose.result import FoundCause, FoundPart, Interval, LeftOver, pad_in_words, percentage
from paxisim.diagnose.search import rivals_in_place
from paxisim.logs.memory import PRESSED_SHARE

NEARLY_ALL = 0.9  # share of the sum of squares of an offset
MAX_LISTED = 8  # channels listed


def found_causes(found: Explanation, squares: SquaredErrors, seed: int, jobs: int = 1) -> tuple[FoundCause, ...]:
    """The named causes with their parameters, gains, rivals, evidence and parts, largest gain first."""
    rivals, parameters, causes = _rivals(found), parameters_of(found), []
    for named in found.named:
        name, without = named.name, squares.without[named.name]
        gain = gain_of(squares, without, seed)
        evidence = _evidence(found.problem, named, without - squares.after, gain)
        parts = _parts(found, squares, named, gain, seed, jobs)
        causes.append(FoundCause(name, parameters[name], gain, rivals[name], evidence, parts))
    return tuple(sorted(causes, key=lambda cause: -cause.gain.value))


def _rivals(found: Explanation) -> Mapping[str, tuple[str, ...]]:
    """Causes that explain the recording as well as each named cause, best first, by the name of that cause.

    Each candidate is fitted in place of the named cause. It is a rival if the difference between their held-out errors
    would itself be too small to be named.
    """
    asked, causes = {item.name for item in found.off.causes}, found.scorer.causes.values()
    rivals: dict[str, tuple[str, ...]] = {named.name: () for named in found.named}
    for named in found.fitted:
        item = named.cause
        rivals[item.name] = rivals_in_place(found.scorer, found.chosen, item.name)
        if isinstance(item, BaselineCause) and item.unpressed_rival in asked:
            unpressed = _is_unpressed(found.problem, np.asarray(named.values[item.amounts]))
            rivals[item.name] += (item.unpressed_rival,) if unpressed else ()
    remembering = [item.name for item in causes if isinstance(item, FittedCause) and item.remembers]
    return with_memory_effects(found.problem, rivals, remembering)


def _is_unpressed(problem: Problem, offset: FloatArray) -> bool:
    """Whether nearly all of an offset is on taxels that are never pressed, which may equally well be stuck."""
    pressed = np.abs(problem.simulated).max(axis=(0, 2)) >= PRESSED_SHARE * problem.peak
    square = np.sum(offset**2, axis=1)
    return bool(pressed.any() and square[~pressed].sum() > NEARLY_ALL * square.sum())


def _parts(
    found: Explanation, squares: SquaredErrors, named: Named, whole: Interval, seed: int, jobs: int
) -> tuple[FoundPart, ...]:
    """The parts of a cause that pass the test of a cause, largest gain first; a single part has that of the whole."""
    if not named.parts:
        return ()
    weak = {own.name for own in found.scorer.evidence_of_parts(found.chosen, named.name) if not own.kept}
    problem, gains = found.off.judged, dict.fromkeys(named.parts, whole)
    for part in named.parts if len(named.parts) > 1 else ():
        without = by_episode(problem, problem.measured - reading_without(found, named, part, jobs))
        gains[part] = gain_of(squares, without, seed)
    parts = [FoundPart(part.name, part.words, part.parameters, gain) for part, gain in gains.items()]
    parts = [part for part in parts if part.name not in weak] or parts
    return tuple(sorted(parts, key=lambda part: -part.gain.value))


def _evidence(problem: Problem, named: Named, gain: FloatArray, share: Interval) -> str:
    """The evidence for a cause in words.

    It states the reduction `gain` ``(episodes,)`` N^2 of each episode's squared error, and the total reduction `share`.
    """
    shown = showing(gain)
    words = (
        f"Without this cause, the model predicts {int((gain[shown] > 0).sum())} of the {int(shown.sum())} affected "
        f"held-out episodes less accurately. The cause explains {percentage(share.value)} of the explainable error."
    )
    if not named.transform.covariate_names or not isinstance(named.cause, BaselineCause):
        return words
    rows, rest = problem.thinned, problem.thinned.at_rest
    rest = rest if rest.any() else np.ones_like(rest)
    added = rows.run(named.transform, np.zeros_like(rows.simulated))[rest]
    name, part = followed(named.transform, rows.covariates, added.reshape(len(added), -1), rest)
    return f"{words} A linear function of {name} explains {percentage(part)} of its effect without contact."


def confidence(found: Explanation, causes: Sequence[FoundCause], seed: int) -> dict[str, float]:
    """How often a cause is kept when held-out episodes are resampled, divided among the cause and its rivals.

    A parameter at its bound counts as one more rival, because the true value may lie beyond.
    """
    bounded = at_bounds(found)
    tests = {named.name: named.evidence for named in found.named if named.evidence is not None}
    kept = {name: survives(found.folds.independent(own.gain), own.needed, seed) for name, own in tests.items()}
    return {c.name: kept.get(c.name, 1.0) / (1 + len(c.rivals) + (c.name in bounded)) for c in causes}


def near_misses(found: Explanation, causes: Sequence[FoundCause]) -> dict[str, LeftOver]:
    """Causes that fall a little short of being named and that are no rivals of a named cause, by name."""
    shares = found.scorer.near_misses(found.chosen) if found.fitted else {}
    rivals = {name for item in causes for name in item.rivals}
    least, short = found.scorer.rules.near_miss, {}
    for name, share in shares.items():
        if share > least and name not in rivals:
            reached = f"it reaches {min(share, 1):.0%} of the gain required to name it"
            short[name] = LeftOver(f"{name} is a near miss: {reached}", share, least)
    return short


def caveats(
    found: Explanation, dropped: Mapping[str, Interval], pads: tuple[str, ...], replayed: bool
) -> tuple[str, ...]:
    """Warnings about results that a reader should not rely on, one line each.

    Args:
        found: Explanation of the recording.
        dropped: Causes that were fitted but not named, with their gain in the episodes that they affect.
        pads: Names of the pads.
        replayed: Whether the simulation followed the streams of a robot.
    """
    silent = silent_in_words(found.off.silent, pads)
    doubtful = (
        f"{name} was fitted but not named: it reduces the error of the held-out episodes that it affects by "
        f"{share.percent()}, too little to be sure of; there is no need to act"
        for name, share in dropped.items()
    )
    clocks = (f"{named.name}: {named.cause.of_replay}" for named in found.named if replayed and named.cause.of_replay)
    return (*silent, *at_bounds(found).values(), *doubtful, *clocks)


def at_bounds(found: Explanation) -> dict[str, str]:
    """Parameters that the fit pushes against a bound or beyond their limits, a colon and a warning, by cause."""
    lines = {}
    for named in found.fitted:
        for free in named.cause.parameters(found.problem):
            value = named.values.get(free.name)
            if free.material is not None and value in (free.low, free.high) and value != free.neutral:
                place = f"{free.name} of {named.name} is at its bound, {value:g} {free.unit}".removesuffix(" 1")
                lines[named.name] = f"{place}: do not rely on its value"
        item = named.cause
        if isinstance(item, FittedCause):
            for name, value in item.beyond_limits(found.fit.whole.values[item.name], found.problem).items():
                most = " to ".join(f"{end:g}" for end in item.limits[name])
                place = f"{name} of {item.name} is {value:.3g}, but the cause itself explains only {most}"
                lines[item.name] = f"{place}: {item.beyond} may act beside it"
    return lines


def silent_in_words(silent: NDArray[np.bool_], pads: tuple[str, ...]) -> tuple[str, ...]:
    """Warnings about excluded channels, which are True in `silent` ``(pads, 3, rows, cols)``."""
    whole, warnings = silent.all(axis=(2, 3)), []
    if whole.any():
        axes = [" and ".join(AXES[axis] for axis in np.flatnonzero(own)) for own in whole]
        names = ", ".join(f"{own} of {pad_in_words(pad)}" for own, pad in zip(axes, pads, strict=True) if own)
        warnings.append(
            f"{names} never change although the simulation does: either the sensor does not measure them, or they are "
            "not connected. They were excluded"
        )
    single = np.argwhere(silent & ~whole[:, :, None, None])
    if len(single):
        names = ", ".join(f"{AXES[k]} of {pad_in_words(pads[p])} ({r}, {c})" for p, k, r, c in single[:MAX_LISTED])
        more = f" and {len(single) - MAX_LISTED} more" if len(single) > MAX_LISTED else ""
        warnings.append(
            f"{names}{more} never change{'s' if len(single) == 1 else ''} under load although the other axes of the "
            "taxel respond. Such dead channels were excluded"
        )
    return tuple(warnings)
