"""`GCS` and `Chain` as ``torch.nn.Module``, for augmentation on the device that holds the data.

Both work on float tensors ``(*batch, pads, 3, rows, cols)`` in newtons, on the input's device, without synchronising
with it.

| | in training mode | in eval mode |
|---|---|---|
| ``per="sample"`` | each call draws parameters for each sample | set by ``at_eval`` |
| ``per="episode"`` | parameters are kept until `resample` redraws them | set by ``at_eval`` |

Random numbers come from the default generator of the device, which ``torch.manual_seed`` seeds. Kept parameters move
with the module: in its ``state_dict``, its copies and pickles, and by ``to(device)``. ``torch.compile`` captures a call
in one graph; for layouts off the grid only with ``per="episode"``.

Example:
    ```python
    augment = paxisim.augment.torch.GCS(layout=layout, per="episode")
    while True:
        augment.resample(done)  # (environments,) booleans
        observation = augment(force)  # (environments, pads, 3, rows, cols)
    ```
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, Literal

from paxisim.augment import chain as chains
from paxisim.augment import gcs as paper
from paxisim.augment.gains import AxisGain, PadAxisGain, TaxelGain
from paxisim.augment.offset import Offset
from paxisim.augment.parameter_spec import parameters
from paxisim.augment.poisson import Poisson
from paxisim.errors import InvalidValueError, MissingExtraError, UnknownNameError
from paxisim.layout import TaxelLayout

try:
    import torch
    from torch import Tensor, nn
except ImportError as error:
    raise MissingExtraError("torch", "torch", "paxisim.augment.torch") from error


class Randomised(nn.Module):
    """Base of the modules: a chain whose parameters are redrawn for each sample or kept for an episode."""

    def __init__(self, per: Literal["sample", "episode"], at_eval: Literal["identity", "fixed"]) -> None:
        """See the subclasses.

        Raises:
            InvalidValueError: `per` or `at_eval` is not one of its options.
        """
        super().__init__()
        if per not in ("sample", "episode"):
            raise InvalidValueError(f"{type(self).__name__}: per must be 'sample' or 'episode', got {per!r}")
        if at_eval not in ("identity", "fixed"):
            raise InvalidValueError(f"{type(self).__name__}: at_eval must be 'identity' or 'fixed', got {at_eval!r}")
        self.per, self.at_eval = per, at_eval
        self._kept: chains.Chain | None = None
        self._drawn_in_eval = False

    def draw(self, batch_shape: tuple[int, ...], device: torch.device) -> chains.Chain:
        """Draw a chain with parameters for each element of a batch, on `device`, without keeping it."""
        raise NotImplementedError

    def _is_drawn(self, name: str) -> bool:
        return True

    @property
    def kept(self) -> chains.Chain | None:
        """Chain whose parameters are kept, or None."""
        return self._kept

    def resample(self, mask: Tensor | None = None) -> None:
        """Redraw the kept parameters, for example at the start of an episode.

        Args:
            mask: Boolean tensor of the batch's shape that selects the environments to redraw. Default: all, for the
                batch of the next call.
        """
        if mask is None:
            self._kept = None
        elif self._kept is None:
            self._kept = self.draw(tuple(mask.shape), mask.device)
        else:
            old = _tensors(self._kept)
            device = next(iter(old.values())).device if old else mask.device
            mask, new = mask.to(device), _tensors(self.draw(tuple(mask.shape), device))
            chosen = {name: _choose(mask, new[name], old[name]) for name in new if self._is_drawn(name)}
            self._kept = _with_tensors(self._kept, chosen)

    def forward(self, x: Tensor) -> Tensor:
        """Transform ``(*batch, pads, 3, rows, cols)`` newtons; the result has the same shape, dtype and device.

        Raises:
            InvalidValueError: As for a call of the chain; or the batch is not that of the kept parameters. Dimensions
                before it, such as time, are allowed.
        """
        if not self.training and self.at_eval == "identity":
            return x
        if self.per == "sample" and self.training:
            return self.draw(tuple(x.shape[:-4]), x.device)(x)
        return self._fixed(x)(x)

    def _fixed(self, x: Tensor) -> chains.Chain:
        if self._kept is None:  # in eval mode one draw for all, so that the size of a batch does not matter
            self._kept = self.draw(tuple(x.shape[:-4]) if self.training else (), x.device)
            self._drawn_in_eval = not self.training
        self._check_batch(tuple(x.shape[:-4]))
        return self._kept

    def _check_batch(self, given: tuple[int, ...]) -> None:
        """Refuse a batch that the kept parameters would widen, or do not fit."""
        kept = _batch_shape(self._kept) if self._kept is not None else ()
        if given[max(0, len(given) - len(kept)) :] != kept:
            what = f"{_count(given)} given" if given else "1 frame without a batch given"
            raise InvalidValueError(
                f"{type(self).__name__}: {_count(kept)} kept episodes, {what}: pass a batch of {_count(kept)}, call "
                "resample() to draw new parameters, or make a new module"
            )

    def train(self, mode: bool = True) -> Any:
        """Set training or eval mode; parameters that were drawn in eval mode are dropped for training."""
        if mode and self._drawn_in_eval:
            self._kept, self._drawn_in_eval = None, False
        return super().train(mode)

    def get_extra_state(self) -> dict[str, Tensor]:
        """Return the kept parameters for ``state_dict``: tensors by "member.parameter"."""
        return {} if self._kept is None else _tensors(self._kept)

    def set_extra_state(self, state: dict[str, Tensor]) -> None:
        """Restore the state that `get_extra_state` returned."""
        with torch.random.fork_rng(devices=[]):  # only the form of the chain is needed, not its numbers
            self._kept = _with_tensors(self.draw((), torch.device("cpu")), state) if state else None

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> Any:
        if self._kept is not None:
            self._kept = _with_tensors(self._kept, {name: fn(value) for name, value in _tensors(self._kept).items()})
        return super()._apply(fn, recurse)


class GCS(Randomised):
    """C and S of the paper's GCS (`paxisim.augment.gcs.GCS`), drawn for each sample or episode.

    Attributes:
        gcs: The GCS to draw from.
        layout: Layout of the pads' taxels.
        pads: Number of pads.
    """

    def __init__(
        self,
        gcs: paper.GCS | None = None,
        *,
        layout: TaxelLayout = paper.PAPER_LAYOUT,
        pads: int = 2,
        per: Literal["sample", "episode"] = "sample",
        at_eval: Literal["identity", "fixed"] = "identity",
    ) -> None:
        """Build the module.

        Args:
            gcs: The GCS to draw from. Default: the paper's.
            layout: Layout of the pads' taxels.
            pads: Number of pads.
            per: See the module docstring.
            at_eval: Behaviour in eval mode: ``"identity"`` returns the input unchanged, ``"fixed"`` applies the kept
                parameters; if there are none, it draws one set for all samples and keeps it.
        """
        super().__init__(per, at_eval)
        self.gcs = paper.GCS() if gcs is None else gcs
        self.layout, self.pads = layout, pads
        self._taxels = (pads, layout.rows, layout.cols)
        self._positions = None if layout.is_grid else layout
        for kind in (Poisson, AxisGain, PadAxisGain, TaxelGain, Offset):
            parameters(kind)  # cached, because torch.compile cannot trace dataclasses.fields

    def draw(self, batch_shape: tuple[int, ...], device: torch.device) -> chains.Chain:
        """See `Randomised.draw`."""
        return self.gcs.sample_taxels(device, batch_shape, self._taxels, self._positions)


class Chain(Randomised):
    """A chain with some parameters drawn for each sample or episode; the others are fixed.

    Attributes:
        chain: The chain, without memory, that is applied in eval mode.
        intervals: Bounds of the uniform distributions by "member.parameter".
    """

    def __init__(
        self,
        chain: chains.Chain,
        intervals: Mapping[str, tuple[float, float]] | None = None,
        *,
        per: Literal["sample", "episode"] = "sample",
        at_eval: Literal["identity", "fixed"] = "fixed",
    ) -> None:
        """Build the module.

        Args:
            chain: Transforms without memory.
            intervals: Bounds of the drawn parameters, e.g. ``{"poisson.cx": (0.1, 0.3)}``. A drawn parameter keeps the
                shape of its core dimensions and gets leading batch dimensions. Default: nothing is drawn.
            per: See the module docstring.
            at_eval: Behaviour in eval mode: ``"identity"`` returns the input unchanged, ``"fixed"`` applies `chain`
                without drawing.

        Raises:
            InvalidValueError: The chain has memory, or bounds are not in order.
            UnknownNameError: There is no such member or parameter.
        """
        super().__init__(per, at_eval)
        if chain.has_memory:
            raise InvalidValueError("Chain: a module has no memory: use step(...) or run(...) of the chain itself")
        self.intervals = dict(intervals or {})
        for name, (low, high) in self.intervals.items():
            member, _, parameter = name.partition(".")
            if parameter not in parameters(chain[member]):
                raise UnknownNameError(f"parameter of {member}", parameter, parameters(chain[member]))
            if not low <= high:
                raise InvalidValueError(f"Chain: the bounds of {name} must be in order, got {(low, high)}")
        values = {n: torch.as_tensor(v, dtype=torch.float32) for n, v in _values(chain).items()}
        self.chain = _with_tensors(chain, values)

    def draw(self, batch_shape: tuple[int, ...], device: torch.device) -> chains.Chain:
        """See `Randomised.draw`."""
        drawn = {}
        for name, (low, high) in self.intervals.items():
            member, _, parameter = name.partition(".")
            core = len(parameters(self.chain[member])[parameter].core)
            value = getattr(self.chain[member], parameter)
            shape = (*batch_shape, *value.shape[value.ndim - core :])
            drawn[name] = low + (high - low) * torch.rand(shape, device=device)
        return _with_tensors(self.chain, drawn) if drawn else self.chain

    def _is_drawn(self, name: str) -> bool:
        return name in self.intervals

    def _fixed(self, x: Tensor) -> chains.Chain:
        return super()._fixed(x) if self.training else self.chain

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> Any:
        self.chain = _with_tensors(self.chain, {name: fn(value) for name, value in _tensors(self.chain).items()})
        return super()._apply(fn, recurse)

    def get_extra_state(self) -> dict[str, Any]:
        """Return the chain's parameters and the kept parameters for ``state_dict``."""
        return {"chain": _tensors(self.chain), "kept": super().get_extra_state()}

    def set_extra_state(self, state: dict[str, Any]) -> None:
        """Restore the state that `get_extra_state` returned."""
        self.chain = _with_tensors(self.chain, state["chain"])
        super().set_extra_state(state["kept"])


def _values(chain: chains.Chain) -> dict[str, Any]:
    """Return the parameters by "member.parameter"."""
    pairs = zip(chain.names, chain.members, strict=True)
    return {f"{name}.{p}": getattr(member, p) for name, member in pairs for p in parameters(member)}


def _batch_shape(chain: chains.Chain) -> tuple[int, ...]:
    """Return the batch dimensions of the parameters; all that were drawn have the same."""
    found: tuple[int, ...] = ()
    for member in chain.members:
        for name, about in parameters(member).items():
            value = getattr(member, name)
            if isinstance(value, Tensor) and value.ndim - len(about.core) > len(found):
                found = tuple(value.shape[: value.ndim - len(about.core)])
    return found


def _count(batch: tuple[int, ...]) -> str:
    return str(batch[0] if len(batch) == 1 else batch)


def _tensors(chain: chains.Chain) -> dict[str, Tensor]:
    return {name: value for name, value in _values(chain).items() if isinstance(value, Tensor)}


def _with_tensors(chain: chains.Chain, tensors: Mapping[str, Any]) -> chains.Chain:
    by_member: dict[str, dict[str, Any]] = {}
    for name, value in tensors.items():
        member, _, parameter = name.partition(".")
        by_member.setdefault(member, {})[parameter] = value
    return chain.replace(**{name: dataclasses.replace(chain[name], **new) for name, new in by_member.items()})


def _choose(mask: Tensor, new: Tensor, old: Tensor) -> Tensor:
    if new.shape != old.shape:
        raise InvalidValueError(
            f"expected a mask of the batch's shape: the kept parameters have shape {tuple(old.shape)}, but the mask "
            f"draws {tuple(new.shape)}"
        )
    return torch.where(mask.reshape(*mask.shape, *[1] * (old.ndim - mask.ndim)), new, old)
