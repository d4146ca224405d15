"""Parameters: what describes the numbers of a cause, its parts, and the numbers computed from them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from paxisim.diagnose.data.problem import FloatArray, Problem

Values = Sequence[float] | FloatArray


@dataclass(frozen=True)
class Free:
    """A scalar parameter to fit.

    Attributes:
        name: Name in reports.
        unit: Unit, ``"1"`` if dimensionless.
        neutral: Value at which the cause has no effect, or the prior mean.
        low: Lower bound.
        high: Upper bound.
        scale: Typical change of the parameter; the fit takes its steps in this unit.
        material: Smallest deviation from `neutral` that matters. The cause is named only if at least one of its
            parameters deviates that far. None for parameters that do not count, such as time constants.
        spread: Standard deviation of a prior about `neutral`; None for no prior.
        words: Explanation, if the name alone is not clear.
    """

    name: str
    unit: str
    neutral: float
    low: float
    high: float
    scale: float
    material: float | None = None
    spread: float | None = None
    words: str = ""


@dataclass(frozen=True)
class Gauge:
    """The gain that a calibration convention adds to a cause.

    A sensor with creep reads correctly at once if it was calibrated with quick presses, and only after a while if it
    was calibrated with held loads. The second sensor shows a gain below 1 besides the creep; this gain is not a
    separate cause. A nuisance parameter from 0 to 1 places the sensor between the two conventions. It is fitted with
    the cause and reported as one of its parameters. If the gain depends on the magnitude of the forces, shear has its
    own parameter.

    Attributes:
        name: Name of the parameter. At 0 the cause's transform is used unchanged, at 1 it is multiplied by `gain`.
        gain: Function that returns the gain at the other convention, given the cause's values and the recording: a
            scalar for all axes, or ``(3,)``.
        words: What 0 and 1 mean.
        by_axis: Whether the gain differs between axes.
    """

    name: str
    gain: Callable[[Values, Problem], float | FloatArray]
    words: str
    by_axis: bool = False

    @property
    def free(self) -> tuple[Free, ...]:
        """Its parameters: one for all axes, or one for normal force and one for shear."""
        names = (self.name, f"{self.name}_shear") if self.by_axis else (self.name,)
        return tuple(Free(name, "1", 0.0, 0.0, 1.0, 0.3, spread=1.0, words=self.words) for name in names)


@dataclass(frozen=True)
class CausePart:
    """A part of a cause that is reported with its own gain, and left out of the model if it gains nothing.

    Attributes:
        name: Name in reports.
        parameters: Names of its parameters. Parameters that no part lists belong to the whole cause.
        words: Explanation in a few words.
    """

    name: str
    parameters: tuple[str, ...]
    words: str


@dataclass(frozen=True)
class Derived:
    """A number that a reader understands, computed from the parameters of a cause.

    Attributes:
        name: Name in reports.
        unit: Unit, ``"1"`` if dimensionless.
        of: Function that returns the number, given the cause's parameters and the recording.
        words: Explanation in a few words.
    """

    name: str
    unit: str
    of: Callable[[Values, Problem], float]
    words: str


def one_away(count: int, index: int, neutral: float, step: float) -> list[float]:
    """Neutral values except for one that is a step away: a start for a cause with several parameters."""
    values = [neutral] * count
    values[index] += step
    return values
