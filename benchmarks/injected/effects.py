"""Effects of the generator of hidden effects (`tests/hidden`), applied to a real signal of one pad of 1x5 taxels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from harness import ROOT  # noqa: F401  # makes the generator importable
from hidden.contact import positions
from hidden.effects import DT, EFFECTS, FORMS, Episode, Pad
from hidden.outsiders import swapped_neighbours
from hidden.sensor import rounded
from numpy.typing import NDArray

Floats = NDArray[np.float64]
KINDS = (*EFFECTS, "dies_halfway", "swapped_taxels")
NOTHING = ("flip_rows", "swap_pads", "transposed")
"""Forms that change nothing on a single row of one pad."""
TRAVEL = 0.04  # m, for the joint that carries a magnet past the taxels


@dataclass(frozen=True, eq=False)
class Scene:
    """The recording for which an effect is drawn.

    Attributes:
        time: ``(T,)`` seconds, not decreasing.
        force: ``(T, 3, 5)`` newtons, signal without the effect.
        peak: Peak of the most loaded channel (N), 99.5 % quantile.
        episode: ``(T,)`` number of the press.
        angle: ``(T,)`` rad, angle of a joint that moves independently.
    """

    time: Floats
    force: Floats
    peak: float
    episode: NDArray[np.int64]
    angle: Floats


def drawn(kind: str, rng: np.random.Generator, scene: Scene) -> tuple[str, Callable[[Floats], Floats]]:
    """Draw an effect of a kind: its words, and a function of ``(T, 3, 5)`` newtons at the scene's times."""
    pad = Pad(positions(1, 5, (7e-3, 7e-3)), 1, 5, 1, scene.peak)
    strength = rng.uniform(0.9, 1.0)
    if kind == "swapped_taxels":
        apply, truth = swapped_neighbours(rng, pad, 0.0)
    else:
        name = "dead_taxels" if kind == "dies_halfway" else kind
        forms = [form for form in FORMS[name] if form not in NOTHING]
        apply, truth = EFFECTS[name](rng, pad, strength, forms[rng.integers(len(forms))])
    since = rng.uniform(0.35, 0.65) if kind == "dies_halfway" else 0.0

    def read(force: Floats) -> Floats:
        if kind == "quantisation":
            return rounded(force[:, None], truth["step"], truth["form"])[:, 0]
        out = _on_fine_clock(apply, force, scene)
        start = int(since * len(out))
        return np.concatenate([force[:start], out[start:]])

    when = f" from {since:.0%} on" if since else ""
    return f"{truth.get('form', kind)}, strength {strength:.2f}{when}", read


def _on_fine_clock(apply: Callable, force: Floats, scene: Scene) -> Floats:
    """Return the run of presses with the effect, which acts on a signal of 500 Hz and remembers earlier presses."""
    time = scene.time
    fine = np.arange(time[0], time[-1] + DT, DT)

    def at(then: Floats, now: Floats, values: Floats) -> Floats:
        flat = values.reshape(len(values), -1)
        return np.stack([np.interp(then, now, c) for c in flat.T], axis=1).reshape(len(then), *values.shape[1:])

    swing = np.interp(fine, time, scene.angle) / np.abs(scene.angle).max()
    episode = Episode(float(time[0]), TRAVEL * (0.5 + 0.5 * swing), np.full(len(fine), 25.0))
    return at(time, fine, apply(at(fine, time, force)[:, None], episode)[:, 0])
