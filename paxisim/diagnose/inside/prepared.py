"""Prepared: a replayed recording made ready for the search, whose frames are known again after some were dropped."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from paxisim.diagnose.inside.responses import Responses
from paxisim.diagnose.noise import Tolerance
from paxisim.diagnose.problem import Problem, problem_of
from paxisim.diagnose.rules import Rules
from paxisim.recording import Recording

REPLAYED = Tolerance(gain=0.02, time=0.003, place=0.04)
"""What a replay in a scene may be off by: its time steps and the cubes or spheres of its pad are coarse."""
RULES = Rules(contest=8)
"""There are the scene's causes among the candidates, too."""
_FRAME = "frame of the replay"  # a covariate


def with_frames(recording: Recording) -> Recording:
    """The recording with the numbers of its frames as a covariate."""
    return recording.with_covariate(_FRAME, np.arange(len(recording)))


def problem_with(recording: Recording, responses: Responses | None) -> Problem:
    """A recording made ready, with what its scene does in the frames that it still has, if there is one."""
    if responses is None:
        return problem_of(recording)
    frames = np.rint(recording.covariates[_FRAME]).astype(np.intp)
    others = {name: values for name, values in recording.covariates.items() if name != _FRAME}
    return problem_of(replace(recording, covariates=others), responses.select(frames), REPLAYED)
