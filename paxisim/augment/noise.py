"""Noise: random errors of the sensor's electronics, as white noise or a random walk."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.random_numbers import SEEDS, check_seed, no_draws, normal
from paxisim.augment.transform import Covariates, State, StatefulTransform


@dataclass(frozen=True, eq=False)
class WhiteNoise(StatefulTransform):
    """White noise, drawn anew for each frame: ``y = x + sigma n``, with independent standard normal n.

    It models thermal noise of the Hall sensors and their amplifiers. `sigma` is the standard deviation of a delivered
    reading, whatever the frame rate: a noise density in N per root Hz times the root of the electronics' bandwidth.

    n depends only on the seed, the number of frames so far and the element. A chain therefore repeats its noise, in
    numpy and torch alike, and `reset` starts it over, so episodes with the same seed have the same noise. For new noise
    use a new seed. Environments draw different noise whether they share a seed or have their own; two noise transforms
    in a chain need two seeds. Every frame draws, even if dt = 0.

    Example:
        ``WhiteNoise(sigma, seed=0)``, one stream of x = 0:

        | t (s) | frames before | y |
        |---|---|---|
        | 0 | 0 | ``sigma n(0, 0)`` |
        | 1 | 1 | ``sigma n(0, 1)`` |
        | 2, reset here | 0 | ``sigma n(0, 0)``, as at t = 0 |
        | 3 | 1 | ``sigma n(0, 1)`` |

    The range is ours: 0.05 to 0.5 counts of a sensor with 0.1 N per count.

    Attributes:
        sigma: ``(..., pads, 3, rows, cols)`` standard deviation (N); any of the four dimensions may be 1.
        seed: ``(...)`` random seeds, whole numbers in [0, 2^32).

    Raises:
        InvalidValueError: Also if a seed is not an integer.
    """

    stage: ClassVar[str] = "electronics"

    sigma: Any = parameter(((((0.0,),),),), "pkrc", unit="N", low=0.0, typical=(0.005, 0.05))
    seed: Any = parameter(0, low=0, high=SEEDS - 1, typical=(0, SEEDS - 1), whole=True, seeds="sigma")

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        check_seed("WhiteNoise", self.seed)

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return the number of frames so far, ``(*batch, 1, 1, 1, 1)``."""
        return (no_draws(x),)

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        (count,) = state
        return x + self.broadcast_parameter("sigma", x) * normal(self.seed, count, x, _WHITE), (count + 1,)


@dataclass(frozen=True, eq=False)
class RandomWalk(StatefulTransform):
    """A zero that follows a random walk: ``y = x + b``, ``b <- b + sigma sqrt(dt) n``, with standard normal n.

    b is zero in the first frame and has variance ``sigma^2 t`` at time t, whatever the time steps; it does not change
    in a frame with dt = 0. Each element has an independent walk. Because n is drawn for each frame, the same seed gives
    a different walk at another frame rate. Seeds work as in `WhiteNoise`; `reset` also sets b to zero.

    Example:
        ``RandomWalk(sigma, seed=0)``, one stream of x = 0:

        | t (s) | frames before | y |
        |---|---|---|
        | 0 | 0 | 0 |
        | 1 | 1 | ``sigma n(0, 1)`` |
        | 2 | 2 | ``sigma (n(0, 1) + n(0, 2))`` |
        | 3, reset here | 0 | 0 |

    The range is ours: a standard deviation of 0.025 to 0.25 N after ten minutes.

    Attributes:
        sigma: ``(..., pads, 3, rows, cols)`` standard deviation after one second (N/sqrt(s)); any of the four
            dimensions may be 1.
        seed: ``(...)`` random seeds, whole numbers in [0, 2^32).

    Raises:
        InvalidValueError: Also if a seed is not an integer.
    """

    stage: ClassVar[str] = "electronics"

    sigma: Any = parameter(((((0.0,),),),), "pkrc", unit="N/sqrt(s)", low=0.0, typical=(0.001, 0.01))
    seed: Any = parameter(0, low=0, high=SEEDS - 1, typical=(0, SEEDS - 1), whole=True, seeds="sigma")

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        check_seed("RandomWalk", self.seed)

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return b and the number of frames so far, ``(*batch, 1, 1, 1, 1)``."""
        return (namespace(x).zeros_like(x), no_draws(x))

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        b, count = state
        deviation = self.broadcast_parameter("sigma", x) * namespace(x).sqrt(dt)
        b = b + deviation * normal(self.seed, count, x, _WALK)
        return x + b, (b, count + 1)


# streams of `random_numbers`; `Latency` uses 3
_WHITE, _WALK = 1, 2
