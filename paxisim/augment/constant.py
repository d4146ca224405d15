"""constant: arrays that numpy computes once, as constants of the kind, dtype and device that are needed."""

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
    """``make(*args)`` as a read-only array of the kind, dtype and device of `x`.

    It is computed and sent to a device once, and is a constant for ``torch.compile``.

    Args:
        make: A function defined in a module, which returns float64.
        args: Its arguments, plain values; a layout as the text of `layout_text`, as ``torch.compile`` knows no others.
        x: numpy or torch.
    """
    if is_torch(x):
        from paxisim.augment.torch_constant import torch_constant

        return torch_constant(make, args, x.dtype, x.device)
    return _numpy_constant(make, args, x.dtype)


def layout_text(layout: TaxelLayout) -> str:
    """A layout as text, from which `read_layout` makes it again bit for bit."""
    return json.dumps(layout.to_dict())


def read_layout(text: str) -> TaxelLayout:
    """The layout of `layout_text`."""
    return TaxelLayout.from_dict(json.loads(text))


@lru_cache(maxsize=128)
def _numpy_constant(
    make: Callable[..., NDArray[np.floating]], args: tuple[Hashable, ...], dtype: Any
) -> NDArray[np.floating]:
    values = make(*args).astype(dtype)
    values.setflags(write=False)
    return values
