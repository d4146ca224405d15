"""TactileTransform: a gymnasium wrapper that applies a chain or GCS to tactile observations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.gcs import GCS
from paxisim.augment.transform import Transform
from paxisim.errors import InvalidValueError, MissingExtraError, UnknownNameError
from paxisim.layout import TaxelLayout

try:
    import gymnasium
    from gymnasium import spaces
except ImportError as error:
    raise MissingExtraError("gymnasium", "train", "paxisim.augment.gym") from error

_STREAM = 0x7AC711E  # separates the wrapper's random numbers from the environment's for the same seed


class TactileTransform(gymnasium.Wrapper, gymnasium.utils.RecordConstructorArgs):
    """Wrapper that transforms the tactile observation of an environment, with parameters redrawn in each episode.

    The observation is a float Box of shape ``(pads, 3, rows, cols)`` in newtons, or such an entry of a Dict. Its space
    keeps shape and dtype but loses its bounds. A transform with memory is stepped with the environment and treats the
    first frame of an episode as constant before it. ``reset(seed=...)`` also seeds the draws. A noise transform with a
    fixed seed repeats itself in every episode; to avoid this, pass a function of `rng` that creates it with a new seed.

    Attributes:
        transform: Transform of the current episode.

    Example:
        ```python
        env = TactileTransform(env, GCS(), key="tactile")
        ```
    """

    def __init__(
        self,
        env: gymnasium.Env,
        transform: Transform | GCS | Callable[[np.random.Generator], Transform],
        *,
        key: str | None = None,
        dt: float | None = None,
        layout: TaxelLayout | None = None,
        covariates: Mapping[str, str] | None = None,
        seed: int | None = None,
    ) -> None:
        """Wrap an environment.

        Args:
            env: The environment.
            transform: Transform to apply in every episode, or a `GCS` or function that draws one per episode.
            key: Entry of a Dict space. Default: the observation itself.
            dt: Time between two steps of the environment (s); needed by transforms with memory.
            layout: Layout of the pads' taxels, for GCS. Default: a grid with the observation's rows and columns.
            covariates: Key of each covariate that the transform needs, by covariate name, looked up in the observation
                and then in ``info``. Default: the name itself. An array of one element counts as a number.
            seed: Random seed until the first ``reset(seed=...)``. Default: from the operating system.

        Raises:
            InvalidValueError: The observation is not such a Box, `dt` is not positive and finite, or the layout's rows
                and columns differ from the observation's.
            UnknownNameError: There is no such entry.
        """
        gymnasium.utils.RecordConstructorArgs.__init__(
            self, transform=transform, key=key, dt=dt, layout=layout, covariates=covariates, seed=seed
        )
        gymnasium.Wrapper.__init__(self, env)
        space = self._tactile_space(env.observation_space, key)
        self._key, self._dtype = key, space.dtype
        self._shape = space.shape
        self._pads, _, rows, cols = space.shape
        if dt is not None and not 0 < dt < float("inf"):
            raise InvalidValueError(f"TactileTransform: dt must be positive and finite, got {dt!r}")
        self._dt = dt
        self._layout = TaxelLayout(rows, cols, (1.0, 1.0)) if layout is None else layout
        if (self._layout.rows, self._layout.cols) != (rows, cols):
            raise InvalidValueError(
                f"TactileTransform: the layout has {self._layout.rows}x{self._layout.cols} taxels, the observation "
                f"{rows}x{cols}"
            )
        self._source = transform
        self._covariates = dict(covariates or {})
        self._rng = np.random.default_rng(seed)
        self._state: Any = ()
        self.transform: Transform = self._draw()
        unbounded = spaces.Box(-np.inf, np.inf, space.shape, space.dtype)  # type: ignore[arg-type]
        if key is None:
            self.observation_space = unbounded
        else:
            self.observation_space = spaces.Dict({**env.observation_space.spaces, key: unbounded})  # type: ignore[attr-defined]

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset the environment and draw the episode's transform; `seed` seeds both."""
        if seed is not None:
            self._rng = np.random.default_rng([seed, _STREAM])
        observation, info = self.env.reset(seed=seed, options=options)
        self.transform = self._draw()
        force, covariates = self._force(observation), self._find_covariates(observation, info)
        self._state = self.transform.initial_state(force, covariates)
        force, self._state = self.transform.step(force, self._state, 0.0, covariates)
        return self._replace(observation, force), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Step the environment and transform its tactile observation."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        covariates = self._find_covariates(observation, info)
        force, self._state = self.transform.step(self._force(observation), self._state, self._dt or 0.0, covariates)
        return self._replace(observation, force), reward, terminated, truncated, info

    def _draw(self) -> Transform:
        source = self._source
        if isinstance(source, GCS):
            source = source.sample(self._rng, layout=self._layout, pads=self._pads)
        elif not isinstance(source, Transform):
            source = source(self._rng)
        if source.has_memory and self._dt is None:
            raise InvalidValueError(f"TactileTransform: {source.name} has memory and needs dt, the time between steps")
        return source

    def _force(self, observation: Any) -> NDArray[Any]:
        # some environments, e.g. robosuite's GymWrapper, return float64 for a float32 space
        return np.asarray(observation if self._key is None else observation[self._key], dtype=self._dtype)

    def _replace(self, observation: Any, force: NDArray[Any]) -> Any:
        if force.shape != self._shape:
            raise InvalidValueError(
                f"TactileTransform: the transform made shape {force.shape} out of an observation of shape "
                f"{self._shape}: its parameters and covariates must be those of one environment, without a batch"
            )
        return force if self._key is None else {**observation, self._key: force}

    def _find_covariates(self, observation: Any, info: Mapping[str, Any]) -> dict[str, Any]:
        found = {}
        for name in self.transform.covariate_names:
            key = self._covariates.get(name, name)
            if self._key is not None and key in observation:
                found[name] = _number(observation[key])
            elif key in info:
                found[name] = _number(info[key])
            else:
                known = [*info, *(observation if self._key is not None else ())]
                raise UnknownNameError(f"key of observation or info, for the covariate {name!r}:", key, known)
        return found

    @staticmethod
    def _tactile_space(space: spaces.Space, key: str | None) -> spaces.Box:
        if key is not None:
            if not isinstance(space, spaces.Dict):
                raise InvalidValueError(f"TactileTransform: key {key!r} needs a Dict observation space, got {space}")
            if key not in space.spaces:
                raise UnknownNameError("entry of the observation", key, space.spaces)
            space = space[key]
        shape = space.shape or ()
        if not isinstance(space, spaces.Box) or len(shape) != 4 or shape[1] != 3 or space.dtype.kind != "f":
            raise InvalidValueError(
                f"TactileTransform expected a float Box of shape (pads, 3, rows, cols), got {space}"
                + ("" if key is not None or not isinstance(space, spaces.Dict) else "; name its entry with key=...")
            )
        return space


def _number(value: Any) -> Any:
    """Return a covariate without the dimensions of a Box of one number, which would count as a batch."""
    return np.reshape(value, ()) if np.size(value) == 1 else value
