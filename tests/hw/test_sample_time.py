import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from paxisim.hw.sample_time import LEARN, SampleClock

START = 1e5  # a machine that runs for a day
SETTLED = 2 * LEARN
LATEST = 0.008  # s; a delay of most of a period cannot be told from a lost frame


def estimates(arrivals: NDArray[np.float64], clock: SampleClock | None = None) -> NDArray[np.float64]:
    """Of all arrivals; the promises that always hold are checked."""
    clock = clock or SampleClock()
    times = np.array([clock.estimate(arrival) for arrival in arrivals.tolist()])
    assert np.all(times <= arrivals)
    assert np.all(np.diff(times) >= 0)
    return times


def ticks(count: int, rate: float) -> NDArray[np.float64]:
    return START + np.arange(count) / rate


def delayed(measured: NDArray[np.float64], delay: NDArray[np.float64]) -> NDArray[np.float64]:
    """Arrivals in order: a frame cannot overtake another."""
    return np.maximum.accumulate(measured + delay)


JITTERS = {
    "exponential": lambda rng, scale, count: rng.exponential(scale, count),
    "half normal": lambda rng, scale, count: np.abs(rng.normal(0, scale, count)),
    "uniform": lambda rng, scale, count: rng.uniform(0, 3 * scale, count),
}


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    kind=st.sampled_from(sorted(JITTERS)),
    scale=st.floats(1e-4, 1e-3),
    drift=st.floats(-1e-4, 1e-4),
    latency=st.floats(0, 0.02),
    lost=st.sampled_from([0, 0.01]),
)
def test_a_steady_clock_is_freed_of_jitter(
    seed: int, kind: str, scale: float, drift: float, latency: float, lost: float
) -> None:
    rng = np.random.default_rng(seed)
    measured = ticks(2000, 83 * (1 + drift))
    came = rng.random(len(measured)) >= lost
    jitter = np.minimum(JITTERS[kind](rng, scale, len(measured)), LATEST)
    arrivals = delayed(measured, latency + jitter)[came]
    error = (estimates(arrivals) - measured[came])[SETTLED:]
    assert error.std() <= (arrivals - measured[came])[SETTLED:].std() / 3
    # what all frames share cannot be seen and stays
    assert abs(np.median(error) - latency) < scale / 3


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(0, 2, allow_subnormal=False), min_size=1, max_size=400))
def test_any_arrivals_give_times_in_order_and_not_after_them(intervals: list[float]) -> None:
    estimates(START + np.cumsum(intervals))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0, 0.3), st.floats(0, 0.1), st.floats(0, 0.2))
def test_a_disturbed_clock_gives_times_in_order(seed: int, jitter: float, lost: float, stall: float) -> None:
    rng = np.random.default_rng(seed)
    measured = ticks(1000, 83)
    delay = rng.exponential(jitter / 83, 1000) + stall * (rng.random(1000) < 0.02)
    estimates(delayed(measured, delay)[rng.random(1000) >= lost])


def test_slow_drift_is_followed() -> None:
    rng = np.random.default_rng(1)
    # the rate swings by 100 ppm within two and a half minutes
    periods = (1 + 1e-4 * np.sin(np.arange(12_000) / 2000)) / 83
    measured = START + np.cumsum(periods)
    arrivals = delayed(measured, np.minimum(rng.exponential(1e-3, len(measured)), LATEST))
    error = (estimates(arrivals) - measured)[SETTLED:]
    assert error.std() < 1e-4
    assert np.all(np.abs(error) < 3e-4)


def test_gaps_are_survived() -> None:
    rng = np.random.default_rng(2)
    measured = ticks(3000, 90)
    came = np.ones(3000, dtype=bool)
    for first, count in ((500, 1), (700, 2), (900, 30), (1500, 100), (2200, 7)):
        came[first : first + count] = False
    arrivals = delayed(measured, rng.uniform(0, 2e-3, 3000))[came]
    clock = SampleClock()
    error = (estimates(arrivals, clock) - measured[came])[SETTLED:]
    assert error.std() < 1e-4
    assert clock.period == pytest.approx(1 / 90, rel=1e-3)


def test_a_new_rate_is_learnt() -> None:
    rng = np.random.default_rng(3)
    measured = START + np.cumsum(np.repeat([1 / 83, 1 / 91, 1 / 60], 1500))
    arrivals = delayed(measured, rng.exponential(5e-4, len(measured)))
    clock = SampleClock()
    error = estimates(arrivals, clock) - measured
    for first in (0, 1500, 3000):
        assert error[first + 1000 : first + 1500].std() < 1e-4
    # never off by more than a period, not even while it changes
    assert np.all(np.abs(error) < 1 / 60)
    assert clock.period == pytest.approx(1 / 60, rel=1e-3)


@pytest.mark.parametrize("case", ["asked for", "by load", "asked for fast"])
def test_where_no_steady_clock_is_the_time_is_the_arrival(case: str) -> None:
    rng = np.random.default_rng(4)
    if case == "asked for":  # each request waits for the reply before it
        intervals = 0.012 + rng.exponential(1.5e-3, 5000)
    elif case == "asked for fast":
        intervals = 0.0025 + rng.exponential(3e-4, 5000)
    else:  # one sensor on USB: idle and loaded by turns
        loaded = np.repeat(rng.random(100) < 0.5, 50)
        intervals = np.where(loaded, rng.uniform(0.067, 0.09, 5000), rng.uniform(0.008, 0.05, 5000))
    arrivals = START + np.cumsum(intervals)
    np.testing.assert_array_equal(estimates(arrivals), arrivals)


def test_bursts_give_no_nonsense() -> None:
    measured = ticks(4000, 83)
    arrivals = START + np.ceil((measured - START) / 0.1) * 0.1  # a port that delivers ten times a second
    times = estimates(arrivals)
    assert np.all(times > measured - 0.1)


def test_first_frames_are_the_arrivals() -> None:
    clock = SampleClock()
    arrivals = delayed(ticks(LEARN, 83), np.random.default_rng(5).exponential(1e-3, LEARN))
    assert clock.period is None
    np.testing.assert_array_equal(estimates(arrivals, clock), arrivals)
    assert clock.period == pytest.approx(1 / 83, rel=0.01)


def test_reset_forgets_the_rate_and_keeps_the_order() -> None:
    clock = SampleClock()
    last = estimates(ticks(500, 83), clock)[-1]
    clock.reset()
    assert clock.period is None
    np.testing.assert_array_equal(estimates(last + np.arange(50) * 0.02, clock), last + np.arange(50) * 0.02)
