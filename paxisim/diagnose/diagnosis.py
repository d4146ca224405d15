"""Diagnosis: what was found, as a person reads it and as files hold it."""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from paxisim.augment.chain import Chain
from paxisim.diagnose.streams import Streams
from paxisim.diagnose.text import text_of
from paxisim.errors import InvalidValueError, MissingExtraError, PaxisimError
from paxisim.logs.atomic import parse_file, whole_file

FORMAT = "paxisim-diagnosis/1"
REPORT = "report.html"

Verdict = Literal["no_discrepancy", "explained", "ambiguous", "partly_explained", "unexplained"]


@dataclass(frozen=True)
class Interval:
    """A number with what it may be.

    Attributes:
        value: The estimate.
        low: Lower end of the 90 % interval, None if the recording gives none (one episode).
        high: Upper end.
    """

    value: float
    low: float | None = None
    high: float | None = None

    def __str__(self) -> str:
        """``0.12 [0.10, 0.14]``."""
        if self.low is None or self.high is None:
            return f"{self.value:.3g}"
        return f"{self.value:.3g} [{self.low:.3g}, {self.high:.3g}]"


@dataclass(frozen=True)
class FittedParameter:
    """A parameter of a cause.

    Attributes:
        name: As the cause calls it.
        unit: Its unit, ``"1"`` for a pure number.
        value: The fit, with its 90 % interval.
    """

    name: str
    unit: str
    value: Interval


@dataclass(frozen=True)
class FoundCause:
    """A cause that the recording asks for.

    Attributes:
        name: As in `known_causes`.
        parameters: Fitted, with units and intervals.
        gain: What it takes off the held-out energy of the error, as a share of the explainable error, if it is the last
            to be added; with its interval.
        rivals: Causes that would do as well in its place.
        evidence: Why it is named, in a sentence.
    """

    name: str
    parameters: tuple[FittedParameter, ...]
    gain: Interval
    rivals: tuple[str, ...]
    evidence: str


@dataclass(frozen=True)
class HeldOut:
    """How far off the simulation is, in episodes that took no part in the fit.

    RMSE is over all channels that answer and all samples, divided by the root mean square of the measured force.

    Attributes:
        nrmse_before: Of the simulation as it was.
        nrmse_after: Of the extended model.
        noise_floor: What noise and rounding alone would leave.
        noise_source: "repeated motions" or "high-frequency differences".
        explained: Share of the explainable error (that above the floor, in energy) that the model explains; None where
            there is nothing to explain.
        gain_per_episode: Share of each episode's error energy that the model removes.
        ceiling_nrmse: Of a black box (gradient boosting on lagged inputs), None if it was not run.
        ceiling_explained: The share that the black box explains.
        note: Why a figure is missing or to be read with care; empty if there is nothing to say.
    """

    nrmse_before: float
    nrmse_after: float
    noise_floor: float
    noise_source: str
    explained: Interval | None
    gain_per_episode: tuple[float, ...]
    ceiling_nrmse: float | None = None
    ceiling_explained: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Place:
    """A share of the error's energy, before and after.

    Attributes:
        where: A pad, an axis, a taxel, a phase, a band of frequencies or a covariate.
        before: Share of the error's energy above the noise that the simulation has there.
        after: What the extended model leaves there, as a share of the same total.
    """

    where: str
    before: float
    after: float


@dataclass(frozen=True)
class LeftOver:
    """Structure in what the model leaves, or a cause that may be at work besides.

    Attributes:
        what: In words.
        statistic: How strong it is.
        limit: From where on it counts.
    """

    what: str
    statistic: float
    limit: float


@dataclass(frozen=True)
class Symptoms:
    """Where the error lives, and what is wrong with the recording itself.

    Attributes:
        warnings: What is wrong with the recording or to be read with care.
        left_over: Structure in what the model leaves, and causes that may be at work but are too faint to be named.
        pads: Shares by pad.
        axes: By axis.
        taxels: The ten worst.
        phases: Free, loading, holding, unloading, sliding.
        frequencies: By band.
        covariates: Squared correlation of the error with each covariate.
    """

    warnings: tuple[str, ...] = ()
    left_over: tuple[LeftOver, ...] = ()
    pads: tuple[Place, ...] = ()
    axes: tuple[Place, ...] = ()
    taxels: tuple[Place, ...] = ()
    phases: tuple[Place, ...] = ()
    frequencies: tuple[Place, ...] = ()
    covariates: tuple[Place, ...] = ()


@dataclass(frozen=True)
class Diagnosis:
    """What the simulation gets wrong, why, and what fixing it gains. Print it to read it.

    Attributes:
        verdict: "no_discrepancy", "explained", "ambiguous" (rivals that the data cannot tell apart), "partly_explained"
            (named causes, and structure left over or a cause too faint to be named) or "unexplained".
        causes: In the order of their gain.
        heldout: Figures on episodes that took no part in the fit.
        confidence: Of each cause, 0 to 1: how often its gain still matters when episodes are drawn anew, shared with
            its rivals, and halved where structure is left over.
        not_testable: Causes that this recording cannot show, and why.
        symptoms: Where the error lives.
        advice: What to record next.
        model: The extended sensor model. Its latency and low-pass were fitted on curves through the frames: step by
            step in a simulator they do what was fitted, on frames some 50 ms apart they cut fast motions a bit more.
        intervals: What the model's parameters may be, 90 %: by member and parameter the lowest and the highest value,
            arrays of the parameter's shape, as ``GCS.around(model, intervals)`` takes them. A parameter without an
            interval is not in it.
        streams: What it was made from, for the pictures of the report; None in a diagnosis that was loaded.
    """

    verdict: Verdict
    causes: tuple[FoundCause, ...]
    heldout: HeldOut
    confidence: Mapping[str, float]
    not_testable: Mapping[str, str]
    symptoms: Symptoms
    advice: tuple[str, ...]
    model: Chain = field(default_factory=Chain)
    intervals: Mapping[str, Any] = field(default_factory=dict)
    streams: Streams | None = field(default=None, repr=False, compare=False)

    def to_json(self) -> str:
        """The diagnosis as JSON text; a number that is not finite becomes null."""
        document = {
            "format": FORMAT,
            "verdict": self.verdict,
            "causes": [asdict(cause) for cause in self.causes],
            "heldout": asdict(self.heldout),
            "confidence": dict(self.confidence),
            "not_testable": dict(self.not_testable),
            "symptoms": asdict(self.symptoms),
            "advice": list(self.advice),
            "model": json.loads(self.model.to_json()),
            "intervals": _as_lists(self.intervals),
        }
        return json.dumps(_finite(document), indent=1, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> Diagnosis:
        """The diagnosis that `to_json` wrote.

        Raises:
            InvalidValueError: The text is not one.
        """
        try:
            document = json.loads(text)
        except json.JSONDecodeError as error:
            raise InvalidValueError(f"a diagnosis must be JSON: {error}") from error
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise InvalidValueError(f"expected a JSON object of format {FORMAT!r}")
        if document.get("verdict") not in get_args(Verdict):
            expected = ", ".join(get_args(Verdict))
            raise InvalidValueError(f"expected a diagnosis' verdict of {expected}, got {document.get('verdict')!r}")
        try:
            return cls(
                verdict=document["verdict"],
                causes=tuple(_cause(item) for item in document["causes"]),
                heldout=_heldout(document["heldout"]),
                confidence=document["confidence"],
                not_testable=document["not_testable"],
                symptoms=_symptoms(document["symptoms"]),
                advice=tuple(document["advice"]),
                model=Chain.from_json(json.dumps(document["model"])),
                intervals=_as_arrays(document["intervals"]),
            )
        except PaxisimError:
            raise
        except (KeyError, TypeError, AttributeError, ValueError) as error:
            raise InvalidValueError(f"the diagnosis lacks or misuses a field: {error}") from error

    def report(self) -> str:
        """The diagnosis in pictures: one HTML page that needs nothing else, neither network nor script.

        A diagnosis that was loaded has no streams: its page says so and lacks the pictures that are made of them.

        Raises:
            MissingExtraError: matplotlib or jinja2 is not installed.
        """
        from paxisim.diagnose.report.page import page

        return page(self)

    def save(self, folder: str | Path) -> None:
        """Write ``diagnosis.json``, ``model.json`` and ``report.html`` into `folder`, which is made if need be.

        Each file is written whole or not at all; ``model.json`` is what `Chain.load` reads. Where matplotlib or jinja2
        is missing there is a warning in place of the report, and an older report in the folder is removed, as it would
        be of another diagnosis.

        Raises:
            OSError: The folder or a file in it cannot be written.
        """
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in self.files().items():
            _write(folder / name, text)
        try:
            page = self.report()
        except MissingExtraError as error:
            (folder / REPORT).unlink(missing_ok=True)
            warnings.warn(f"no {REPORT} is written: {error}", stacklevel=2)
        else:
            _write(folder / REPORT, page)

    def files(self) -> dict[str, str]:
        """The JSON files that `save` writes, by name."""
        return {"model.json": self.model.to_json() + "\n", "diagnosis.json": self.to_json() + "\n"}

    @classmethod
    def load(cls, folder: str | Path) -> Diagnosis:
        """Read what `save` wrote; raises as `from_json` does, and FileNotFoundError where there is none."""
        return parse_file(Path(folder) / "diagnosis.json", cls.from_json)

    def __str__(self) -> str:
        """The table that a person reads, 80 columns wide."""
        return text_of(self)


def _write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _finite(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _as_lists(intervals: Mapping[str, Any]) -> Any:
    if isinstance(intervals, Mapping):
        return {name: _as_lists(item) for name, item in intervals.items()}
    return [np.asarray(bound).tolist() for bound in intervals]


def _as_arrays(document: Any) -> Any:
    if isinstance(document, Mapping):
        return {name: _as_arrays(item) for name, item in document.items()}
    low, high = document
    return np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)


def _interval(document: Mapping[str, Any] | None) -> Interval | None:
    return None if document is None else Interval(**document)


def _cause(document: Mapping[str, Any]) -> FoundCause:
    parameters = tuple(FittedParameter(p["name"], p["unit"], Interval(**p["value"])) for p in document["parameters"])
    return FoundCause(
        document["name"], parameters, Interval(**document["gain"]), tuple(document["rivals"]), document["evidence"]
    )


def _heldout(document: Mapping[str, Any]) -> HeldOut:
    changed = {
        "explained": _interval(document["explained"]),
        "gain_per_episode": tuple(document["gain_per_episode"]),
    }
    return HeldOut(**{**document, **changed})


def _symptoms(document: Mapping[str, Any]) -> Symptoms:
    made: dict[str, Any] = {"warnings": tuple(document["warnings"])}
    made["left_over"] = tuple(LeftOver(**item) for item in document["left_over"])
    for name in ("pads", "axes", "taxels", "phases", "frequencies", "covariates"):
        made[name] = tuple(Place(**item) for item in document[name])
    return Symptoms(**made)
