"""Result: a diagnosis as plain data, which is what its JSON file holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray

from paxisim.augment.chain import Chain
from paxisim.diagnose.data.responses import in_si
from paxisim.document import Document, built, finite
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.logs.memory import peak_of
from paxisim.logs.recording_arrays import episode_spans
from paxisim.scene.parameters import SceneParameter
from paxisim.scene.scene import Scene

_Kind = TypeVar("_Kind", bound="Result")

Verdict = Literal[
    "no_discrepancy", "clocks_differ", "explained", "ambiguous", "partly_explained", "unexplained", "unrelated"
]


def percentage(share: float, digits: int = 0) -> str:
    """Format a share in percent; all of something is "over 99%", as is more than all, by the error of the noise."""
    step = 10.0 ** -(digits + 2)
    return f"over {1 - step:.{digits}%}" if share >= 1 - step / 2 else f"{share:.{digits}%}"


@dataclass(frozen=True)
class Interval:
    """An estimate with its 90% confidence interval.

    Attributes:
        value: The estimate.
        low: Lower end of the interval; None if there is no interval, as with a single episode.
        high: Upper end, or None.
    """

    value: float
    low: float | None = None
    high: float | None = None

    @property
    def ends(self) -> tuple[float, float]:
        """Lower and upper end; both equal the estimate if there is no interval."""
        return (self.value, self.value) if self.low is None or self.high is None else (self.low, self.high)

    def __str__(self) -> str:
        """``0.12 [0.10, 0.14]``."""
        if self.low is None or self.high is None:
            return f"{self.value:.3g}"
        return f"{self.value:.3g} [{self.low:.3g}, {self.high:.3g}]"

    def percent(self, digits: int = 1) -> str:
        """``12.0% [10.0%, 14.0%]``, without an interval that does not show at this number of digits."""
        value, low, high = (percentage(own, digits) for own in (self.value, *self.ends))
        return value if low == value == high else f"{value} [{low}, {high}]"


@dataclass(frozen=True)
class FittedParameter:
    """A fitted parameter of a cause.

    Attributes:
        name: Name of the parameter.
        unit: Unit, ``"1"`` if dimensionless.
        value: The estimate with its 90% interval.
        words: Explanation, if the name alone is not clear.
        neutral: Value without effect, if one is known.
        size: Deviation from neutral, in units of the smallest that matters; None if no such unit is known.
        pad: Index of the pad that it belongs to; None if it belongs to all.
    """

    name: str
    unit: str
    value: Interval
    words: str = ""
    neutral: float | None = None
    size: float | None = None
    pad: int | None = None


@dataclass(frozen=True)
class FoundPart:
    """A part of a cause, with its own gain.

    Attributes:
        name: Name of the part, such as "Poisson effect".
        words: What it does, in a few words.
        parameters: Names of its parameters among those of the cause.
        gain: Reduction of the held-out error energy compared with the model refitted without the part, as a share of
            the explainable error.
    """

    name: str
    words: str
    parameters: tuple[str, ...]
    gain: Interval


@dataclass(frozen=True)
class FoundCause:
    """A cause that the diagnosis names.

    Attributes:
        name: Name of the cause, as in `known_causes`.
        parameters: Fitted parameters with units and intervals.
        gain: Reduction of the held-out error energy compared with the model refitted without the cause, as a share of
            the explainable error.
        rivals: Causes that fit equally well in its place.
        evidence: Reason why the cause is named, in a sentence.
        parts: Its parts that matter, if it has any, largest gain first.
    """

    name: str
    parameters: tuple[FittedParameter, ...]
    gain: Interval
    rivals: tuple[str, ...]
    evidence: str
    parts: tuple[FoundPart, ...] = ()


@dataclass(frozen=True)
class HeldOut:
    """Errors on held-out episodes.

    The normalised RMSE is the RMS error over all channels in use and all samples, divided by the RMS of the measured
    force.

    Attributes:
        nrmse_before: Normalised RMSE of the simulation.
        nrmse_after: Normalised RMSE of the extended model.
        noise_floor: Normalised RMSE that noise and rounding alone would cause.
        noise_source: "repeated motions" or "high-frequency differences".
        explained: Share of the explainable error that the model explains, where the explainable error is the energy
            above the noise floor; None if there is nothing to explain.
        gain_per_episode: Share of each episode's error energy that the model removes.
        ceiling_nrmse: Normalised RMSE of a black-box model (gradient boosting on lagged inputs); None if it was not
            run.
        ceiling_explained: Share of the explainable error that the black box explains.
        note: Caveats about the figures; empty if there are none.
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
    """Share of the error energy at one place, before and after the correction.

    Attributes:
        where: A pad, axis, taxel, phase, frequency band or covariate.
        before: Share of the simulation's error energy found there.
        after: Error energy of the extended model there, as a share of the same total.
    """

    where: str
    before: float
    after: float


@dataclass(frozen=True)
class LeftOver:
    """Structure in the residual, or a near miss: a cause that falls short of being named.

    Attributes:
        what: Description.
        statistic: Test statistic.
        limit: The threshold that it exceeds.
    """

    what: str
    statistic: float
    limit: float


@dataclass(frozen=True)
class Symptoms:
    """Where the error is, and warnings about the recording.

    Attributes:
        warnings: Problems with the recording and caveats.
        left_over: Structure in the residual, and near misses.
        pads: Shares of the error energy by pad.
        axes: Shares by axis.
        taxels: Shares of the ten worst taxels.
        phases: Shares by phase: free, loading, holding, unloading, sliding.
        frequencies: Shares by frequency band.
        covariates: Squared correlation of the error with each covariate.
        reasons: Why the named causes are no full explanation, in sentences.
    """

    warnings: tuple[str, ...] = ()
    left_over: tuple[LeftOver, ...] = ()
    pads: tuple[Place, ...] = ()
    axes: tuple[Place, ...] = ()
    taxels: tuple[Place, ...] = ()
    phases: tuple[Place, ...] = ()
    frequencies: tuple[Place, ...] = ()
    covariates: tuple[Place, ...] = ()
    reasons: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class InScene:
    """Streams simulated in the scene with the fitted values.

    Attributes:
        simulated: ``(T, pads, 3, rows, cols)`` float32 newtons, with all fitted values.
        without: The same with the numbers of one cause at their nominal values, by cause.
        parameters: Numbers of the scene by name.
        values: Fitted values by name, in SI units.
    """

    simulated: NDArray[np.float32]
    without: Mapping[str, NDArray[np.float32]]
    parameters: Mapping[str, SceneParameter]
    values: Mapping[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class Streams:
    """Measured, simulated and extended tensors on one clock; they are not saved with a diagnosis.

    Attributes:
        time: ``(T,)`` seconds.
        episode: ``(T,)`` the recording's number of each sample's episode.
        measured: ``(T, pads, 3, rows, cols)`` float32 newtons.
        simulated: Simulated stream as recorded, of the same shape.
        extended: Mean reading predicted by the extended model fitted to other episodes, of the same shape.
        covariates: Covariates by name, ``(T,)`` each.
        pads: Names of the pads.
        layout: Layout of the taxels.
        step: Newtons per count, 0 if the sensor does not quantise.
        alive: ``(pads, 3, rows, cols)`` channels in use, without those that the sensor does not measure.
        calibrated: Whether each channel estimates the whole load (see `paxisim.calibrate_readout`). If so, the sum of
            the channels is not the force on the pad.
        in_scene: Streams simulated in the scene with the fitted values; None if no scene was given.
    """

    time: NDArray[np.float64]
    episode: NDArray[np.int64]
    measured: NDArray[np.float32]
    simulated: NDArray[np.float32]
    extended: NDArray[np.float32]
    covariates: Mapping[str, NDArray[np.float64]]
    pads: tuple[str, ...]
    layout: TaxelLayout
    step: float = 0.0
    alive: NDArray[np.bool_] | Literal[True] = True
    calibrated: bool = False
    in_scene: InScene | None = None

    def pad(self, number: int) -> str:
        """Return a pad's name for a title, such as "pad left" or "pad0"."""
        return pad_in_words(self.pads[number])

    @property
    def numbers(self) -> NDArray[np.int64]:
        """The recording's number of each of `episodes`."""
        return self.episode[[span.start for span in self.episodes]]

    @property
    def episodes(self) -> tuple[slice, ...]:
        """The samples of each episode."""
        return episode_spans(self.episode)

    @property
    def peak(self) -> float:
        """Peak force (N) on the most loaded taxel in the simulation, 99.5% quantile over time."""
        return peak_of(self.simulated)

    @property
    def at_rest(self) -> NDArray[np.bool_]:
        """``(T,)`` True where no taxel is pressed."""
        return np.abs(self.simulated).max(axis=(1, 2, 3, 4)) < 0.01 * max(self.peak, 1e-9)


def pad_in_words(name: str) -> str:
    """Return the name of a pad, preceded by the word "pad" unless the name starts with it."""
    return name if name.startswith("pad") else f"pad {name}"


_PARTS = {
    "causes": tuple[FoundCause, ...],
    "heldout": HeldOut,
    "confidence": dict[str, float],
    "not_testable": dict[str, str],
    "symptoms": Symptoms,
    "advice": tuple[str, ...],
    "scene_values": dict[str, float],
    "clock_shift": float,
    "known": str,
}
"""Types of those fields of a diagnosis that JSON represents as they are."""


@dataclass(frozen=True, repr=False)
class Result(Document):
    """A diagnosis as plain data; `Diagnosis` describes the fields."""

    verdict: Verdict
    causes: tuple[FoundCause, ...]
    heldout: HeldOut
    confidence: Mapping[str, float]
    not_testable: Mapping[str, str]
    symptoms: Symptoms
    advice: tuple[str, ...]
    model: Chain = field(default_factory=Chain)
    intervals: Mapping[str, Any] = field(default_factory=dict)
    scene: Scene | None = field(default=None, repr=False, compare=False)
    scene_values: Mapping[str, float] = field(default_factory=dict)
    streams: Streams | None = field(default=None, repr=False, compare=False)
    clock_shift: float = 0.0
    known: str = ""

    FORMAT = "paxisim-diagnosis/1"
    ENTRIES = (
        "verdict",
        "causes",
        "heldout",
        "confidence",
        "not_testable",
        "symptoms",
        "advice",
        "model",
        "intervals",
        "scene_values",
        "clock_shift",
        "known",
    )

    @property
    def scene_intervals(self) -> dict[str, tuple[float, float]]:
        """90 % intervals of the scene parameters by name, in SI units, for `paxisim.SceneRanges.around`.

        For a parameter without an interval, both ends equal its value.
        """
        fitted = (p for cause in self.causes for p in cause.parameters)
        return {p.name: in_si(p.unit, p.value.ends) for p in fitted if p.name in self.scene_values}

    def _entries(self) -> dict[str, Any]:
        return {
            "verdict": self.verdict,
            **finite({name: getattr(self, name) for name in _PARTS}),
            "model": self.model.to_document(),
            "intervals": intervals_as_lists(self.intervals),
        }

    @classmethod
    def _from_entries(cls: type[_Kind], entries: dict[str, Any]) -> _Kind:
        if entries.get("verdict") not in get_args(Verdict):
            expected = ", ".join(get_args(Verdict))
            raise InvalidValueError(f"verdict must be one of {expected}, got {entries.get('verdict')!r}")
        return cls(
            verdict=entries["verdict"],
            model=Chain.from_document(entries["model"]),
            intervals=intervals_as_arrays(entries["intervals"]),
            **{name: built(kind, entries[name]) for name, kind in _PARTS.items() if name != "known" or name in entries},
        )


def intervals_as_lists(intervals: Mapping[str, Any]) -> Any:
    """Return intervals of parameters, by member and parameter, as JSON has them."""
    if isinstance(intervals, Mapping):
        return {name: intervals_as_lists(item) for name, item in intervals.items()}
    return [np.asarray(bound).tolist() for bound in intervals]


def intervals_as_arrays(document: Any) -> Any:
    """Return the intervals that `intervals_as_lists` wrote."""
    if isinstance(document, Mapping):
        return {name: intervals_as_arrays(item) for name, item in document.items()}
    low, high = document
    return np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
