"""The cases of the examination: what is hidden in each, made from a seed and the name of the case alone."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.random import Generator

import paxisim

from .bench import Form, from_then, only_there
from .broken import STREAMS, broken
from .effects import CAUSES, FORMS, form_called, forms_of
from .motion import draw_plan
from .outsiders import OUTSIDERS
from .pairs import TRIES, Draw, pair_of, signals_of
from .sensor import Effect, Sensor, draw_sensor

OFTEN = ("creep", "hysteresis")  # causes of which twice as many singles are drawn
LOCAL = ("stiffening", "creep", "hysteresis", "gel_operator", "axis_coupling", "rotation", "axis_gain", "low_pass",
         "latency", "dead_band", "saturation", "interference")  # fmt: skip
"""Causes that also act on one pad or region, or set in in the middle."""

RIVALS = {
    "creep": ("hysteresis", "drift", "latency"),
    "hysteresis": ("creep",),
    "low_pass": ("latency",),
    "latency": ("low_pass", "creep"),
    "axis_gain": ("stiffening", "saturation"),
    "stiffening": ("axis_gain", "saturation", "dead_band"),
    "saturation": ("axis_gain", "stiffening"),
    "dead_band": ("stiffening",),
}
"""Causes that slow ramps of one speed cannot tell from each other, as `shared/diagnosis.md` lists them."""

VISIBLE = 0.5  # least signal of an outsider and of an effect in a poor motion, on a part or from some moment on


@dataclass(frozen=True)
class Case:
    """A case before it is made.

    Attributes:
        kind: ``single``, ``pair``, ``uneven``, ``order``, ``part``, ``onset``, ``null``, ``hardnull``, ``outsider``,
            ``poor`` or ``broken``.
        about: What the list of cases fixes, such as cause and form; joined by colons.
        seed: The examination's seed.
    """

    kind: str
    about: str
    seed: int

    @property
    def name(self) -> str:
        """Name of the case, such as ``single:offset:magnetised:1``."""
        return f"{self.kind}:{self.about}"

    def rng(self) -> Generator:
        """Return the case's own generator."""
        words = hashlib.sha256(self.name.encode()).digest()[:16]
        return np.random.default_rng([self.seed, *np.frombuffer(words, np.uint32).tolist()])


@dataclass(frozen=True, eq=False)
class Made:
    """A case with its truth.

    Attributes:
        recording: What the diagnosis gets.
        true: The hidden causes.
        effects: What was drawn for each effect: cause, form, size, signal (beyond the other effects).
        accepted: Names that are no mistake although they are not hidden: the rivals in a poor motion.
        tolerated: Names that are ignored: ``quantisation`` where the sensor reads whole counts.
        about: Noise and nuisance (RMS, N) and other facts.
    """

    recording: paxisim.Recording
    true: tuple[str, ...]
    effects: tuple[dict[str, Any], ...]
    accepted: tuple[str, ...] = ()
    tolerated: tuple[str, ...] = ()
    about: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Numbers:
    """How many cases of each kind (or, for singles and outsiders, of each form; for poor and broken, of each type)."""

    single: int = 2
    pair: int = 40
    uneven: int = 20
    order: int = 14
    part: int = 14
    onset: int = 12
    null: int = 40
    hardnull: int = 10
    outsider: int = 2
    poor: int = 2
    broken: int = 3


def all_cases(seed: int, numbers: Numbers | None = None) -> list[Case]:
    """Return all cases of a seed."""
    n = numbers or Numbers()
    names: list[tuple[str, str]] = []
    for form in FORMS:
        count = n.single * (2 if form.cause in OFTEN else 1)
        names += [("single", f"{form.cause}:{form.name}:{i}of{count}") for i in range(count)]
    for kind in ("pair", "uneven", "order", "part", "onset", "null", "hardnull"):
        names += [(kind, str(i)) for i in range(getattr(n, kind))]
    names += [("outsider", f"{form.name}:{i}") for form in OUTSIDERS for i in range(n.outsider)]
    names += [("poor", f"{cause}:{i}") for cause in RIVALS for i in range(n.poor)]
    names += [("broken", f"{what}:{i}") for what in STREAMS for i in range(n.broken)]
    return [Case(kind, about, seed) for kind, about in names]


def make(case: Case) -> Made:
    """Make a case: equal cases give equal recordings."""
    rng, words = case.rng(), case.about.split(":")
    if case.kind == "single":
        form = form_called(words[0], words[1])
        number, count = (int(word) for word in words[2].split("of"))
        sensor = draw_sensor(rng, draw_plan(rng), rounds=False if form.cause == "quantisation" else None)
        return _made(sensor, [Draw(form, int(rng.integers(2**32))).at((number + rng.uniform()) / count, sensor)])
    if case.kind in ("pair", "uneven", "order"):
        sensor = draw_sensor(rng, draw_plan(rng))
        return _made(sensor, pair_of(rng, sensor, case.kind))
    if case.kind in ("part", "onset"):
        return _local(rng, case)
    if case.kind in ("null", "hardnull"):
        plan, hard = draw_plan(rng), case.kind == "hardnull"
        if hard:
            swing = 3 * (plan.temperature - plan.temperature[0])
            plan = replace(plan, temperature=plan.temperature[0] + swing)
        return _made(draw_sensor(rng, plan, loud=hard), [])
    if case.kind == "outsider":
        made = _visible(rng, [form for form in OUTSIDERS if form.name == words[0]], poor=False)
        return replace(made, true=())
    if case.kind == "poor":
        made = _visible(rng, forms_of(words[0]), poor=True)
        return replace(made, accepted=RIVALS[words[0]])
    sensor = draw_sensor(rng, draw_plan(rng))
    made = _made(sensor, [])
    return replace(
        made,
        recording=replace(made.recording, measured=broken(words[0], rng, sensor).astype(np.float32)),
        accepted=("axis_gain",) if words[0] == "milli" else (),
        about={**made.about, "broken": words[0]},
    )


def _visible(rng: Generator, forms: Sequence[Form], poor: bool) -> Made:
    """Return one effect of a form, drawn until its signal is at least `VISIBLE`."""
    form = forms[rng.integers(len(forms))]
    for _ in range(TRIES):
        sensor = draw_sensor(rng, draw_plan(rng, poor=poor))
        effect = Draw(form, int(rng.integers(2**32))).at(rng.uniform(0.3, 1), sensor)
        if sensor.signal([effect]) >= VISIBLE:
            return _made(sensor, [effect])
    raise RuntimeError(f"no visible {form.name} in {TRIES} draws")


def _local(rng: Generator, case: Case) -> Made:
    """Return an effect on one pad or half of it, or one that sets in in the middle; drawn until it is visible."""
    cause = LOCAL[(int(case.about) + case.seed) % len(LOCAL)]
    forms = [form for form in forms_of(cause) if form.sized]
    form, half = forms[rng.integers(len(forms))], case.kind == "onset" or rng.uniform() < 0.5
    share = float(rng.uniform(0.35, 0.6))
    for _ in range(TRIES):
        sensor = draw_sensor(rng, draw_plan(rng, pads=1 if half else 2))
        effect = Draw(form, int(rng.integers(2**32))).at(rng.uniform(0.5, 1), sensor)
        if case.kind == "onset":
            run, about = from_then(effect.run, share), {"since": share}
        else:
            pads, rows, cols = sensor.bench.shape
            mask = np.zeros((pads, 1, rows, cols), bool)
            if half:
                mask[:, :, : rows // 2] = True
                mask = mask if rng.uniform() < 0.5 else ~mask
            else:
                mask[rng.integers(pads)] = True
            run, about = only_there(effect.run, mask), {"where": "half" if half else "one pad"}
        effect = replace(effect, run=run)
        if sensor.signal([effect]) >= VISIBLE:
            return _made(sensor, [effect], **about)
    raise RuntimeError(f"no visible {form.name} in {TRIES} draws")


def _made(sensor: Sensor, effects: Sequence[Effect], **about: Any) -> Made:
    """Return the case of a sensor with effects."""
    plan, bench = sensor.bench.plan, sensor.bench
    still = replace(sensor, jitter=np.zeros_like(sensor.jitter))
    recording = paxisim.Recording(
        time=plan.frames,
        measured=sensor.read(effects).astype(np.float32),
        simulated=still.at_frames(bench.force).astype(np.float32),
        covariates={"gripper_opening": still.at_frames(plan.opening), "temperature": still.at_frames(plan.temperature)},
        episode=plan.episode,
        layout=paxisim.TaxelLayout(plan.rows, plan.cols, pitch=(plan.pitch / 1e3, plan.pitch / 1e3)),
    )
    listed = [
        {"cause": e.form.cause, "form": e.form.name, "size": round(e.size, 4), "signal": round(signal, 4)}
        for e, signal in zip(effects, signals_of(sensor, effects), strict=True)
    ]
    facts = {"noise": sensor.loudness(), "nuisance": sensor.nuisance(), "counts": sensor.rounds, "clips": sensor.clips}
    return Made(
        recording=recording,
        true=tuple(sorted({e.form.cause for e in effects})),
        effects=tuple(listed),
        tolerated=("quantisation",) if sensor.rounds else (),
        about={**facts, "peak": plan.peak, "rate": plan.rate, "shape": list(bench.shape), **about},
    )


assert set(RIVALS) | set(LOCAL) <= set(CAUSES)
