"""lerobot_features: mapping of a recording's streams to the features of a LeRobotDataset.

| feature | shape | holds |
|---|---|---|
| ``observation.tactile.PAD`` | ``(3, rows, cols)`` | the pad's measured tensor |
| ``observation.simulated.PAD`` | ``(3, rows, cols)`` | the pad's simulated tensor |
| ``action`` | ``(n,)`` | the covariates ``action``, ``actions`` and ``action.NAME``, or the given ones |
| ``observation.state`` | ``(n,)`` | ``observation.state`` and ``observation.state.NAME``, or the given covariates; if \
there are neither, every other scalar or vector covariate except ``resultant`` |
| ``observation.NAME`` | its own, or ``(1,)`` | any other covariate |

All are float32. LeRobot does not allow ``/`` in a feature's name, so it is replaced by ``.``. The feature's ``info``,
which LeRobot preserves, records its origin: ``stream``, ``pad``, ``unit`` and ``layout``, or ``covariates``.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.logs.recording_arrays import RecordingArrays, unit_of
from paxisim.logs.schemas import COVARIATE, RESULTANT

PREFIXES = {"measured": "observation.tactile", "simulated": "observation.simulated"}
STATE = "observation.state"
ACTION = "action"
MAX_AXES = 5
"""Maximum number of axes of a frame in LeRobot."""
_OWN_NAMES = ("observation.", "next.")  # prefixes of LeRobot's own features, whose names stay as they are


@dataclass(frozen=True)
class Feature:
    """A feature of a LeRobotDataset.

    Attributes:
        name: Name in ``meta/info.json``.
        values: ``(T, *shape)``, or ``(T,)`` for the shape ``(1,)``.
        names: Names of its components or axes, if any.
        info: Further information as a JSON object.
    """

    name: str
    values: NDArray[Any]
    names: list[str] | None = None
    info: dict[str, Any] | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one frame."""
        return self.values.shape[1:] or (1,)


def features_of(recording: RecordingArrays, state: Sequence[str] = (), action: Sequence[str] = ()) -> list[Feature]:
    """Return the features of a recording, whose fields must have been checked.

    Args:
        recording: The recording.
        state: Names of the covariates that make up ``observation.state``, in this order; default: see above.
        action: Names of the covariates that make up ``action``, in this order; default: see above.

    Raises:
        InvalidValueError: Two features would have the same name, a covariate is given twice or has too many axes, or
            a value is infinite or too large for float32.
        UnknownNameError: A covariate does not exist.
    """
    covariates = recording.covariates
    for name in (*state, *action):
        if name not in covariates:
            raise UnknownNameError("covariate", name, covariates)
    acts = list(action) or [name for name in covariates if name in (ACTION, "actions") or _is_part(name, ACTION)]
    states = list(state) or _states(recording, acts)
    twice = sorted(name for name in covariates if (*acts, *states).count(name) > 1)
    if twice:
        raise InvalidValueError(f"the covariate {twice[0]!r} is named twice; name it only once in state or action")
    found = [*_tactile(recording)]
    found += [_vector(recording, name, parts) for name, parts in ((STATE, states), (ACTION, acts)) if parts]
    found += [_alone(recording, name) for name in covariates if name not in (*acts, *states)]
    names = [feature.name for feature in found]
    if len(set(names)) < len(names):
        double = next(name for name in names if names.count(name) > 1)
        raise InvalidValueError(f"two streams map to the feature {double!r} of the LeRobotDataset; rename one of them")
    return found


def _is_part(name: str, feature: str) -> bool:
    return name.startswith(f"{feature}.") and len(name) > len(feature) + 1


def _states(recording: RecordingArrays, acts: Iterable[str]) -> list[str]:
    own = [name for name in recording.covariates if name == STATE or _is_part(name, STATE)]
    return own or [
        name
        for name, values in recording.covariates.items()
        if values.ndim <= 2 and name not in (*acts, RESULTANT.removeprefix(COVARIATE)) and not _is_own(name)
    ]


def _is_own(name: str) -> bool:
    return name.startswith(_OWN_NAMES)


def _tactile(recording: RecordingArrays) -> Iterable[Feature]:
    assert recording.layout is not None
    about = {"unit": unit_of(recording.metadata), "layout": recording.layout.to_dict()}
    for stream, prefix in PREFIXES.items():
        tensor = getattr(recording, stream)
        if tensor is None:
            continue
        for i, pad in enumerate(recording.pads):
            name = _allowed(f"{prefix}.{pad}")
            info = {"stream": stream, "pad": pad, **about}
            yield Feature(name, _as_float32(name, tensor[:, i]), ["axis", "row", "column"], info)


def _vector(recording: RecordingArrays, feature: str, parts: Sequence[str]) -> Feature:
    """Stack covariates into one vector feature; its components are named as in `paxisim.logs.columns`."""
    arrays, names = [], []
    for part in parts:
        values = recording.covariates[part]
        arrays.append(values.reshape(len(values), -1))
        base = part.removeprefix(f"{feature}.")
        names += [base + ("." + "_".join(map(str, at)) if at else "") for at in np.ndindex(values.shape[1:])]
    if len(parts) == 1 and recording.covariates[parts[0]].ndim == 2:
        names = [str(i) for i in range(len(names))]
    values = np.concatenate(arrays, axis=1)
    return Feature(feature, _as_float32(feature, values), names, _info(recording, parts))


def _alone(recording: RecordingArrays, name: str) -> Feature:
    values = recording.covariates[name]
    if values.ndim - 1 > MAX_AXES:
        raise InvalidValueError(f"{name!r} has samples of {values.ndim - 1} axes, LeRobot allows at most {MAX_AXES}")
    feature = _allowed(name if _is_own(name) else f"observation.{name}")
    names = None
    if values.ndim <= 2:
        names = [name] if values.ndim == 1 else [str(i) for i in range(values.shape[1])]
    return Feature(feature, _as_float32(name, values), names, _info(recording, [name]))


def _info(recording: RecordingArrays, parts: Sequence[str]) -> dict[str, Any]:
    return {"covariates": [[part, list(recording.covariates[part].shape[1:])] for part in parts]}


def _allowed(name: str) -> str:
    return name.replace("/", ".")


def _as_float32(name: str, values: NDArray[Any]) -> NDArray[np.float32]:
    with np.errstate(over="ignore"):
        found = np.asarray(values, dtype=np.float32)
    if np.isinf(found).any():
        raise InvalidValueError(f"{name!r} holds a value that is infinite or too large for float32; use NaN instead")
    return found
