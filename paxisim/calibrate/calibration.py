"""Calibration: a sensor model fitted to a recording with a load cell, saved to a file and applied live."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from paxisim.calibrate.background import Background, check_sensor
from paxisim.calibrate.fit import calibrate_readout
from paxisim.calibrate.linear import LinearCalibration
from paxisim.calibrate.load_model import Kind, LoadModel, fit_load_model
from paxisim.calibrate.loads import COMPONENTS, MAX_LOADS, Excitation, Load
from paxisim.document import DocumentFile, finite
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.recording import Recording

_FORCES = COMPONENTS[:3]
_OPEN = (-math.inf, math.inf)  # ends of an interval that the file leaves empty


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(DocumentFile):
    """Calibration of a sensor whose channels are not in newtons, created by `calibrate_sensor`.

    Attributes:
        readout: Estimate of the load from each channel separately.
        model: Estimate of the load from all channels together.
        profile: Name of the profile that the sensor was recorded with; empty if the recording does not contain it.
        background: Background that is subtracted from the channels first; None without one.
    """

    readout: LinearCalibration
    model: LoadModel
    profile: str = ""
    background: Background | None = None

    FORMAT = "paxisim-calibration/1"
    ENTRIES = ("profile", "readout", "model", "background")

    @property
    def covariates(self) -> tuple[str, ...]:
        """Names of the covariates that the background depends on."""
        return () if self.background is None else self.background.covariates

    @property
    def unit(self) -> str:
        """Unit of the converted frames: newtons."""
        return "N"

    def read(
        self, channels: NDArray[np.floating], covariates: Mapping[str, ArrayLike]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32] | None]:
        """Convert the channels of one moment, after subtraction of the background if there is one.

        Args:
            channels: ``(pads, 3, rows, cols)`` channels.
            covariates: Present values of `covariates`.

        Returns:
            The results of `to_force` and `total_force`.

        Raises:
            UnknownNameError: A covariate is missing.
            InvalidValueError: A covariate has another number of values.
        """
        if self.background is not None:
            channels, _ = self.background.read(channels, covariates)
        return self.to_force(channels), self.total_force(channels)

    def to_force(self, channels: NDArray[np.floating]) -> NDArray[np.float32]:
        """Convert ``(..., pads, 3, rows, cols)`` channels to newtons; see `LinearCalibration.to_force`."""
        return self.readout.to_force(channels).astype(np.float32)

    def total_force(self, channels: NDArray[np.floating]) -> NDArray[np.float32] | None:
        """Convert ``(1, 3, rows, cols)`` channels of a single pad to its total force.

        Returns:
            ``(1, 3)`` force (N); a load cell with a single axis gives z. NaN for components that were not calibrated.
            None for several pads, because the loads are those of all pads together, and if only torques were
            calibrated.
        """
        if len(channels) != 1 or not self._forces:
            return None
        return self._as_force(self.model(channels), np.nan)[None]

    def apply_total(self, recording: Recording) -> Recording:
        """Convert a recording of one pad for diagnosis: its total force as one taxel, and the load beside it.

        An evenly magnetised skin has no channel that measures a force, but all channels together do. Components that
        were not calibrated are 0 in both streams.

        Args:
            recording: Recording of the same sensor, with the channels in `measured` and the loads in its covariates.

        Raises:
            UnknownNameError: A covariate is missing.
            InvalidValueError: There are several pads, no force was calibrated, the shape differs, `measured` is
                missing, or the load is never known.
        """
        if self.background is not None:
            recording = self.background.apply(recording)
        recording, values = self.readout.beside_loads(recording, self.model.delay)
        assert recording.measured is not None
        if recording.measured.shape[1] != 1 or not self._forces:
            raise InvalidValueError(
                f"expected one pad and a calibrated force, got {recording.measured.shape[1]} pads and the loads "
                f"{', '.join(load.name for load in self.model.loads)}"
            )
        measured, simulated = (
            self._as_force(loads, 0.0).reshape(-1, 1, 3, 1, 1) for loads in (self.model(recording.measured), values)
        )
        used = np.array([axis in self._forces.values() for axis in range(3)]).reshape(1, 3, 1, 1)
        one = TaxelLayout(1, 1, recording.layout.size)
        return self.readout.as_newtons(recording, measured, simulated, used=used, delay=self.model.delay, layout=one)

    @property
    def _forces(self) -> dict[int, int]:
        """Axis of the force that each load is, by the index of the load, without torques."""
        places = enumerate(map(self._place, self.model.loads))
        return {index: place for index, place in places if place is not None}

    def _as_force(self, loads: NDArray[np.floating], unknown: float) -> NDArray[np.float32]:
        """Return ``(..., loads)`` as ``(..., 3)`` forces (N), with `unknown` on axes that were not calibrated."""
        force = np.full((*loads.shape[:-1], 3), unknown, dtype=np.float32)
        for index, place in self._forces.items():
            force[..., place] = loads[..., index]
        return force

    def _place(self, load: Load) -> int | None:
        """Return the axis of the force that a load is, or None."""
        if load.name in _FORCES:
            return _FORCES.index(load.name)
        return 2 if len(self.model.loads) == 1 and not load.is_torque else None

    def check(self, shape: tuple[int, ...], unit: str) -> None:
        """Raise unless the calibration fits a sensor.

        Args:
            shape: Shape of the sensor's frames, ``(pads, 3, rows, cols)``.
            unit: Unit of the sensor's frames.

        Raises:
            InvalidValueError: The calibration belongs to another sensor.
        """
        check_sensor("calibration", self.readout.offset.shape, self.readout.unit or unit, shape, unit)

    def _entries(self) -> dict[str, Any]:
        parts = {"readout": asdict(self.readout), "model": asdict(self.model)}
        return {
            "profile": self.profile,
            **{name: finite(_as_lists(part)) for name, part in parts.items()},
            "background": None if self.background is None else self.background.to_document(),
        }

    @classmethod
    def _from_entries(cls, entries: dict[str, Any]) -> Calibration:
        held = entries.get("background")  # files of older versions have none
        background = None if held is None else Background.from_document(held)
        return cls(_readout(entries["readout"]), _model(entries["model"]), str(entries["profile"]), background)

    def __repr__(self) -> str:
        """One-line summary."""
        return f"Calibration({self.readout!r}, {self.model!r})"

    def __str__(self) -> str:
        """Tables of the background, the readout and the load model."""
        return "\n\n".join(str(part) for part in (self.background, self.readout, self.model) if part is not None)


def calibrate_sensor(
    recording: Recording,
    loads: str | Sequence[str] | Mapping[str, str],
    *,
    degree: int = 1,
    kind: Kind = "best",
    max_delay: float = 0.5,
    background: Background | None = None,
) -> Calibration:
    """Calibrate a sensor against a load cell: each channel separately, and all channels together.

    Args:
        recording: Recording with the channels as measured tensors and the loads as covariates.
        loads: Covariates that hold the load, see `calibrate_readout`.
        degree: Degree of the response of each channel to a load, 1 to 3.
        kind: How the load depends on all channels: ``"linear"``, ``"quadratic"``, or ``"best"`` for the one with the
            lower held-out error, see `fit_load_model`.
        max_delay: Largest delay between loads and channels to search (s).
        background: Background to subtract first, from `fit_background`; it becomes part of the calibration.

    Raises:
        UnknownNameError: A covariate or component is missing.
        InvalidValueError: See `calibrate_readout`, `fit_load_model` and `Background.apply`.
    """
    if background is not None:
        recording = background.apply(recording)
    readout = calibrate_readout(recording, loads, degree=degree, max_delay=max_delay)
    model = fit_load_model(recording, readout, kind=kind)
    return Calibration(readout, model, str(recording.metadata.get("profile", "")), background)


def _as_lists(value: Any) -> Any:
    """Convert arrays to nested lists for JSON."""
    if isinstance(value, dict):
        return {name: _as_lists(item) for name, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_as_lists(item) for item in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def _readout(document: dict[str, Any]) -> LinearCalibration:
    loads = _loads(document["loads"])
    offset = _numbers(document, "offset", None)
    if offset.ndim != 4 or offset.shape[1] != 3:
        raise InvalidValueError(f"offset must be (pads, 3, rows, cols) numbers, got shape {offset.shape}")
    shape, count, degree = offset.shape, len(loads), len(document["coefficients"])
    return LinearCalibration(
        loads=loads,
        coefficients=_numbers(document, "coefficients", (degree, count, *shape)),
        offset=offset,
        gain=_numbers(document, "gain", (count, *shape)),
        gain_error=_numbers(document, "gain_error", (count, *shape), empty=math.inf),
        used=_numbers(document, "used", shape).astype(bool),
        delay=float(document["delay"]),
        delay_interval=tuple(_numbers(document, "delay_interval", (2,), empty=_OPEN).tolist()),
        error=_numbers(document, "error", shape),
        explained=_numbers(document, "explained", shape),
        excitation=_excitation(document["excitation"], count),
        ridge=float(document["ridge"]),
        blocks=int(document["blocks"]),
        unit=str(document["unit"]),
    )


def _excitation(document: dict[str, Any], count: int) -> Excitation:
    return Excitation(
        spread=_numbers(document, "spread", (count,)),
        alone=_numbers(document, "alone", (count,)),
        excited=_numbers(document, "excited", (count,)).astype(bool),
        separable=_numbers(document, "separable", (count,)).astype(bool),
    )


def _model(document: dict[str, Any]) -> LoadModel:
    loads = _loads(document["loads"])
    used = _numbers(document, "used", None).astype(bool)
    if used.ndim != 4:
        raise InvalidValueError(f"used must be (pads, 3, rows, cols), got shape {used.shape}")
    count, quadratic = int(used.sum()), bool(document["quadratic"])
    terms = 1 + count + quadratic * count * (count + 1) // 2
    return LoadModel(
        loads=loads,
        used=used,
        quadratic=quadratic,
        ridge=float(document["ridge"]),
        delay=float(document["delay"]),
        center=_numbers(document, "center", (count,)),
        spread=_numbers(document, "spread", (count,)),
        weights=_numbers(document, "weights", (terms, len(loads))),
        error=_numbers(document, "error", (len(loads),)),
        explained=_numbers(document, "explained", (len(loads),)),
    )


def _loads(document: Any) -> tuple[Load, ...]:
    loads = tuple(Load(str(load["name"]), str(load["covariate"]), load["index"]) for load in document)
    if not 1 <= len(loads) <= MAX_LOADS:
        raise InvalidValueError(f"loads must be 1 to {MAX_LOADS}, got {len(loads)}")
    return loads


def _numbers(
    document: Mapping[str, Any], name: str, shape: tuple[int, ...] | None, empty: ArrayLike = math.nan
) -> NDArray[np.float64]:
    """Return the numbers of a field, with `empty` where the file has none."""
    values = np.array(document[name], dtype=np.float64)
    if shape is not None and values.shape != shape:
        raise InvalidValueError(f"{name} must be numbers of shape {shape}, got shape {values.shape}")
    values = np.where(np.isnan(values), empty, values)
    if np.isnan(values).any():
        raise InvalidValueError(f"{name} must be finite numbers")
    return values
