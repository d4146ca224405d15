"""The estimated time of each frame: free of jitter, in order, and right after the host was suspended."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paxisim.hw.link.sample_time import LEARNING_FRAMES, SampleClock

START = 1e5  # a machine that has been up for a day
SETTLED = 2 * LEARNING_FRAMES
LATEST = 0.008  # s; a longer delay, close to a period, is indistinguishable from a lost frame


def estimates(arrivals, clock=None, behind=None):
    """Estimate the times of all arrivals and check that they are in order and not after the arrivals.

    `behind` is the number of frames that were queued behind each arrival.
    """
    clock = clock or SampleClock()
    queued = np.zeros(len(arrivals), dtype=int) if behind is None else behind
    times = np.array([clock.estimate(*item) for item in zip(arrivals.tolist(), queued.tolist(), strict=True)])
    assert np.all(times <= arrivals)
    assert np.all(np.diff(times) >= 0)
    return times


def ticks(count, rate):
    return START + np.arange(count) / rate


def delayed(measured, delay):
    """Arrivals in order, since frames cannot overtake each other."""
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
def test_a_steady_clock_is_freed_of_jitter(seed, kind, scale, drift, latency, lost):
    rng = np.random.default_rng(seed)
    measured = ticks(2000, 83 * (1 + drift))
    came = rng.random(len(measured)) >= lost
    jitter = np.minimum(JITTERS[kind](rng, scale, len(measured)), LATEST)
    arrivals = delayed(measured, latency + jitter)[came]
    error = (estimates(arrivals) - measured[came])[SETTLED:]
    assert error.std() <= (arrivals - measured[came])[SETTLED:].std() / 3
    # the latency common to all frames is unobservable and remains
    assert abs(np.median(error) - latency) < scale / 3


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 0.5), st.integers(1, 60)), min_size=1, max_size=40))
def test_any_queues_give_times_in_order_and_not_after_them(reads):
    arrivals = START + np.repeat(np.cumsum([interval for interval, _ in reads]), [count for _, count in reads])
    estimates(arrivals, behind=np.concatenate([np.arange(count)[::-1] for _, count in reads]))


def test_slow_drift_is_followed():
    rng = np.random.default_rng(1)
    # the rate swings by 100 ppm within two and a half minutes
    periods = (1 + 1e-4 * np.sin(np.arange(12_000) / 2000)) / 83
    measured = START + np.cumsum(periods)
    arrivals = delayed(measured, np.minimum(rng.exponential(1e-3, len(measured)), LATEST))
    error = (estimates(arrivals) - measured)[SETTLED:]
    assert error.std() < 1e-4
    assert np.all(np.abs(error) < 3e-4)


def test_gaps_are_survived():
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


def test_a_new_rate_is_learnt():
    rng = np.random.default_rng(3)
    measured = START + np.cumsum(np.repeat([1 / 83, 1 / 91, 1 / 60], 1500))
    arrivals = delayed(measured, rng.exponential(5e-4, len(measured)))
    clock = SampleClock()
    error = estimates(arrivals, clock) - measured
    for first in (0, 1500, 3000):
        assert error[first + 1000 : first + 1500].std() < 1e-4
    # never off by more than a period, even while the rate changes
    assert np.all(np.abs(error) < 1 / 60)
    assert clock.period == pytest.approx(1 / 60, rel=1e-3)


@pytest.mark.parametrize("case", ["asked for", "by load", "asked for fast"])
def test_where_no_steady_clock_is_the_time_is_the_arrival(case):
    rng = np.random.default_rng(4)
    if case == "asked for":  # each request waits for the previous reply
        intervals = 0.012 + rng.exponential(1.5e-3, 5000)
    elif case == "asked for fast":
        intervals = 0.0025 + rng.exponential(3e-4, 5000)
    else:  # one sensor on USB, alternately idle and loaded
        loaded = np.repeat(rng.random(100) < 0.5, 50)
        intervals = np.where(loaded, rng.uniform(0.067, 0.09, 5000), rng.uniform(0.008, 0.05, 5000))
    arrivals = START + np.cumsum(intervals)
    np.testing.assert_array_equal(estimates(arrivals), arrivals)


def test_first_frames_are_the_arrivals():
    clock = SampleClock()
    arrivals = delayed(ticks(LEARNING_FRAMES, 83), np.random.default_rng(5).exponential(1e-3, LEARNING_FRAMES))
    assert clock.period is None
    np.testing.assert_array_equal(estimates(arrivals, clock), arrivals)
    assert clock.period == pytest.approx(1 / 83, rel=0.01)


def test_reset_forgets_the_rate_and_keeps_the_order():
    clock = SampleClock()
    last = estimates(ticks(500, 83), clock)[-1]
    clock.reset()
    assert clock.period is None
    np.testing.assert_array_equal(estimates(last + np.arange(50) * 0.02, clock), last + np.arange(50) * 0.02)


def stalled(measured, stalls, jitter, kept=10**6):
    """Simulate a host that stalls.

    Args:
        measured: Measurement times of the frames (s).
        stalls: Start and length (s) of each stall.
        jitter: Delay of each frame (s).
        kept: Capacity of the queue in frames; frames that arrive when it is full are lost.

    Returns:
        Arrivals (s), number of frames queued behind each arrival, and a mask of the frames of `measured` that arrived.
    """
    arrivals = delayed(measured, jitter)
    behind = np.zeros(len(measured), dtype=int)
    came = np.ones(len(measured), dtype=bool)
    for begin, length in stalls:
        waiting = np.flatnonzero((arrivals >= begin) & (arrivals < begin + length))
        came[waiting[kept:]] = False
        waiting = waiting[:kept]
        arrivals[waiting] = begin + length
        behind[waiting] = np.arange(len(waiting))[::-1]
    return arrivals[came], behind[came], came


def test_frames_that_waited_for_a_stalled_host_are_dated_back():
    rng = np.random.default_rng(6)
    for rate, begin, length in itertools.product((83.0, 91.0, 125.0), (0.5, 3.0, 10.0), (0.05, 0.3, 0.6, 1.6)):
        measured = ticks(1500, rate)
        stalls = [(START + begin, length), (START + begin + 4.0, length)]
        arrivals, behind, _ = stalled(measured, stalls, rng.exponential(3e-4, len(measured)))
        error = np.abs(estimates(arrivals, behind=behind) - measured)
        assert error.max() < 0.015, (rate, begin, length)
        # once the rate is known, the estimates are accurate
        assert begin <= 3.0 or error[arrivals > START + 3.0].max() < 2e-3, (rate, begin, length)


def test_what_did_not_fit_into_the_queue_was_lost_behind_it():
    rng = np.random.default_rng(7)
    measured = ticks(2000, 125)
    arrivals, behind, came = stalled(measured, [(START + 8.0, 1.6)], rng.exponential(3e-4, 2000), kept=90)
    assert came.sum() < 2000 - 100
    error = estimates(arrivals, behind=behind) - measured[came]
    assert np.abs(error[SETTLED:]).max() < 2e-3


def test_a_port_that_always_brings_several_frames_gives_no_nonsense():
    rng = np.random.default_rng(8)
    measured = ticks(6000, 83)
    for every in (0.016, 0.1):
        arrivals = START + np.ceil((measured - START) / every) * every
        behind = np.array([np.searchsorted(arrivals, at, "right") - i - 1 for i, at in enumerate(arrivals)])
        error = estimates(arrivals + rng.uniform(0, 1e-4), behind=behind) - measured
        assert np.all(error[SETTLED:] > -0.03)
        assert np.all(error[SETTLED:] < 0.03)
