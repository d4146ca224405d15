"""Replayed: a recording whose simulation is replayed in a scene, with frame numbers that survive dropped frames."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from paxisim.diagnose.data.noise import Tolerance, rate
from paxisim.diagnose.data.problem import FloatArray, Problem, problem_of
from paxisim.diagnose.data.responses import Responses
from paxisim.recording import Recording

REPLAYED = Tolerance(gain=0.02, time=0.003, place=0.04)
"""Tolerated errors of a replay in a scene, whose time steps and pad elements (cubes or spheres) are coarse."""
_FRAME = "frame of the replay"  # name of the covariate


def with_frames(recording: Recording) -> Recording:
    """Return the recording with its frame numbers as a covariate."""
    return recording.with_covariate(_FRAME, np.arange(len(recording)))


def problem_with(recording: Recording, responses: Responses | None) -> Problem:
    """Return the problem of a recording, with the responses of its scene, if given, in the frames that remain."""
    if responses is None:
        return problem_of(recording)
    frames = np.rint(recording.covariates[_FRAME]).astype(np.intp)
    others = {name: values for name, values in recording.covariates.items() if name != _FRAME}
    return problem_of(replace(recording, covariates=others), responses.select(frames), REPLAYED)


def replay_errors(problem: Problem, prediction: FloatArray) -> Iterator[FloatArray]:
    """Yield tolerated errors ``(T, pads, 3, rows, cols)`` N of a replay that all its samples may share.

    Contacts may be stiffer or softer, along each axis, and earlier or later than in reality.
    """
    for axis in np.eye(3):
        yield problem.noise.tolerance.gain * prediction * axis[:, None, None]
    speed = [rate(prediction[span], problem.time[span]) for span in problem.episodes]
    yield problem.noise.tolerance.time * np.concatenate(speed)
