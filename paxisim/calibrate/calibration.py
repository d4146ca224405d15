"""Calibration: a sensor model fitted to a recording with a load cell, saved to a file and applied live."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paxisim.calibrate.fit import calibrate_readout
from paxisim.calibrate.linear import LinearCalibration
from paxisim.calibrate.load_model import LoadModel, fit_load_model
from paxisim.calibrate.loads import COMPONENTS, MAX_LOADS, Excitation, Load
from paxisim.errors import InvalidValueError
from paxisim.files import parse_file, whole_file
from paxisim.logs.document import finite
from paxisim.logs.text import parse_json
from paxisim.recording import Recording

FORMAT = "paxisim-calibration-1"
_FORCES = COMPONENTS[:3]


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """Calibration of a sensor whose channels are not in newtons, created by `calibrate_sensor`.

    Attributes:
        readout: Estimate of the load from each channel separately.
        model: Estimate of the load from all channels together.
        profile: Name of the profile that the sensor was recorded with; empty if the recording does not contain it.
    """

    readout: LinearCalibration
    model: LoadModel
    profile: str = ""

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
        places = [self._place(load) for load in self.model.loads]
        if len(channels) != 1 or not any(place is not None for place in places):
            return None
        force = np.full((1, 3), np.nan, dtype=np.float32)
        for place, value in zip(places, self.model(channels), strict=True):
            if place is not None:
                force[0, place] = value
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
        if shape != self.readout.offset.shape:
            raise InvalidValueError(
                f"the calibration is of a sensor with frames of shape {self.readout.offset.shape} (pads, 3, rows, "
                f"cols), but this sensor's frames have shape {shape}"
            )
        if unit != (self.readout.unit or unit):
            raise InvalidValueError(
                f"the calibration is of channels in {self.readout.unit}, but this sensor's are in {unit}"
            )

    def to_json(self) -> str:
        """Return the calibration as JSON text, which `from_json` restores."""
        document = {
            "format": FORMAT,
            "profile": self.profile,
            "readout": _document(asdict(self.readout)),
            "model": _document(asdict(self.model)),
        }
        return json.dumps(finite(document), indent=1, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> Calibration:
        """Return the calibration that `to_json` wrote.

        Raises:
            InvalidValueError: The text is not a calibration.
        """
        try:
            document = parse_json(text)
        except InvalidValueError as error:
            raise InvalidValueError(f"a calibration must be JSON: {error}") from error
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise InvalidValueError(f"expected a calibration, a JSON object of format {FORMAT!r}")
        try:
            return cls(_readout(document["readout"]), _model(document["model"]), str(document.get("profile", "")))
        except InvalidValueError:
            raise
        except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
            raise InvalidValueError(f"the calibration lacks or misuses {error}") from error

    def save(self, path: str | Path) -> None:
        """Write `to_json` to a file; an existing file is replaced atomically.

        Raises:
            InvalidValueError: The path is a folder, or its folder does not exist.
            OSError: The file cannot be written.
        """
        with whole_file(Path(path)) as temporary:
            temporary.write_text(self.to_json() + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read a file that `save` wrote; raises as `from_json` does, and FileNotFoundError if it does not exist."""
        return parse_file(Path(path), cls.from_json)

    def __repr__(self) -> str:
        """One-line summary."""
        return f"Calibration({self.readout!r}, {self.model!r})"

    def __str__(self) -> str:
        """Tables of the readout and the load model."""
        return f"{self.readout}\n\n{self.model}"


def calibrate_sensor(
    recording: Recording,
    loads: str | Sequence[str] | Mapping[str, str],
    *,
    degree: int = 1,
    quadratic: bool = False,
    max_delay: float = 0.5,
) -> Calibration:
    """Calibrate a sensor against a load cell: each channel separately, and all channels together.

    Args:
        recording: Recording with the channels as measured tensors and the loads as covariates.
        loads: Covariates that hold the load, see `calibrate_readout`.
        degree: Degree of the response of each channel to a load, 1 to 3.
        quadratic: Whether the load is a quadratic function of the channels, see `fit_load_model`.
        max_delay: Largest delay between loads and channels to search (s).

    Raises:
        UnknownNameError: A covariate or component is missing.
        InvalidValueError: See `calibrate_readout` and `fit_load_model`.
    """
    readout = calibrate_readout(recording, loads, degree=degree, max_delay=max_delay)
    model = fit_load_model(recording, readout, quadratic=quadratic)
    return Calibration(readout, model, str(recording.metadata.get("profile", "")))


def _document(value: Any) -> Any:
    """Convert arrays to nested lists for JSON."""
    if isinstance(value, dict):
        return {name: _document(item) for name, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_document(item) for item in value]
    return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value


def _readout(document: dict[str, Any]) -> LinearCalibration:
    loads = _loads(document["loads"])
    offset = _numbers(document, "offset", None)
    if offset.ndim != 4 or offset.shape[1] != 3:
        raise InvalidValueError(f"offset must be (pads, 3, rows, cols) numbers, got shape {offset.shape}")
    shape, count = offset.shape, len(loads)
    found = document["excitation"]
    degree = len(document["coefficients"])
    return LinearCalibration(
        loads,
        _numbers(document, "coefficients", (degree, count, *shape)),
        offset,
        _numbers(document, "gain", (count, *shape)),
        _numbers(document, "gain_error", (count, *shape), empty=math.inf),
        _numbers(document, "used", shape).astype(bool),
        float(document["delay"]),
        tuple(_numbers(document, "delay_interval", (2,)).tolist()),
        _numbers(document, "error", shape),
        _numbers(document, "explained", shape),
        Excitation(
            _numbers(found, "spread", (count,)),
            _numbers(found, "alone", (count,)),
            _numbers(found, "excited", (count,)).astype(bool),
            _numbers(found, "separable", (count,)).astype(bool),
        ),
        float(document["ridge"]),
        int(document["blocks"]),
        str(document["unit"]),
    )


def _model(document: dict[str, Any]) -> LoadModel:
    loads = _loads(document["loads"])
    used = _numbers(document, "used", None).astype(bool)
    count, quadratic = int(used.sum()), bool(document["quadratic"])
    terms = 1 + count + quadratic * count * (count + 1) // 2
    if used.ndim != 4:
        raise InvalidValueError(f"used must be (pads, 3, rows, cols), got shape {used.shape}")
    return LoadModel(
        loads,
        used,
        quadratic,
        _numbers(document, "center", (count,)),
        _numbers(document, "spread", (count,)),
        _numbers(document, "weights", (terms, len(loads))),
        _numbers(document, "error", (len(loads),)),
        _numbers(document, "explained", (len(loads),)),
    )


def _loads(document: Any) -> tuple[Load, ...]:
    loads = tuple(Load(str(load["name"]), str(load["covariate"]), load["index"]) for load in document)
    if not 1 <= len(loads) <= MAX_LOADS:
        raise InvalidValueError(f"loads must be 1 to {MAX_LOADS}, got {len(loads)}")
    return loads


def _numbers(
    document: Mapping[str, Any], name: str, shape: tuple[int, ...] | None, empty: float = math.nan
) -> NDArray[np.float64]:
    """Return the numbers of a field, with `empty` where the file has none."""
    values = np.array(document[name], dtype=np.float64)
    values = np.where(np.isnan(values), empty, values)
    if shape is not None and values.shape != shape:
        raise InvalidValueError(f"{name} must be numbers of shape {shape}, got shape {values.shape}")
    if np.isnan(values).any():
        raise InvalidValueError(f"{name} must be finite numbers")
    return values
