"""Effect: what is injected, and what an effect may know of the recording it is drawn for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Apply = Callable[[Floats], Floats]
"""From ``(T, 3, 5)`` newtons to the same."""


@dataclass(frozen=True, eq=False)
class Scene:
    """The recording an effect is drawn for.

    Attributes:
        time: ``(T,)`` seconds, not decreasing.
        force: ``(T, 3, 5)`` newtons, the signal without the effect.
        peaks: ``(3, 5)`` newtons that each channel reaches, 99.5 % quantile.
        noise: ``(3, 5)`` newtons of noise.
        angle: ``(T,)`` rad, a joint that moves by itself.
    """

    time: Floats
    force: Floats
    peaks: Floats
    noise: Floats
    angle: Floats

    @property
    def peak(self) -> float:
        """Newtons that the most loaded channel reaches."""
        return float(self.peaks.max())

    @property
    def axis_peaks(self) -> Floats:
        """``(3, 1)`` the same of each axis."""
        return self.peaks.max(axis=1, keepdims=True)


@dataclass(frozen=True, eq=False)
class Effect:
    """An effect with its numbers drawn.

    Attributes:
        words: Its form, convention and strength.
        apply: What it does to a signal at the scene's times.
    """

    words: str
    apply: Apply


def either(rng: np.random.Generator, *choices: str) -> str:
    """One of them."""
    return choices[int(rng.integers(len(choices)))]


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number, its logarithm evenly distributed."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def signed(rng: np.random.Generator, low: float, high: float, size: int) -> Floats:
    """``(size,)`` the same of either sign."""
    return np.exp(rng.uniform(np.log(low), np.log(high), size)) * rng.choice([-1.0, 1.0], size)
