"""Loads: the covariates that hold the components of the load, and how well the data excite them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.recording import Recording

COMPONENTS = ("Fx", "Fy", "Fz", "Tx", "Ty", "Tz")
"""Components of a load: forces (N) and torques (N m)."""
MAX_LOADS = len(COMPONENTS)
MIN_LOAD_SNR = 2.0
"""Minimum standard deviation of an excited load, in units of its noise."""
MIN_LOAD_SHARE = 0.01
"""Minimum standard deviation of an excited load, as a share of the largest of its kind (forces or torques)."""
MIN_UNEXPLAINED_SHARE = 0.05
"""Minimum share of a separable load's standard deviation that the other loads do not explain."""


@dataclass(frozen=True)
class Load:
    """A component of the load and the covariate that holds it.

    Attributes:
        name: Name of the component; ``"Tx"``, ``"Ty"`` and ``"Tz"`` are torques, all others forces.
        covariate: Name of the covariate.
        index: Column in a covariate with several values per sample; None if the covariate has one.
    """

    name: str
    covariate: str
    index: int | None = None

    @property
    def is_torque(self) -> bool:
        """Whether it is a torque."""
        return self.name in COMPONENTS[3:]

    @property
    def unit(self) -> str:
        """Unit of the component, ``"N"`` or ``"N m"``."""
        return "N m" if self.is_torque else "N"


@dataclass(frozen=True, eq=False)
class Excitation:
    """How well a recording excites each load.

    Attributes:
        spread: ``(loads,)`` standard deviation (N, N m).
        alone: ``(loads,)`` share of `spread` that a linear combination of the other loads does not explain, 0 to 1.
        excited: ``(loads,)`` whether the load varies enough to fit its gain.
        separable: ``(loads,)`` whether the load also varies enough independently of the others to separate its gain.
    """

    spread: NDArray[np.float64]
    alone: NDArray[np.float64]
    excited: NDArray[np.bool_]
    separable: NDArray[np.bool_]


def find_loads(recording: Recording, loads: str | Sequence[str] | Mapping[str, str]) -> tuple[Load, ...]:
    """Return the load components that `loads` names; see `paxisim.calibrate_readout`.

    Raises:
        UnknownNameError: There is no such covariate or component.
        InvalidValueError: There is no load, more than six or a duplicate, or a covariate has an unsupported width.
    """
    if isinstance(loads, Mapping):
        given = list(loads.items())
        for component, _ in given:
            if component not in COMPONENTS:
                raise UnknownNameError("load component", component, COMPONENTS)
    else:
        given = [(_component(name), name) for name in ([loads] if isinstance(loads, str) else loads)]
    found: list[Load] = []
    for name, covariate in given:
        if covariate not in recording.covariates:
            raise UnknownNameError("covariate", covariate, recording.covariates)
        shape = recording.covariates[covariate].shape[1:]
        if shape == ():
            found.append(Load(name, covariate))
        elif shape in ((3,), (6,)) and not isinstance(loads, Mapping):
            found += [Load(component, covariate, i) for i, component in enumerate(COMPONENTS[: shape[0]])]
        else:
            raise InvalidValueError(
                f"a load must have a single value per sample, or 3 or 6 in the order {' '.join(COMPONENTS)}, but "
                f"{covariate!r} has shape {(len(recording), *shape)}"
            )
    names = [load.name for load in found]
    if not 1 <= len(names) <= MAX_LOADS or len(set(names)) < len(names):
        raise InvalidValueError(f"a readout takes one to {MAX_LOADS} different loads, got {names}")
    return tuple(found)


def _component(name: str) -> str:
    """Return the component for a name in any case, e.g. ``"Fx"`` for ``"fx"``; other names are unchanged."""
    return next((component for component in COMPONENTS if component.lower() == name.lower()), name)


def values_of(recording: Recording, loads: Sequence[Load]) -> NDArray[np.float64]:
    """Return the values of the loads in a recording, ``(T, loads)``.

    Raises:
        UnknownNameError: The recording lacks a covariate.
        InvalidValueError: A covariate has a different width than in the calibration.
    """
    columns = []
    for load in loads:
        if load.covariate not in recording.covariates:
            raise UnknownNameError("covariate", load.covariate, recording.covariates)
        values = recording.covariates[load.covariate]
        fits = values.ndim == 1 if load.index is None else values.ndim == 2 and load.index < values.shape[1]
        if not fits:
            raise InvalidValueError(
                f"the readout takes {load.name} from {load.covariate!r}"
                f"{'' if load.index is None else f', column {load.index}'}, but it has shape {values.shape}"
            )
        columns.append(values if load.index is None else values[:, load.index])
    return np.stack(columns, axis=1)


def excitation_of(loads: Sequence[Load], values: NDArray[np.float64]) -> Excitation:
    """Return how well known values ``(T, loads)`` excite each load."""
    spread = values.std(axis=0)
    noise = noise_of(values)
    torque = np.array([load.is_torque for load in loads])
    largest = np.array([spread[torque == kind].max() for kind in torque])
    varies = (spread > 0) & (spread >= MIN_LOAD_SHARE * largest)
    excited = varies & (spread >= MIN_LOAD_SNR * noise)
    if not excited.any():  # sampled too slowly to separate the noise from the signal
        excited, noise = varies, np.zeros(len(loads))
    alone = np.zeros(len(loads))
    for k in np.flatnonzero(excited):
        others = np.delete(np.arange(len(loads)), k)
        others = others[excited[others]]
        x = np.column_stack([np.ones(len(values)), values[:, others] / spread[others]])
        rest = values[:, k] - x @ np.linalg.lstsq(x, values[:, k], rcond=None)[0]
        alone[k] = rest.std() / spread[k]
    separable = excited & (alone >= MIN_UNEXPLAINED_SHARE) & (alone * spread >= MIN_LOAD_SNR * noise)
    return Excitation(spread, alone, excited, separable)


def noise_of(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation of the noise of each column of ``(T, ...)`` values, whatever moves them slowly.

    It is taken from the second differences of the known samples; a few large ones do not count.
    """
    second = np.diff(values, 2, axis=0)
    second = second[np.isfinite(second).all(axis=tuple(range(1, second.ndim)))]
    return 1.4826 * np.median(np.abs(second), axis=0) / np.sqrt(6) if len(second) else np.zeros(values.shape[1:])
