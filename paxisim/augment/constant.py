"""Arrays that numpy computes once, cached for each array library, dtype and device."""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.parameter_spec import is_torch
from paxisim.layout import TaxelLayout


def constant(make: Callable[..., NDArray[np.floating]], args: tuple[Hashable, ...], x: Any) -> Any:
    """Return ``make(*args)`` as a read-only array with the array library, dtype and device of `x`.

    The array is computed and sent to a device once, and is a constant for ``torch.compile``.

    Args:
        make: Module-level function that returns float64.
        args: Arguments of `make`, plain values only, as ``torch.compile`` requires; pass a layout as `layout_text`.
        x: numpy or torch array.
    """
    if is_torch(x):
        from paxisim.augment.torch_constant import torch_constant

        return torch_constant(make, args, x.dtype, x.device)
    return _numpy_constant(make, args, x.dtype)


def layout_text(layout: TaxelLayout) -> str:
    """Return a layout as text, which `read_layout` restores bit for bit."""
    return json.dumps(layout.to_dict())


def read_layout(text: str) -> TaxelLayout:
    """Return the layout that `layout_text` wrote."""
    return TaxelLayout.from_dict(json.loads(text))


@lru_cache(maxsize=128)
def _numpy_constant(
    make: Callable[..., NDArray[np.floating]], args: tuple[Hashable, ...], dtype: Any
) -> NDArray[np.floating]:
    values = make(*args).astype(dtype)
    values.setflags(write=False)
    return values
