"""Modes: an extra dimension M of a transform, between batch and pads, that the transform sums over."""

from __future__ import annotations

from typing import Any

import numpy as np

from paxisim.augment.parameter_spec import as_like, namespace
from paxisim.augment.transform import Transform
from paxisim.errors import InvalidValueError


def check_modes(transform: Transform, *names: str) -> int:
    """Return the number of modes of the parameters `names`, each ``(..., M)`` or ``(..., 1)``.

    Raises:
        InvalidValueError: The parameters have different numbers of modes, or none.
    """
    lengths = {name: np.shape(getattr(transform, name))[-1] for name in names}
    modes = set(lengths.values()) - {1}
    if len(modes) > 1 or 0 in modes:
        came = ", ".join(f"{length} in {name}" for name, length in lengths.items())
        raise InvalidValueError(f"{transform.name}: parameters must have the same number of modes, got {came}")
    return max(lengths.values())


def each_mode(x: Any) -> Any:
    """Reshape ``(*batch, pads, 3, rows, cols)`` to ``(*batch, 1, pads, 3, rows, cols)``."""
    return x[..., None, :, :, :, :]


def over_modes(transform: Transform, x: Any, *names: str) -> Any:
    """Repeat a frame for each mode of the parameters `names`: ``(*batch, M, pads, 3, rows, cols)``."""
    modes = max(as_like(getattr(transform, name), x).shape[-1] for name in names)
    return namespace(x).broadcast_to(each_mode(x), (*x.shape[:-4], modes, *x.shape[-4:]))
