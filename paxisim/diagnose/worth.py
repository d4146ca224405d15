"""Worth: the rules by which a cause is kept, given the fits with it and without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from paxisim.diagnose.cause import FORM, TAXEL_GAIN, Cause, Values
from paxisim.diagnose.displaced import beyond_tolerated
from paxisim.diagnose.fits import Fits
from paxisim.diagnose.fitting import Fit
from paxisim.diagnose.problem import FloatArray, Problem, showing

WANDERING = 0.0005  # of what offset and drift explain, that their form leaves to most others, as zeros wander
DRIFTING = 0.05  # of what a drift explains within the episodes, that its form leaves to a field that comes and goes
COARSE = 0.7  # of a step: with less noise before rounding an offset is not told well
HIDDEN = 0.07  # of what such an offset explains, that it may leave to most others
MOST_HIDDEN = 0.02  # of the noise's energy, that this may be where no noise smooths the rounding
EACH = 2.0  # times what a field's form leaves to another on the whole, that it may leave in one episode
UNREPEATED = 3.0  # times what matters that a cause must bring which but few of the episodes show
REPEATED = 0.5  # of what a cause of many numbers must bring, that it must bring without its best episode
ELSEWHERE = 0.25  # of what it brings, that it must bring there
ENOUGH = 3.0  # times what a cause must bring, that is enough elsewhere, however much one episode gains
HARDLY = 0.975  # of what is gained in some episodes and lost in others, that is gained
UNLIKE_TOLERATED = (
    0.5  # of what gains of taxels bring, or what one episode alone shows, that nothing tolerated may bring
)
CLEARLY_UNLIKE = 5.0  # times what it must bring, of which so much is enough, as large saturations look like a gain, too
UNPRESSED = 0.5  # of what a field brings in the one episode that shows it, that it must bring where nothing is pressed
BESIDE_GAINS = 2.0  # times what it must bring, that a field must bring beside gains of taxels where steps are large
SEVERAL = 6  # episodes


@dataclass(frozen=True)
class Thresholds:
    """What a cause must bring to be kept.

    Attributes:
        material: Energy, as a share of the noise's: less does not matter to a user.
        second: Whether this is a second look, in which chance brings little, so that less of some causes is enough.
        episodes: Share of the episodes that must gain, of those in which the two models differ at all; or of what is
            gained in some and lost in others.
        most: Causes at most, those that are read off the data apart.
    """

    material: float = 0.003
    second: bool = False
    episodes: float = 0.7
    most: int = 5

    def least(self, item: Cause) -> float:
        """What a cause must bring at least, as a share of the noise's energy."""
        return self.material * (item.faint if self.second else 1.0)


class Worth:
    """Whether causes are worth keeping in a recording."""

    def __init__(self, fits: Fits, limits: Thresholds) -> None:
        """Read what offset and drift may leave to others."""
        self._fits, self._limits = fits, limits
        self._by_name = fits.by_name
        self._problem = problem = fits.problem
        self._zero_gain = self._drifting = self._hidden = 0.0
        if np.any(problem.zero):
            with_zero = np.sum(problem.residual(problem.simulated + problem.zero) ** 2)
            self._zero_gain = max(float(np.sum(problem.residual(problem.simulated) ** 2) - with_zero), 0.0)
            still = problem.residual(problem.simulated + _still(problem))
            self._drifting = max(float(np.sum(still**2) - with_zero), 0.0)
            told = problem.dither / (COARSE * problem.step) if problem.step else 1.0
            if told < 1:
                read = [problem.read(problem.simulated + zero) for zero in (0.0, problem.zero)]
                without, whole = (float(np.sum(((problem.measured - r) * problem.weight) ** 2)) for r in read)
                self._hidden = min(HIDDEN * max(without - whole, 0.0), MOST_HIDDEN * (1 - told) * problem.samples)

    def keeps(self, more: Fit, fewer: Fit, name: str) -> bool:
        """Whether a cause brings enough to be kept, given the fits with it and without it."""
        item = self._by_name[name]
        least = self._least(item)
        gain = fewer.energy - more.energy
        elsewhere = gain.sum() - gain.max()
        alone = in_one_episode(gain, least)
        if item.costs > 1 and (alone or (len(gain) >= SEVERAL and elsewhere < REPEATED * least)):
            return False  # many numbers fit what one episode has of its own
        if item.costs > 1 and not self._is_not_tolerated(fewer, more, least, range(len(gain))):
            return False  # they also fit contacts beside their places
        if alone and item.mistaken >= FORM and not self._is_own(fewer, more, item, least, int(gain.argmax())):
            return False
        if not self._is_not_gains(fewer, item, least):
            return False
        if self.is_consistent(more, fewer, max(least, self.misfit(fewer, name, more))):
            return True
        return self.is_consistent(more, fewer, least) and self.told_beside_absorbers(fewer, name)

    def nearly(self, more: Fit, fewer: Fit, name: str) -> float:
        """What a cause that is not kept brings, as a share of what it must bring; 0 if episodes disagree."""
        least = max(self._least(self._by_name[name]), self.misfit(fewer, name, more))
        gain = fewer.energy - more.energy
        if in_one_episode(gain, least) or not self.is_consistent(more, fewer, 0.0):
            return 0.0
        return min(float(gain.sum() / least), self._size(more, name))

    def _least(self, item: Cause) -> float:
        """Energy, in units of the noise, that a cause must bring."""
        return self._limits.least(item) * self._problem.samples * item.costs

    def _is_own(self, fewer: Fit, more: Fit, item: Cause, least: float, number: int) -> bool:
        """Whether what one episode alone shows is the cause's own."""
        if not item.covariate:  # a press that is a little beside its place looks like a saturation
            return self._is_not_tolerated(fewer, more, least, (number,))
        # a field is there without a press, too
        span = self._problem.episodes[number]
        rest, left = (self._problem.residual(f.prediction)[span] ** 2 for f in (fewer, more))
        gain = (rest - left).sum(axis=(1, 2, 3, 4))
        unpressed = gain[self._problem.at_rest[span]].sum()
        return bool(unpressed > UNPRESSED * gain.sum())

    def _is_not_tolerated(self, fewer: Fit, more: Fit, least: float, numbers: Sequence[int]) -> bool:
        """Whether enough of what is gained is beyond what contacts may be off by in the episodes of those numbers."""
        gain = fewer.energy - more.energy
        own = sum(
            beyond_tolerated(self._problem, fewer.prediction, more.prediction, self._problem.episodes[number])
            for number in numbers
        )
        judged = float(gain[list(numbers)].sum())
        enough = min(UNLIKE_TOLERATED * max(least, judged), CLEARLY_UNLIKE * least)
        return own + float(gain.sum()) - judged > enough

    def _is_not_gains(self, fewer: Fit, item: Cause, least: float) -> bool:
        """Whether a field brings enough beside gains of taxels, where steps make much of those that are tolerated."""
        coarse = self._problem.dither < COARSE * self._problem.step
        if not (coarse and item.covariate) or TAXEL_GAIN in fewer.values or TAXEL_GAIN not in self._by_name:
            return True
        gains = self._fits.of([*fewer.values, TAXEL_GAIN], fewer)
        more = self._fits.of([*gains.values, item.name], gains)
        enough = float((gains.energy - more.energy).sum()) > BESIDE_GAINS * least
        return enough and self.is_consistent(more, gains, least)

    def told_beside_absorbers(self, fewer: Fit, name: str, among: str = "") -> bool:
        """Whether a cause brings enough where others, `among` them, take up what the form of one of a fit's misses."""
        item = self._by_name[name]
        least = self._least(item)
        for other in (self._by_name[n] for n in fewer.values):
            known = self._by_name.keys() >= set(other.absorbers)
            if name in other.absorbs and known and (not among or among in other.absorbers):
                names = list(dict.fromkeys([*fewer.values, *other.absorbers]))
                absorbed = self._fits.of(names, fewer)
                more = self._fits.of([*names, name], absorbed)
                return self.is_consistent(more, absorbed, max(least, self.misfit(fewer, name, more, other.name)))
        return False

    def is_consistent(self, more: Fit, fewer: Fit, least: float) -> bool:
        """Whether a fit gains more than `least` on another, and in most of the episodes in which they differ."""
        gain = fewer.energy - more.energy
        if gain.sum() <= least:
            return False
        if (gain[showing(gain)] > 0).mean() >= self._limits.episodes:
            return True
        # few may show it, then more of it, if the others do not object, or hardly speak
        better = gain[gain > 0].sum() / max(np.abs(gain).sum(), 1e-12)
        return bool(better >= HARDLY or (gain.sum() > UNREPEATED * least and better >= self._limits.episodes))

    def misfit(self, fewer: Fit, name: str, more: Fit | None = None, absorbed: str = "") -> float:
        """Energy that the forms of a fit's causes may leave for `name` to explain, at least or beside a fit with it.

        What the form of `absorbed` misses is taken up by others.
        """
        item = self._by_name[name]
        gain = np.maximum(fewer.energy - more.energy, 0.0) if more else np.zeros_like(fewer.energy)
        misfit = max(self._hidden, WANDERING * self._zero_gain) * min(item.mistaken / FORM, 1.0)
        if name == "interference":
            misfit = max(DRIFTING * self._drifting, WANDERING * self._zero_gain)
        for other in (self._by_name[n] for n in fewer.values):
            without = self._fits.of([n for n in fewer.values if n != other.name], fewer)
            share = other.absorbs[name] if other.name == absorbed else other.form.get(name, item.mistaken)
            left = share * (without.energy - fewer.energy)
            if other.covariate and not item.covariate:
                # a field leaves something where it changes, not where the pad is pressed
                misfit += np.minimum(EACH * np.maximum(left, 0.0), gain).sum()
            else:
                misfit += max(left.sum(), 0.0)
        return float(misfit)

    def matters(self, found: Fit, name: str) -> bool:
        """Whether a cause has values in a fit that matter, beside the others that are in."""
        return self._size(found, name) >= 1

    def _size(self, found: Fit, name: str) -> float:
        values: Values = found.values[name]  # type: ignore[assignment]
        return self._by_name[name].size(values, self._problem, found.values)


def in_one_episode(gain: FloatArray, least: float) -> bool:
    """Whether one of several episodes has most of a gain, and the others too little to stand for themselves.

    Args:
        gain: ``(episodes,)`` energy.
        least: That a cause must bring.
    """
    elsewhere = gain.sum() - gain.max()
    return bool(len(gain) >= SEVERAL and elsewhere < min(ELSEWHERE * gain.sum(), ENOUGH * least))


def _still(problem: Problem) -> FloatArray:
    """``(T, pads, 3, rows, cols)`` the zero, in each episode its mean."""
    zero = np.broadcast_to(problem.zero, problem.measured.shape)
    return np.concatenate([np.broadcast_to(zero[span].mean(axis=0), zero[span].shape) for span in problem.episodes])
