"""Pairs of effects, with a wanted ratio of their signals, and sometimes in an unusual order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from .bench import Form
from .effects import FORMS, forms_of
from .sensor import Effect, Sensor

INSEPARABLE = (
    {"offset", "drift"},  # a drift owns a constant
    {"offset", "interference"},  # so does a field
    {"low_pass", "latency"},
    {"creep", "hysteresis"},
    {"stiffening", "saturation"},
    {"stiffening", "dead_band"},
    {"stiffening", "axis_gain"},  # stiffening owns a gain
    {"saturation", "axis_gain"},
    {"rotation", "axis_coupling"},
    {"quantisation", "dead_band"},
    {"layout", "swapped_taxels"},
    {"layout", "rotation"},
    {"dead_taxels", "taxel_gain"},
    {"dead_taxels", "swapped_taxels"},
)
"""Causes of which no pair is drawn, since one may pass for a part of the other."""

REVERSIBLE = (
    ("stiffening", "gel_operator"),
    ("stiffening", "axis_coupling"),
    ("stiffening", "low_pass"),
    ("hysteresis", "gel_operator"),
    ("hysteresis", "low_pass"),
    ("gel_operator", "saturation"),
    ("low_pass", "saturation"),
    ("axis_gain", "dead_band"),
    ("rotation", "hysteresis"),
    ("rotation", "saturation"),
    ("stiffening", "creep"),
    ("taxel_gain", "gel_operator"),
)
"""Pairs that do not commute, for the unusual order."""

LEAST = 0.3  # least signal of either effect of a pair
TRIES = 30
UNSIZED = 0.12  # share of the comparable pairs in which one effect has no magnitude, such as a swapped wire


@dataclass(frozen=True)
class Draw:
    """A form with a seed: all but its magnitude."""

    form: Form
    seed: int

    def at(self, size: float, sensor: Sensor) -> Effect:
        """Return the effect of a magnitude of 0 to 1."""
        return Effect.of(self.form, size, self.form.make(np.random.default_rng(self.seed), sensor.bench, size))


def signals_of(sensor: Sensor, effects: Sequence[Effect]) -> list[float]:
    """Return the signal of each effect beyond all others."""
    return [sensor.signal(effects, [*effects[:i], *effects[i + 1 :]]) for i in range(len(effects))]


def pair_of(rng: Generator, sensor: Sensor, kind: str) -> list[Effect]:
    """Return two effects, both visible beyond the other.

    Args:
        rng: Source of all draws.
        sensor: The sensor.
        kind: ``pair`` for signals within a factor of 2.5 (any, if one has no magnitude), ``uneven`` for a ratio of
            energies of 10, ``order`` for two comparable effects that act in the reverse of the usual order.

    Raises:
        RuntimeError: `TRIES` draws had no such pair.
    """
    ratio = float(np.sqrt(10)) if kind == "uneven" else None
    unsized = kind == "pair" and rng.uniform() < UNSIZED
    for _ in range(TRIES):
        weak, strong = _two_forms(rng, kind, unsized, sensor.rounds)
        wanted = float(np.exp(rng.uniform(np.log(0.6), np.log(1.7)))) if ratio is None else ratio
        draws = [Draw(form, int(rng.integers(2**32))) for form in (weak, strong)]
        pair = _sized(sensor, draws, rng.uniform(0.2, 0.9), wanted)
        if kind == "order":
            pair = [replace(e, place=other.place) for e, other in zip(pair, reversed(pair), strict=True)]
        signals = signals_of(sensor, pair)
        if min(signals) >= LEAST and (unsized or abs(np.log(signals[1] / signals[0] / wanted)) < np.log(1.5)):
            return pair
    raise RuntimeError(f"no {kind} in {TRIES} draws")


def _two_forms(rng: Generator, kind: str, unsized: bool, rounds: bool) -> tuple[Form, Form]:
    """Return two forms of different causes that may form a pair; every cause is equally likely.

    Args:
        rng: Source of all draws.
        kind: As in `pair_of`.
        unsized: Whether the second has no magnitude.
        rounds: Whether the sensor reads whole counts, so that `quantisation` cannot be hidden.
    """

    def causes_of(sized: bool) -> list[str]:
        return sorted({f.cause for f in FORMS if f.sized == sized and not (rounds and f.cause == "quantisation")})

    while True:
        if kind == "order":
            causes = [str(cause) for cause in rng.permutation(REVERSIBLE[rng.integers(len(REVERSIBLE))])]
        else:
            causes = [str(rng.choice(causes_of(True))), str(rng.choice(causes_of(not unsized)))]
        if causes[0] != causes[1] and set(causes) not in INSEPARABLE:
            break
    chosen = []
    for cause, sized in zip(causes, (True, not unsized), strict=True):
        forms = [f for f in forms_of(cause) if f.sized == sized and not (kind == "order" and f.digital)]
        chosen.append(forms[rng.integers(len(forms))])
    return chosen[0], chosen[1]


def _sized(sensor: Sensor, draws: Sequence[Draw], size: float, ratio: float) -> list[Effect]:
    """Return both effects, the second with a signal `ratio` times that of the first as far as its magnitudes allow.

    Where they do not, the second has its smallest or largest magnitude, and the first is adjusted to it.
    """
    weak = draws[0].at(size, sensor)
    if not draws[1].form.sized:
        return [weak, draws[1].at(size, sensor)]
    strong, reached = _with_signal(sensor, draws[1], ratio * sensor.signal([weak]))
    if not reached:
        weak, _ = _with_signal(sensor, draws[0], sensor.signal([strong]) / ratio)
    return [weak, strong]


def _with_signal(sensor: Sensor, draw: Draw, wanted: float) -> tuple[Effect, bool]:
    """Return the effect whose signal is about the wanted one, and whether its magnitudes reach so far.

    The logarithm of a signal is nearly linear in the size, so a few steps of false position are enough.
    """
    low, high = 0.0, 1.0
    ends = [np.log(sensor.signal([draw.at(size, sensor)]) / wanted) for size in (low, high)]
    if ends[0] > 0 or ends[1] < 0:
        return draw.at(low if ends[0] > 0 else high, sensor), False
    middle = 0.5
    for _ in range(3):
        middle = low - ends[0] * (high - low) / max(ends[1] - ends[0], 1e-9)
        effect = draw.at(float(middle), sensor)
        miss = np.log(sensor.signal([effect]) / wanted)
        if abs(miss) < 0.1:
            break
        if miss < 0:
            low, ends[0] = middle, miss
        else:
            high, ends[1] = middle, miss
    return draw.at(float(middle), sensor), True
