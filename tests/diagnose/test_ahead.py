"""Either stream of a recording may be the late one: a latency below 0 is named as one."""

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from hidden.practice.cases import make
from recorded import recording_of

from paxisim.diagnose.engine import explain

SMALL = {"rows": 4, "cols": 3, "duration": 6.0}


def late_simulation(case, delay):
    """The case with its simulated stream `delay` seconds late, each episode by itself."""
    late = case.simulated.astype(float)
    for number in np.unique(case.episode):
        here = np.flatnonzero(case.episode == number)
        time, force = case.time[here], late[here].reshape(len(here), -1)
        moved = np.stack([np.interp(time - delay, time, channel) for channel in force.T], axis=1)
        late[here] = moved.reshape(late[here].shape)
    return dataclasses.replace(case, simulated=late)


@pytest.mark.parametrize(("seed", "delay"), [(901, 0.04), (902, 0.12), (903, 0.04)])
def test_a_late_simulation_is_a_latency_below_zero(seed, delay):
    case = late_simulation(make((), seed=seed, **SMALL), delay)
    found = explain(recording_of(case)).found
    assert [item.name for item in found] == ["latency"]
    assert found[0].values["delay"] == pytest.approx(-delay, rel=0.1)
