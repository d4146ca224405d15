"""Chain: a sequence of transforms applied as one transform, and its JSON format."""

from __future__ import annotations

import dataclasses
import importlib
import itertools
import math
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from paxisim.augment.parameter_spec import is_torch
from paxisim.augment.transform import STAGES, Covariates, State, Transform
from paxisim.document import DocumentFile
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.layout import TaxelLayout


@dataclass(frozen=True, eq=False)
class Chain(DocumentFile, Transform):
    """Transforms applied in order. A chain is itself a transform, with memory if any member has memory.

    Access members by position, slice (which gives a chain) or name: ``chain[0]``, ``chain[1:]``, ``chain["poisson"]``.
    An unphysical order, such as electronics before gel, raises a warning, not an error.

    Attributes:
        members: The transforms.
        names: Names of the members. Default: their class names in snake case, numbered where they repeat.

    Raises:
        InvalidValueError: A member is not a transform, names are not unique, or their number differs from that of the
            members.
    """

    members: tuple[Transform, ...] = ()
    names: tuple[str, ...] = ()

    FORMAT = "paxisim-chain/1"
    ENTRIES = ("members",)

    def __init__(self, members: Iterable[Transform] = (), names: Iterable[str] = ()) -> None:
        """Check the members and name them."""
        members, names = tuple(members), tuple(names)
        for member in members:
            if not isinstance(member, Transform):
                raise InvalidValueError(f"Chain: members must be transforms, got {member!r}")
        names = names or _default_names(members)
        if len(names) != len(members) or len(set(names)) != len(names):
            raise InvalidValueError(f"Chain: expected {len(members)} unique names, got {names}")
        object.__setattr__(self, "members", members)
        object.__setattr__(self, "names", names)
        _warn_of_order(members)

    @property
    def has_memory(self) -> bool:  # type: ignore[override]
        """Whether any member remembers earlier frames."""
        return any(member.has_memory for member in self.members)

    @property
    def flattened(self) -> tuple[Transform, ...]:
        """See `Transform.flattened`."""
        return tuple(one for member in self.members for one in member.flattened)

    @property
    def covariate_names(self) -> tuple[str, ...]:
        """Names of the covariates that the members need."""
        return tuple(dict.fromkeys(name for member in self.members for name in member.covariate_names))

    def __len__(self) -> int:
        """Number of members."""
        return len(self.members)

    def __iter__(self) -> Iterator[Transform]:
        """Iterate over the members in order."""
        return iter(self.members)

    def __getitem__(self, which: int | slice | str) -> Any:
        """Return a member by position or name, or a chain of several members by slice.

        Raises:
            UnknownNameError: No member has that name.
        """
        if isinstance(which, slice):
            return Chain(self.members[which], self.names[which])
        if isinstance(which, str):
            if which not in self.names:
                raise UnknownNameError("member of the chain", which, self.names)
            which = self.names.index(which)
        return self.members[which]

    def replace(self, **members: Transform) -> Chain:
        """Return the chain with the named members replaced.

        Raises:
            UnknownNameError: No member has that name.
        """
        for name in members:
            self[name]
        return Chain([members.get(n, m) for n, m in zip(self.names, self.members, strict=True)], self.names)

    def apply(self, x: Any, covariates: Covariates) -> Any:
        """See `Transform.apply`."""
        for member in self.members:
            x = member(x, covariates)
        return x

    def initial_state(self, x: Any, covariates: Covariates | None = None) -> State:
        """Return the states of the members, one tuple each."""
        states = []
        for member in self.members:
            state = member.initial_state(x, covariates)
            states.append(state)
            x, _ = member.step(x, state, 0.0, covariates)
        return tuple(states)

    def step(self, x: Any, state: State, dt: Any, covariates: Covariates | None = None) -> tuple[Any, State]:
        """See `Transform.step`."""
        states = []
        for member, old in zip(self.members, state, strict=True):
            x, new = member.step(x, old, dt, covariates)
            states.append(new)
        return x, tuple(states)

    def run(self, x: Any, time: Any, covariates: Covariates | None = None) -> Any:
        """See `Transform.run`."""
        for member in self.members:
            x = member.run(x, time, covariates)
        return x

    def reset(self, state: State, mask: Any, x: Any, covariates: Covariates | None = None) -> State:
        """See `Transform.reset`."""
        states = []
        for member, old in zip(self.members, state, strict=True):
            states.append(member.reset(old, mask, x, covariates))
            x, _ = member.step(x, member.initial_state(x, covariates), 0.0, covariates)
        return tuple(states)

    def _entries(self) -> dict[str, Any]:
        """Return the members. Torch tensors become numpy arrays, and bfloat16, which numpy lacks, float32."""
        return {"members": [_encode(member, name) for name, member in zip(self.names, self.members, strict=True)]}

    @classmethod
    def _from_entries(cls, entries: dict[str, Any]) -> Chain:
        members = entries["members"]
        if not isinstance(members, list):
            raise InvalidValueError(f"Chain: expected a list of 'members' in the JSON, got {members!r:.40}")
        return cls([_decode(member) for member in members], [member["name"] for member in members])


def _default_names(members: tuple[Transform, ...]) -> tuple[str, ...]:
    names: list[str] = []
    for member in members:
        name = re.sub(r"(?<!^)(?=[A-Z])", "_", member.name).lower()
        count = sum(isinstance(other, type(member)) for other in members[: len(names)])
        names.append(f"{name}_{count + 1}" if count else name)
    return tuple(names)


def _warn_of_order(members: tuple[Transform, ...]) -> None:
    ranked = [(STAGES.index(member.stage), member.name) for member in members if not isinstance(member, Chain)]
    for (before, first), (after, second) in itertools.pairwise(ranked):
        if after < before:
            warnings.warn(
                f"Chain: {second} ({STAGES[after]}) comes after {first} ({STAGES[before]}); in a sensor the order is "
                "reversed",
                stacklevel=4,
            )


def _encode(member: Transform, name: str) -> dict[str, Any]:
    if isinstance(member, Chain):
        return {"name": name, "type": "Chain", "chain": member.to_document()}
    values = {f.name: _encode_value(getattr(member, f.name)) for f in dataclasses.fields(member)}  # type: ignore[arg-type]
    return {"name": name, "type": member.name, "parameters": values}


def _encode_value(value: Any) -> Any:
    if isinstance(value, TaxelLayout):
        return {"layout": value.to_dict()}
    if is_torch(value):
        value = value.detach().cpu()
        value = (value.float() if str(value.dtype) == "torch.bfloat16" else value).numpy()
    if isinstance(value, (np.ndarray, np.generic)):
        value = np.asarray(value)
        data = [_encode_number(number) for number in value.reshape(-1).tolist()]
        return {"dtype": str(value.dtype), "shape": list(value.shape), "data": data}
    if isinstance(value, (tuple, list)):
        return [_encode_value(item) for item in value]
    number = _encode_number(value)
    return value if number is value else {"number": number}


def _encode_number(value: Any) -> Any:
    """Return infinity as text, because JSON has no such number; other values unchanged."""
    return str(value) if isinstance(value, float) and math.isinf(value) else value


def _decode(document: Mapping[str, Any]) -> Transform:
    kind = document["type"]
    if kind == "Chain":
        return Chain.from_document(document["chain"])
    known = _known_transforms()
    if kind not in known:
        advice = f"if {kind} is a transform of your own, import the module that defines it first"
        raise UnknownNameError("transform", kind, known, advice)
    values = {name: _decode_value(value) for name, value in document["parameters"].items()}
    fields = [f.name for f in dataclasses.fields(known[kind])]  # type: ignore[arg-type]
    for name in values:
        if name not in fields:
            raise UnknownNameError(f"parameter of {kind}", name, fields)
    missing = [name for name in fields if name not in values]
    if missing:  # a default would silently describe another sensor
        raise InvalidValueError(f"Chain: the member {document['name']!r} ({kind}) of the JSON lacks {missing[0]!r}")
    return known[kind](**values)


def _decode_value(value: Any) -> Any:
    if isinstance(value, dict) and "layout" in value:
        try:
            return TaxelLayout.from_dict(value["layout"])
        except InvalidValueError as error:
            raise InvalidValueError(f"Chain: a member of the JSON lacks or misuses 'layout': {error}") from error
    if isinstance(value, dict) and "number" in value:
        return float(value["number"])
    if isinstance(value, dict):
        return np.array(value["data"], dtype=value["dtype"]).reshape(value["shape"])
    if isinstance(value, list):
        return tuple(_decode_value(item) for item in value)
    return value


def _known_transforms() -> dict[str, type[Transform]]:
    """All transforms by class name: those of paxisim and those that users derived from `Transform`."""
    package = importlib.import_module("paxisim.augment")
    for name in package.__all__:  # subclasses are known only once their module is imported
        getattr(package, name)
    found: dict[str, type[Transform]] = {}
    waiting = [Transform]
    while waiting:
        for kind in waiting.pop().__subclasses__():
            found[kind.__name__] = kind
            waiting.append(kind)
    return found
