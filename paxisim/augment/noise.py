"""Noise: what the sensor's electronics add at random, white or wandering."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from paxisim.augment.parameter_spec import namespace, parameter
from paxisim.augment.random_numbers import SEEDS, check_seed, no_draws, normal
from paxisim.augment.transform import Covariates, State, StatefulTransform


@dataclass(frozen=True, eq=False)
class WhiteNoise(StatefulTransform):
    """Noise that is new in every frame: ``y = x + sigma n``, n independent standard normal numbers.

    Thermal noise of the Hall sensors and their amplifiers. `sigma` is the deviation of a reading as it is delivered,
    whatever the frame rate: a noise density in N per root Hz times the root of the electronics' bandwidth.

    n is a function of the seed, the number of frames so far, and the element, and of nothing else: a chain repeats its
    noise, in numpy as in torch, and `reset` starts it over, so that an episode with the same seed has the same noise.
    For new noise give a new seed. Environments differ from one another whether they share a seed or have one each; two
    noises in a chain need two seeds. All frames draw, also those with dt = 0.

    Example:
        ``WhiteNoise(sigma, seed=0)``, one stream of x = 0:

        | t (s) | frames before | y |
        |---|---|---|
        | 0 | 0 | ``sigma n(0, 0)`` |
        | 1 | 1 | ``sigma n(0, 1)`` |
        | 2, reset here | 0 | ``sigma n(0, 0)``, as at t = 0 |
        | 3 | 1 | ``sigma n(0, 1)`` |

    The range is ours: 0.05 to 0.5 counts of a sensor with 0.1 N a count.

    Attributes:
        sigma: ``(..., pads, 3, rows, cols)`` standard deviation (N); any of the four may be 1 long.
        seed: ``(...)`` whole numbers in [0, 2^32).

    Raises:
        InvalidValueError: Also if a seed is no integer.
    """

    stage: ClassVar[str] = "electronics"

    sigma: Any = parameter(((((0.0,),),),), "pkrc", unit="N", low=0.0, typical=(0.005, 0.05))
    seed: Any = parameter(0, low=0, high=SEEDS - 1, typical=(0, SEEDS - 1), whole=True)

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        check_seed("WhiteNoise", self.seed)

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """The number of frames so far, ``(*batch, 1, 1, 1, 1)``."""
        return (no_draws(x),)

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        (count,) = state
        return x + self.broadcast_parameter("sigma", x) * normal(self.seed, count, x, _WHITE), (count + 1,)


@dataclass(frozen=True, eq=False)
class RandomWalk(StatefulTransform):
    """A zero that wanders: ``y = x + b``, ``b <- b + sigma sqrt(dt) n``, n independent standard normal numbers.

    b is zero in the first frame and has the variance ``sigma^2 t`` at time t, whatever the steps that led there; in a
    frame with dt = 0 it stays. Each element wanders by itself. As n is drawn anew for each frame, the same seed at
    another frame rate is another walk. What `WhiteNoise` says of seeds holds here; `reset` sets b to zero as well.

    Example:
        ``RandomWalk(sigma, seed=0)``, one stream of x = 0:

        | t (s) | frames before | y |
        |---|---|---|
        | 0 | 0 | 0 |
        | 1 | 1 | ``sigma n(0, 1)`` |
        | 2 | 2 | ``sigma (n(0, 1) + n(0, 2))`` |
        | 3, reset here | 0 | 0 |

    The range is ours: a wander of 0.025 to 0.25 N in ten minutes.

    Attributes:
        sigma: ``(..., pads, 3, rows, cols)`` deviation after one second (N/sqrt(s)); any of the four may be 1 long.
        seed: ``(...)`` whole numbers in [0, 2^32).

    Raises:
        InvalidValueError: Also if a seed is no integer.
    """

    stage: ClassVar[str] = "electronics"

    sigma: Any = parameter(((((0.0,),),),), "pkrc", unit="N/sqrt(s)", low=0.0, typical=(0.001, 0.01))
    seed: Any = parameter(0, low=0, high=SEEDS - 1, typical=(0, SEEDS - 1), whole=True)

    def __post_init__(self) -> None:
        """Check the fields."""
        super().__post_init__()
        check_seed("RandomWalk", self.seed)

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """b, and the number of frames so far, ``(*batch, 1, 1, 1, 1)``."""
        return (namespace(x).zeros_like(x), no_draws(x))

    def advance(self, x: Any, state: State, dt: Any, covariates: Covariates) -> tuple[Any, State]:
        """See `StatefulTransform.advance`."""
        b, count = state
        deviation = self.broadcast_parameter("sigma", x) * namespace(x).sqrt(dt)
        b = b + deviation * normal(self.seed, count, x, _WALK)
        return x + b, (b, count + 1)


# streams of `random_numbers`; 3 is that of `Latency`
_WHITE, _WALK = 1, 2
