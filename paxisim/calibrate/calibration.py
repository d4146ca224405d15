"""Calibration: what a recording with a load cell says of a sensor, as a file that is applied to it live."""

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
from paxisim.calibrate.loads import COMPONENTS, MOST, Excitation, Load
from paxisim.errors import InvalidValueError
from paxisim.files import parse_file, whole_file
from paxisim.logs.document import finite
from paxisim.logs.text import parse_json
from paxisim.recording import Recording

FORMAT = "paxisim-calibration-1"
_FORCES = COMPONENTS[:3]


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """A sensor whose channels are not in newtons, as a model of the loads on it. Made by `calibrate_sensor`.

    Attributes:
        readout: What each channel says of the load by itself.
        model: What all channels together say of it.
        profile: Name of the profile that the sensor was recorded with; empty where the recording does not say.
    """

    readout: LinearCalibration
    model: LoadModel
    profile: str = ""

    def to_force(self, channels: NDArray[np.floating]) -> NDArray[np.float32]:
        """Convert ``(..., pads, 3, rows, cols)`` channels to newtons, see `LinearCalibration.to_force`."""
        return self.readout.to_force(channels).astype(np.float32)

    def total_force(self, channels: NDArray[np.floating]) -> NDArray[np.float32] | None:
        """Convert ``(1, 3, rows, cols)`` channels of a single pad to its total force.

        Returns:
            ``(1, 3)`` newtons, of a load cell with one axis on z; NaN for what the calibration had no load of. None for
            several pads, as the loads are those of all of them together, and where torques alone were calibrated.
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
        """Which axis of a force a load is."""
        if load.name in _FORCES:
            return _FORCES.index(load.name)
        return 2 if len(self.model.loads) == 1 and not load.is_torque else None

    def check(self, shape: tuple[int, ...], unit: str) -> None:
        """Make sure that it fits a sensor.

        Args:
            shape: ``(pads, 3, rows, cols)`` of its frames.
            unit: Of its frames.

        Raises:
            InvalidValueError: It is of another sensor.
        """
        if shape != self.readout.offset.shape:
            raise InvalidValueError(
                f"the calibration is of a sensor with frames of shape {self.readout.offset.shape} (pads, 3, rows, "
                f"cols), this one's are {shape}"
            )
        if unit != (self.readout.unit or unit):
            raise InvalidValueError(
                f"the calibration is of channels in {self.readout.unit}, this sensor's are in {unit}"
            )

    def to_json(self) -> str:
        """Everything as JSON text; `from_json` makes the same of it."""
        document = {
            "format": FORMAT,
            "profile": self.profile,
            "readout": _document(asdict(self.readout)),
            "model": _document(asdict(self.model)),
        }
        return json.dumps(finite(document), indent=1, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> Calibration:
        """The calibration that `to_json` wrote.

        Raises:
            InvalidValueError: The text is none.
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
        """Write `to_json` to a file; an existing file is replaced, whole or not at all.

        Raises:
            InvalidValueError: The path is a folder, or its folder does not exist.
            OSError: The file cannot be written.
        """
        with whole_file(Path(path)) as temporary:
            temporary.write_text(self.to_json() + "\n", encoding="utf-8")

    @classmethod
    def load(cls, path: str | Path) -> Calibration:
        """Read a file that `save` wrote; raises as `from_json` does, and FileNotFoundError where there is none."""
        return parse_file(Path(path), cls.from_json)

    def __repr__(self) -> str:
        """What it holds, in a line."""
        return f"Calibration({self.readout!r}, {self.model!r})"

    def __str__(self) -> str:
        """Its tables."""
        return f"{self.readout}\n\n{self.model}"


def calibrate_sensor(
    recording: Recording,
    loads: str | Sequence[str] | Mapping[str, str],
    *,
    degree: int = 1,
    quadratic: bool = False,
    max_delay: float = 0.5,
) -> Calibration:
    """Calibrate a sensor by a recording with a load cell beside it: each channel, and all of them together.

    Args:
        recording: With the channels as its measured tensors, and the loads as covariates.
        loads: The covariates that hold the load, see `calibrate_readout`.
        degree: Of the response of each channel to a load, 1 to 3.
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
    """Arrays as nested lists."""
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
    if not 1 <= len(loads) <= MOST:
        raise InvalidValueError(f"loads must be 1 to {MOST}, got {len(loads)}")
    return loads


def _numbers(
    document: Mapping[str, Any], name: str, shape: tuple[int, ...] | None, empty: float = math.nan
) -> NDArray[np.float64]:
    """A field's numbers, `empty` where the file has none."""
    values = np.array(document[name], dtype=np.float64)
    values = np.where(np.isnan(values), empty, values)
    if shape is not None and values.shape != shape:
        raise InvalidValueError(f"{name} must be numbers of shape {shape}, got shape {values.shape}")
    if np.isnan(values).any():
        raise InvalidValueError(f"{name} must be finite numbers")
    return values
