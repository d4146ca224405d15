"""Random numbers from a generator of numpy or torch, for the parameters of a chain that GCS draws."""

from __future__ import annotations

from typing import Any

import numpy as np

from paxisim.augment.random_numbers import SEEDS
from paxisim.errors import InvalidValueError


def uniform(rng: Any, shape: tuple[int, ...], bounds: tuple[float, float]) -> Any:
    """Draw uniform float32 numbers, in numpy or torch depending on `rng`; see `GCS.sample`."""
    low, high = bounds
    if isinstance(rng, np.random.Generator):
        return np.asarray(low + (high - low) * rng.random(shape), dtype=np.float32)
    torch, where = torch_of(rng)
    return low + (high - low) * torch.rand(shape, **where)


def normal(rng: Any, shape: tuple[int, ...]) -> Any:
    """Draw standard normal float32 numbers, in numpy or torch depending on `rng`; see `GCS.sample`."""
    if isinstance(rng, np.random.Generator):
        return rng.standard_normal(shape, dtype=np.float32)
    torch, where = torch_of(rng)
    return torch.randn(shape, **where)


def torch_of(rng: Any) -> tuple[Any, dict[str, Any]]:
    """Return torch, and the arguments of its functions that draw float32 numbers from `rng`; see `GCS.sample`."""
    if type(rng).__module__.split(".")[0] != "torch":
        raise InvalidValueError(f"GCS: rng must be a numpy.random.Generator or a torch.Generator, got {rng!r}")
    import torch

    where = {"device": rng} if isinstance(rng, torch.device) else {"device": rng.device, "generator": rng}
    return torch, {"dtype": torch.float32, **where}


def seeds(rng: Any, shape: tuple[int, ...]) -> Any:
    """Draw seeds for transforms that draw numbers themselves, in numpy or torch depending on `rng`."""
    if isinstance(rng, np.random.Generator):
        return rng.integers(0, SEEDS, shape)
    torch, where = torch_of(rng)
    return torch.randint(0, SEEDS, shape, **{**where, "dtype": torch.int64})
