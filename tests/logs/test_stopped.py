"""A stream that stops while the other goes on is detected; rest, held loads and coarse counts are no stop."""

from dataclasses import replace

import numpy as np
import pytest

from paxisim.diagnose.pipeline import diagnose
from paxisim.errors import InvalidValueError
from paxisim.logs import stopped as module
from paxisim.recording import Recording

TIME = np.arange(0, 40, 0.02)


def stopped_in_words(recording):
    return module.stopped_in_words(recording.time, recording.measured, recording.simulated)


def presses(noise=0.01, step=0.0, seed=0):
    """Return eight presses on a pad of 2x2 taxels, at rest in between."""
    rng = np.random.default_rng(seed)
    course = np.maximum(np.sin(2 * np.pi * TIME / 5), 0) ** 2 * (TIME % 5 < 2.5)
    force = course[:, None, None, None, None] * rng.uniform(0.5, 2, (1, 1, 3, 2, 2))
    measured = 0.8 * force + noise * rng.standard_normal(force.shape)
    measured = np.round(measured / step) * step if step else measured
    episode = (TIME // 5).astype(int)
    return Recording(TIME, measured.astype(np.float32), force.astype(np.float32), {}, episode)


def stopped(recording, name, begin, end):
    values = getattr(recording, name).copy()
    first, last = np.searchsorted(TIME, [begin, end])
    values[first:last] = values[first]
    return replace(recording, **{name: values})


@pytest.mark.parametrize("name", ["measured", "simulated"])
@pytest.mark.parametrize(("begin", "end"), [(21.0, 41.0), (11.2, 22.0)])
def test_a_stream_that_stops_is_refused_with_the_time(name, begin, end):
    words = f"^{name} does not change from {begin:.2f} to .*leave these samples out"
    with pytest.raises(InvalidValueError, match=words):
        diagnose(stopped(presses(), name, begin, end))


def test_a_short_stop_is_reported():
    words, share = stopped_in_words(stopped(presses(), "measured", 11.2, 14.0))
    assert words.startswith("measured does not change from 11.20 to 13.98 s")
    assert share == pytest.approx(2.8 / 40, abs=0.005)


def test_rest_coarse_counts_a_free_simulation_and_a_held_load_are_no_stop():
    for options in ({}, {"noise": 0.0}, {"step": 0.1}, {"step": 0.5, "noise": 0.0}):
        assert stopped_in_words(presses(**options)) == ("", 0.0), options
    recording = presses()
    free = recording.simulated.copy()
    free[TIME > 20] = 0
    assert stopped_in_words(replace(recording, simulated=free)) == ("", 0.0)
    held, other = recording.simulated.copy(), recording.measured.copy()
    held[1000:1400] = held[60]
    noise = np.random.default_rng(1).standard_normal(other[1000:1400].shape) * 0.01
    other[1000:1400] = 0.8 * held[60] + noise
    assert stopped_in_words(replace(recording, simulated=held, measured=other)) == ("", 0.0)
