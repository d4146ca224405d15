"""Parameters of transforms: their metadata, valid values and alignment with the tensor.

Shape convention: a parameter has leading batch dimensions, which broadcast against those of the tensor, followed by
its own core dimensions, a subset of pads, axis, rows, cols in this order. A gain per axis has core "k" and hence shape
``(..., 3)``; a scalar parameter for each of 4096 environments has shape ``(4096,)``. A plain number applies to all
elements.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from dataclasses import dataclass
from typing import Any

import array_api_compat.numpy as numpy_namespace
import numpy as np
from array_api_compat import array_namespace, is_array_api_obj

from paxisim.errors import InvalidValueError

AXES = "pkrc"
"""Last four dimensions of the tensor: pads, axis (k), rows, cols."""


def is_torch(value: Any) -> bool:
    """Whether `value` is a torch tensor; never imports torch."""
    torch = sys.modules.get("torch")
    return torch is not None and isinstance(value, torch.Tensor)


def namespace(x: Any) -> Any:
    """Return the array API namespace of `x`, in a way that ``torch.compile`` can trace without warnings."""
    if type(x) is np.ndarray:  # fast path: array_namespace would dominate the cost of a small frame
        return numpy_namespace
    if is_torch(x):
        import array_api_compat.torch as torch_namespace

        return torch_namespace
    return array_namespace(x)


def is_floating(x: Any) -> bool:
    """Whether `x` holds real floating point numbers."""
    if type(x) is np.ndarray:
        return x.dtype.kind == "f"
    return x.dtype.is_floating_point if is_torch(x) else namespace(x).isdtype(x.dtype, "real floating")


@dataclass(frozen=True)
class Parameter:
    """Metadata of one parameter of a transform.

    Attributes:
        core: Core dimensions, a subsequence of `AXES`; each may also have length 1. A "j" after "k" is the axis of the
            input, for a parameter that maps axes to axes; such a parameter cannot be lifted. A leading "m" is a
            dimension of the transform, not of the tensor, e.g. the modes of a sum.
        unit: SI unit, "1" for a dimensionless number.
        low: Smallest physical value.
        high: Largest physical value.
        typical: Plausible range for random draws.
        infinite: Whether it may be infinite, e.g. for a limit that does not apply.
        whole: Whether only whole numbers are valid.
        seeds: Name of the parameter that scales the random numbers that this one seeds; `GCS.around` draws the seed.
    """

    core: str = ""
    unit: str = "1"
    low: float = -math.inf
    high: float = math.inf
    typical: tuple[float, float] | None = None
    infinite: bool = False
    whole: bool = False
    seeds: str = ""


def parameter(neutral: Any, core: str = "", unit: str = "1", **about: Any) -> Any:
    """Create a dataclass field for a parameter whose default leaves the tensor unchanged.

    Args:
        neutral: Default value.
        core: See `Parameter`.
        unit: See `Parameter`.
        **about: Other attributes of `Parameter`.
    """
    return dataclasses.field(default=neutral, metadata={"parameter": Parameter(core, unit, **about)})


def parameters(transform: Any) -> dict[str, Parameter]:
    """Return the parameters of a transform or transform class, by field name."""
    kind = transform if isinstance(transform, type) else type(transform)
    if kind not in _PARAMETERS:
        _PARAMETERS[kind] = {
            f.name: f.metadata["parameter"] for f in dataclasses.fields(kind) if "parameter" in f.metadata
        }
    return _PARAMETERS[kind]


_PARAMETERS: dict[type, dict[str, Parameter]] = {}  # cached by class, because dataclasses.fields is slow


def check(owner: str, name: str, value: Any, about: Parameter) -> None:
    """Raise unless `value` is valid for this parameter.

    The values of torch tensors on an accelerator, or traced by ``torch.compile`` or ``vmap``, are not checked, because
    reading them would wait for the device.

    Raises:
        InvalidValueError: The values are not real numbers, not finite or outside the physical range, or have too few
            dimensions.
    """
    what = f"{owner}: {name}"
    try:
        value = _as_array(value)
    except ValueError:  # a ragged list
        raise InvalidValueError(f"{what} must have shape {_expected(about)}, got {value!r}") from None
    if isinstance(value, np.ndarray) and value.dtype.kind not in "fiub":
        raise InvalidValueError(f"{what} must be real numbers, got {value.dtype}")
    if value.ndim < len(about.core):
        raise InvalidValueError(f"{what} must have shape {_expected(about)}, got {tuple(value.shape)}")
    for axis in set(about.core) & {"k", "j"}:
        length = value.shape[value.ndim - len(about.core) + about.core.index(axis)]
        if length != 3 and (length != 1 or "j" in about.core):
            raise InvalidValueError(f"{what} must have shape {_expected(about)}, got {tuple(value.shape)}")
    if not can_look(value) or not math.prod(value.shape):
        return
    xp = namespace(value)
    numbers = xp.astype(value.detach() if is_torch(value) else value, xp.float64)  # type: ignore[attr-defined]
    least, most = float(xp.min(numbers)), float(xp.max(numbers))  # both are nan if any number is
    if math.isnan(least) or not (about.infinite or (math.isfinite(least) and math.isfinite(most))):
        raise InvalidValueError(f"{what} must be finite" if not about.infinite else f"{what} must be a number, got nan")
    if about.whole and not bool(xp.all(numbers == xp.round(numbers))):
        raise InvalidValueError(f"{what} must be whole numbers")
    outside = least < about.low or most > about.high
    if outside and is_floating(value):  # a bound such as pi is rounded in the value's dtype
        outside = least < float(as_like(about.low, value)) or most > float(as_like(about.high, value))
    if outside:
        came = f"{least:g}" if least == most else f"{least:g} to {most:g}"
        raise InvalidValueError(f"{what} must lie in [{about.low:g}, {about.high:g}] {about.unit}, got {came}")


def lift(value: Any, core: str, x: Any) -> Any:
    """Return a parameter as an array that broadcasts against `x`, with its array library, dtype and device.

    Args:
        value: Parameter, ``(*batch, *core)``.
        core: Core dimensions of the parameter.
        x: Tensor, ``(*batch, pads, 3, rows, cols)``.

    Returns:
        ``(*batch, pads or 1, 3 or 1, rows or 1, cols or 1)``, with a core dimension "m" between batch and pads.
    """
    array = as_like(value, x)
    core = core.removeprefix("m")
    batch = array.ndim - len(core)
    lengths = [1, 1, 1, 1]
    for position, axis in enumerate(core):
        lengths[AXES.index(axis)] = array.shape[batch + position]
    return array.reshape((*array.shape[:batch], *lengths))


def as_like(value: Any, x: Any) -> Any:
    """Return `value` as an array with the array library, dtype and device of `x`; gradients pass through."""
    if is_torch(value) and is_torch(x):
        return value.to(device=x.device, dtype=x.dtype)
    if type(x) is np.ndarray:
        return np.asarray(value, dtype=x.dtype)
    return namespace(x).asarray(value, dtype=x.dtype, device=x.device if is_torch(x) else None)


def _as_array(value: Any) -> Any:
    return value if is_torch(value) or is_array_api_obj(value) else np.asarray(value)


def _expected(about: Parameter) -> str:
    lengths = {"m": "modes", "p": "pads", "k": "3", "j": "3", "r": "rows", "c": "cols"}
    return "(" + ", ".join(["...", *(lengths[axis] for axis in about.core)]) + ")"


def can_look(value: Any) -> bool:
    """Whether a value can be read without waiting for a device or breaking a trace."""
    if not is_torch(value):
        return True
    import torch

    traced = torch.compiler.is_compiling() or torch._C._functorch.is_functorch_wrapped_tensor(value)  # type: ignore[attr-defined]
    return not traced and value.device.type == "cpu"
