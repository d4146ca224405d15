"""Shared code of the effects: the sensor, the episode, and draws of sizes, signs and forms."""

import functools
from dataclasses import dataclass

import numpy as np

DT = 1 / 500
COUNT = 0.1


@dataclass
class Pad:
    """The sensor: (N, 2) taxel centres (m), rows, columns and pads, and the largest force of a taxel (N)."""

    where: np.ndarray
    rows: int
    cols: int
    pads: int
    peak: float

    @property
    def away(self):
        """(N, N, 2) offsets from the second taxel to the first, m."""
        return self.where[:, None] - self.where[None]

    @property
    def distance(self):
        """(N, N) distances between taxels, in pitches."""
        r = np.linalg.norm(self.away, axis=-1)
        return r / np.median(np.sort(r, axis=1)[:, 1])

    @property
    def unit(self):
        """(N, 2) taxel centres, scaled to -1 to 1 over the pad."""
        return self.where / np.abs(self.where).max(axis=0).clip(1e-9)


@dataclass
class Episode:
    """Episode data for an effect: start since the recording began (s), (T,) opening (m), (T,) temperature (degC)."""

    start: float
    opening: np.ndarray
    temperature: np.ndarray


def between(low, high, strength):
    """Interpolate logarithmically from `low` at strength 0 to `high` at strength 1."""
    return float(low * (high / low) ** strength)


def sign(rng, *shape):
    """Draw -1 or 1."""
    return rng.choice([-1.0, 1.0], shape) if shape else float(rng.choice([-1.0, 1.0]))


def smooth(rng, pad, *shape):
    """Draw values (*shape, N) that vary smoothly over the pad, with mean 0 and standard deviation 1."""
    x, y = pad.unit.T
    values = rng.standard_normal((*shape, 5)) @ np.stack([x, y, x * y, x**2, y**2])
    values = values - values.mean(axis=-1, keepdims=True)
    return values / values.std(axis=-1, keepdims=True).clip(1e-9)


def forms(*usual, further=(), rare=()):
    """Decorate an effect that has several forms: one is drawn or requested, and stored in its truth.

    Only `usual` forms are drawn: drawing a form that was written later would change the recordings of all seeds. The
    family "broad" draws `further` forms, too; those in `rare` must be requested.
    """

    def given(effect):
        @functools.wraps(effect)
        def drawn(rng, pad, strength, form=None):
            own = usual[rng.integers(len(usual))]  # always drawn, so that later draws do not depend on `form`
            if form is not None and form not in (*drawn.forms, *rare):
                raise ValueError(f"{effect.__name__} has the forms {(*drawn.forms, *rare)}, got {form!r}")
            apply, truth = effect(rng, pad, strength, form or own)
            return apply, {"form": form or own, **truth}

        drawn.usual, drawn.forms, drawn.rare = usual, (*usual, *further), rare
        return drawn

    return given
