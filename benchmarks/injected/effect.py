"""Effect: an injected effect, and the properties of the recording that its draw depends on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Apply = Callable[[Floats], Floats]
"""Maps ``(T, 3, 5)`` newtons to readings of the same shape."""


@dataclass(frozen=True, eq=False)
class Scene:
    """The recording for which an effect is drawn.

    Attributes:
        time: ``(T,)`` seconds, not decreasing.
        force: ``(T, 3, 5)`` newtons, signal without the effect.
        peaks: ``(3, 5)`` newtons, peak of each channel, 99.5 % quantile.
        noise: ``(3, 5)`` newtons, noise of each channel.
        angle: ``(T,)`` rad, angle of a joint that moves independently.
    """

    time: Floats
    force: Floats
    peaks: Floats
    noise: Floats
    angle: Floats

    @property
    def peak(self) -> float:
        """Peak of the most loaded channel (N)."""
        return float(self.peaks.max())

    @property
    def axis_peaks(self) -> Floats:
        """``(3, 1)`` newtons, peak of each axis."""
        return self.peaks.max(axis=1, keepdims=True)


@dataclass(frozen=True, eq=False)
class Effect:
    """An effect with drawn parameters.

    Attributes:
        words: Its form, convention and strength.
        apply: Applies the effect to a signal sampled at the scene's times.
    """

    words: str
    apply: Apply


def either(rng: np.random.Generator, *choices: str) -> str:
    """Draw one of the choices."""
    return choices[int(rng.integers(len(choices)))]


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw a log-uniform number."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def signed(rng: np.random.Generator, low: float, high: float, size: int) -> Floats:
    """Draw ``(size,)`` log-uniform numbers with random signs."""
    return np.exp(rng.uniform(np.log(low), np.log(high), size)) * rng.choice([-1.0, 1.0], size)
