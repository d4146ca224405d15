"""Chains for batches: drawn one by one and combined, and moved to a device."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
import torch

import paxisim


def stack_chains(chains: Sequence[paxisim.Chain]) -> paxisim.Chain:
    """Combine chains that differ only in drawn parameters into one for a batch."""
    members = []
    for alike in zip(*(chain.members for chain in chains), strict=True):
        if isinstance(alike[0], paxisim.Chain):
            members.append(stack_chains(alike))
            continue
        values = {item.name: [getattr(member, item.name) for member in alike] for item in fields(alike[0])}
        drawn = {
            name: np.stack(own)
            for name, own in values.items()
            if all(isinstance(value, (np.ndarray, np.generic)) for value in own)
            and any(np.any(value != own[0]) for value in own)
        }
        members.append(replace(alike[0], **drawn))
    return paxisim.Chain(members, chains[0].names)


def merge_chains(mask: Any, new: paxisim.Chain, old: paxisim.Chain) -> paxisim.Chain:
    """Return a batched chain with the parameters of `new` where the mask ``(batch,)`` is true, else those of `old`.

    Both differ only in their parameters, which are tensors.
    """
    members = []
    one: Any  # dataclasses
    other: Any
    for one, other in zip(new.members, old.members, strict=True):
        if isinstance(one, paxisim.Chain):
            members.append(merge_chains(mask, one, other))
            continue
        own = {item.name: (getattr(one, item.name), getattr(other, item.name)) for item in fields(one)}
        drawn = {name: choose(mask, *both) for name, both in own.items() if isinstance(both[0], torch.Tensor)}
        members.append(replace(one, **drawn))
    return paxisim.Chain(members, new.names)


def choose(mask: Any, new: Any, old: Any) -> Any:
    """Return rows of `new` where the mask ``(batch,)`` is true, else those of `old`, in tensors or nested tuples."""
    if isinstance(new, tuple):
        return tuple(choose(mask, *both) for both in zip(new, old, strict=True))
    if not isinstance(new, torch.Tensor) or new.shape[:1] != mask.shape:
        return new  # the same for the whole batch
    return torch.where(mask.reshape(-1, *[1] * (new.ndim - 1)), new, old)


def convert_chain(chain: paxisim.Chain, convert: Callable[[Any], Any]) -> paxisim.Chain:
    """Return a chain with its array parameters converted, for example to tensors on a device."""
    members = []
    member: Any  # a dataclass
    for member in chain.members:
        if isinstance(member, paxisim.Chain):
            members.append(convert_chain(member, convert))
            continue
        own = {item.name: getattr(member, item.name) for item in fields(member)}
        arrays = {name: convert(value) for name, value in own.items() if isinstance(value, (np.ndarray, np.generic))}
        members.append(replace(member, **arrays))
    return paxisim.Chain(members, chain.names)
