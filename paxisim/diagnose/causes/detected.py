"""Reading off: deterministic checks before the search, for layout, rounding, dead taxels and silent channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from paxisim.diagnose.causes.channels import silent_channels
from paxisim.diagnose.causes.kinds import Cause, DetectedCause, Reading
from paxisim.diagnose.data.problem import FloatArray, Problem, with_noise
from paxisim.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class ReadOff:
    """Result of the deterministic checks.

    Attributes:
        raw: The original recording.
        problem: The recording after the checks, which remains to be explained.
        readings: Detected faults, by cause.
        causes: All requested causes.
        silent: ``(pads, 3, rows, cols)`` channels that are not compared, because they never change.
    """

    raw: Problem
    problem: Problem
    readings: Mapping[str, Reading]
    causes: tuple[Cause, ...]
    silent: NDArray[np.bool_]

    @cached_property
    def judged(self) -> Problem:
        """The recording on which errors are reported; missing readings of dead taxels count as errors."""
        return replace(self.problem, alive=self.raw.alive & ~self.silent)

    def with_dead(self, prediction: FloatArray) -> FloatArray:
        """``(T, pads, 3, rows, cols)`` N, a prediction with the detected dead or stuck taxels."""
        for reading in self.readings.values():
            fault = reading.transform
            if not reading.rounds and reading.problem.alive.sum() < self.raw.alive.sum():
                prediction = fault.run(prediction, self.raw.time) if fault.has_memory else fault(prediction)
        return prediction


def read_off(raw: Problem, causes: Sequence[Cause]) -> ReadOff:
    """Run the checks of all causes that have one.

    Raises:
        InvalidValueError: No channel responds to the simulated contacts.
    """
    problem, readings = raw, {}
    for item in causes:
        found = item.read(problem) if isinstance(item, DetectedCause) else None
        if found is not None:
            readings[item.name], problem = found, found.problem
    silent = silent_channels(problem)
    if silent.any():
        problem = with_noise(replace(problem, alive=problem.alive & ~silent))
    if not problem.alive.any():
        raise InvalidValueError(
            "no taxel responds to the simulated contacts: was the sensor connected, and is it the same motion, in "
            "newtons?"
        )
    return ReadOff(raw, problem, readings, tuple(causes), silent)
