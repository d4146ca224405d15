"""Hysteresis: the reading depends on the path that led to a load, but not on the rate."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.modes import check_modes, each_mode, over_modes
from paxisim.augment.parameter_spec import Parameter, check, is_torch, namespace, parameter
from paxisim.augment.transform import Covariates, State, StatefulTransform

SMALL = 250  # numbers in a frame below which the call overhead of each frame exceeds the arithmetic

NAMES = ("weight", "radius", "growth")


@dataclass(frozen=True, eq=False)
class Hysteresis(StatefulTransform):
    """A share of the load passes through M play operators (backlashes): a Prandtl-Ishlinskii model.

    ::

        y = x + sum_m (weight_m + growth_m |x|) (p_m - x)        p_m <- max(x - radius_m, min(x + radius_m, p_m))

    A play p follows x at a distance of at most `radius` and stands still while x moves within that distance. It models
    dry friction between the gel's polymer chains, its fillers and its shell. The reading lags a rising load by ``sum
    weight radius`` and exceeds a falling one by the same amount. A load that oscillates with amplitude A traces a loop
    of area ``sum weight 4 radius max(0, A - radius)`` N^2. The model is rate-independent: only the turning points
    count, so neither `dt` nor the frames in between make a difference. Large loads keep the gain 1; small oscillations
    within all radii have the gain ``1 - sum weight``. With a `growth`, friction increases with the load, and so does
    the width of the loop. Each element and each axis is treated independently. Radii of 0, or weights and growths of 0,
    leave x unchanged.

    A stream, also after `reset`, begins in the virgin state: as if x had gone straight from zero to the first frame.

    Example:
        ``Hysteresis(weight=(0.5,), radius=(0.2,))``, a load applied and released:

        | t (s) | x (N) | p (N) | y (N) |
        |---|---|---|---|
        | 0 | 0 | 0 | 0 |
        | 1 | 1 | 0.8 | 0.9 |
        | 2 | 0.8 | 0.8 | 0.8 |
        | 3 | 0 | 0.2 | 0.1 |

    Source: M. Brokate and J. Sprekels, Hysteresis and Phase Transitions (1996), ch. 2. A loop of 11.4 % has been
    reported for a Hall-effect film sensor, but none for PaXini's; the ranges are ours, for loops of 2 to 15 %.

    Attributes:
        weight: ``(..., M)`` share of the load that passes through each play; the sum must not exceed 1.
        radius: ``(..., M)`` half-width of each play (N).
        growth: ``(..., M)`` increase of each weight per newton of load (1/N). M may be 1 in some of the three.

    Raises:
        InvalidValueError: Also if they have different numbers of plays, or the weights sum to more than 1.
    """

    stage: ClassVar[str] = "gel"

    weight: Any = parameter((0.0,), "m", low=0.0, high=1.0, typical=(0.05, 0.3))
    radius: Any = parameter((1.0,), "m", unit="N", low=0.0, typical=(0.1, 3.0))
    growth: Any = parameter((0.0,), "m", unit="1/N", low=0.0, typical=(0.0, 0.02))

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        modes = check_modes(self, *NAMES)
        weight = self.weight if is_torch(self.weight) else np.asarray(self.weight, dtype=np.float64)
        total = weight.sum(-1) * (modes // weight.shape[-1])
        check("Hysteresis", "the sum of weight", total, Parameter(low=0.0, high=1 + 1e-6))

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return the positions of the plays (N), ``(*batch, M, pads, 3, rows, cols)``."""
        virgin = namespace(x).zeros_like(over_modes(self, x, *NAMES))
        return (self._play(each_mode(x), virgin),)

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        frame = each_mode(x)
        play = self._play(frame, state[0])
        xp = namespace(x)
        weight = self.broadcast_parameter("weight", frame) + self.broadcast_parameter("growth", frame) * xp.abs(frame)
        return x + xp.sum(weight * (play - frame), axis=-5), (play,)

    def sweep(self, x: NDArray[np.floating], steps: NDArray[np.float64]) -> NDArray[np.floating] | None:
        """See `Transform.sweep`."""
        if is_torch(self.weight) or max(map(np.ndim, (self.weight, self.radius, self.growth))) > 1:
            return None
        plays = [(w, r, g) for w, r, g in np.broadcast(self.weight, self.radius, self.growth) if w or g]
        y = x.copy()
        if not plays:
            return y
        weight, radius, growth = np.array(plays, dtype=x.dtype).T
        grows, sizes = growth.any(), np.abs(x).reshape(len(x), -1)
        if 0 < x[:1].size <= SMALL:
            flat, lag = y.reshape(sizes.shape), x.reshape(sizes.shape)
            for w, r, g in zip(weight, radius, growth, strict=True):
                flat += (w + g * sizes) * (_play_in_stretches(lag, r) - lag)
            return y
        radius = radius.reshape(-1, *[1] * (x.ndim - 1))
        play, bound = np.zeros((2, len(plays), *x.shape[1:]), dtype=x.dtype)
        lags = bound.reshape(len(plays), -1)
        # all plays at once, in buffers that stay cached
        for frame, size, out in zip(x, sizes, y.reshape(len(y), -1), strict=True):
            np.add(frame, radius, out=bound)
            np.minimum(play, bound, out=play)
            np.subtract(frame, radius, out=bound)
            np.maximum(play, bound, out=play)
            np.subtract(play, frame, out=bound)
            out += weight @ lags
            if grows:
                out += size * (growth @ lags)
        return y

    def _play(self, frame: Any, play: Any) -> Any:
        xp = namespace(frame)
        radius = self.broadcast_parameter("radius", frame)
        return xp.maximum(frame - radius, xp.minimum(frame + radius, play))


def _play_in_stretches(x: NDArray[np.floating], radius: np.floating) -> NDArray[np.floating]:
    """Return the positions ``(time, values)`` of a play that starts at 0.

    One frame moves any play into the range of `radius` around the force, and several frames in a row move it into some
    range too. These ranges are found for all stretches in parallel; then the play is followed through the stretches.
    For small frames, the call overhead of every frame would otherwise exceed the arithmetic.
    """
    length = math.isqrt(len(x))
    count = -(-len(x) // length)
    held = np.concatenate([x, np.repeat(x[-1:], count * length - len(x), axis=0)]).reshape(count, length, -1)
    least, most = held - radius, held + radius
    for frame in range(1, length):
        here = least[:, frame].copy(), most[:, frame].copy()
        for bound in (least, most):
            np.clip(bound[:, frame - 1], *here, out=bound[:, frame])
    at = np.zeros_like(x[0])
    for stretch in range(count):
        np.clip(at, least[stretch], most[stretch], out=held[stretch])
        at = held[stretch, -1]
    return held.reshape(count * length, -1)[: len(x)]
