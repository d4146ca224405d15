"""Recordings for tests: cases of `tests/hidden`, which does not use paxisim, in the form a user has them."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import paxisim
from paxisim.diagnose.data.motions import MOTIONS
from paxisim.recording import Recording

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.cases import make
from hidden.compare import named
from hidden.effects import EFFECTS
from hidden.outsiders import LEARNT, OUTSIDERS

__all__ = [
    "EFFECTS",
    "LEARNT",
    "OUTSIDERS",
    "diagnosed",
    "make",
    "motions_of",
    "names",
    "plain",
    "recording_of",
    "small",
]

SMALL = {"rows": 4, "cols": 3, "rate": 20, "duration": 6.0}


def recording_of(case):
    return Recording(case.time, case.measured, case.simulated, case.covariates, case.episode)


def small(*causes, seed, **options):
    """Return a recording of 4x3 taxels at 20 Hz in eight short episodes with `causes` hidden in it."""
    case = make(causes, seed=seed, **{**SMALL, **options})
    print(f"make({causes}, seed={seed}, {options}): signal {case.signal:.3g}")
    return recording_of(case)


def plain(effect=None, seed=1, noise=0.02, **options):
    """Return a small recording of a sensor with white noise and no quantisation.

    Args:
        effect: Function of an episode's ``(force, time)`` that returns the reading; default: the force.
        seed: Random seed of the motion and the noise.
        noise: Standard deviation of the noise (N).
        options: Motion options for `hidden.cases.make`.
    """
    case = make((), seed=seed, **{**SMALL, **options})
    read = case.simulated.astype(float)
    for number in np.unique(case.episode) if effect is not None else ():
        own = case.episode == number
        read[own] = effect(read[own], case.time[own])
    read += noise * np.random.default_rng(seed).standard_normal(read.shape)
    return replace(recording_of(case), measured=read.astype(np.float32))


def diagnosed(recording, causes=None, **arguments):
    """Diagnose without scikit-learn, because the black box takes most of the time and names no causes."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("sklearn", "sklearn.ensemble"):
            patch.setitem(sys.modules, name, None)
        return paxisim.diagnose(recording, causes, **arguments)


def names(diagnosis):
    """Return the names of the named causes, or of their parts, largest gain first; see `hidden.compare.named`."""
    return list(named(diagnosis))


def motions_of(lines):
    """Return the names of the motions that the advice asks for, in order of first mention and without repeats."""
    found = {name: line for line in reversed(lines) for name, text in MOTIONS.items() if text in line}
    return tuple(sorted(found, key=lambda name: lines.index(found[name])))
