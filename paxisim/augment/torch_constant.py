"""The torch part of `paxisim.augment.constant`. Only this module and `paxisim.augment.torch` import torch on load."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

from paxisim.errors import MissingExtraError

try:
    import torch
except ImportError as error:
    raise MissingExtraError("torch", "torch", "paxisim.augment.torch_constant") from error

_made: dict[Any, torch.Tensor] = {}


@torch.compiler.assume_constant_result
def torch_constant(make: Callable[..., Any], args: tuple[Hashable, ...], dtype: Any, device: Any) -> torch.Tensor:
    """Return ``make(*args)`` as a tensor, computed once for each dtype and device."""
    key = (make, args, dtype, device)
    if key not in _made:
        with torch.inference_mode(False):
            values = torch.as_tensor(make(*args), dtype=dtype, device=device)
        if type(values) is not torch.Tensor:  # a tracer's placeholder, which must not be cached
            return values
        _made[key] = values
    return _made[key]
