"""Frames of several ports joined to one: those nearest in time go together, and none waits for a silent port."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from paxisim import Frame
from paxisim.hw.link.frame_joiner import MAX_AGE, MAX_KEPT_FRAMES, STALE_STATUS, FrameJoiner


def frame(time, value=0.0, *, status=0, resultant=True, late=0.0):
    """A frame of one pad of 2x2 taxels."""
    force = np.full((1, 3, 2, 2), value, np.float32)
    total = np.full((1, 3), value, np.float32) if resultant else None
    return Frame(force, time, time + late, 0, (status,), total)


def values(joined):
    """The value of each pad."""
    return joined.force[:, 0, 0, 0].tolist()


def test_frames_nearest_in_time_go_together():
    joiner = FrameJoiner(2)
    assert joiner.push(1, frame(0.98, 1)) == []
    assert joiner.push(0, frame(1.00, 10)) == []
    (joined,) = joiner.push(1, frame(1.01, 2, late=0.5))
    assert values(joined) == [10, 2]
    assert joined.force.shape == (2, 3, 2, 2)
    assert joined.force.dtype == np.float32
    assert (joined.time, joined.arrival, joined.sequence, joined.status) == (1.00, 1.51, 0, (0, 0))
    assert joined.resultant is not None
    np.testing.assert_array_equal(joined.resultant, [[10, 10, 10], [2, 2, 2]])
    joiner.push(1, frame(1.03, 3))
    joiner.push(0, frame(1.05, 11))
    (joined,) = joiner.push(1, frame(1.09, 4))
    assert values(joined) == [11, 3]
    assert joined.sequence == 1


def test_a_port_that_is_ahead_completes_a_frame_at_once():
    joiner = FrameJoiner(2)
    joiner.push(1, frame(1.0, 1))
    joiner.push(1, frame(2.0, 2))
    (joined,) = joiner.push(0, frame(1.9, 5))
    assert values(joined) == [5, 2]
    joiner.push(0, frame(2.1, 6))
    # completes the waiting frame; port 1 is then far ahead, so the next frame is joined at once
    joiner.push(1, frame(9.0, 3))
    assert [values(j) for j in joiner.push(0, frame(8.9, 7))] == [[7, 3]]


def test_a_port_that_fell_silent_is_marked_and_its_last_frame_kept():
    joiner = FrameJoiner(2)
    joiner.push(1, frame(1.0, 7, status=3))
    got = [joined for i in range(1, 30) for joined in joiner.push(0, frame(1 + i / 50, i, status=1))]
    assert [values(joined) for joined in got] == [[i, 7] for i in range(1, 29)]
    for i, joined in enumerate(got, 1):
        assert joined.status == (1, 3 if i / 50 <= MAX_AGE else STALE_STATUS)
    (back,) = joiner.push(1, frame(1.6, 8))
    assert back.status == (1, 0)


def test_a_resultant_that_one_port_lacks_and_clear():
    joiner = FrameJoiner(2)
    joiner.push(1, frame(1.0, resultant=False))
    assert joiner.push(0, frame(1.0))[0].resultant is None
    joiner.push(0, frame(1.1))
    joiner.clear()
    assert joiner.push(0, frame(1.2)) == []
    assert joiner.push(0, frame(1.3)) == []


def test_a_silent_first_port_makes_nothing_grow():
    joiner = FrameJoiner(2)
    for i in range(10 * MAX_KEPT_FRAMES):
        assert joiner.push(1, frame(i / 100, i)) == []
    assert len(joiner._others[0]) == MAX_KEPT_FRAMES
    (joined,) = joiner.push(0, frame(10 * MAX_KEPT_FRAMES / 100 - 0.5, 1))
    assert abs(values(joined)[1] / 100 - joined.time) < 0.01


@settings(max_examples=50, deadline=None)
@given(
    periods=st.lists(st.floats(0.005, 0.05), min_size=2, max_size=4),
    phases=st.lists(st.floats(0, 0.05), min_size=4, max_size=4),
    delays=st.lists(st.floats(0, 0.004), min_size=4, max_size=4),
)
def test_steady_ports_give_each_frame_of_the_first_with_the_nearest_of_the_others(periods, phases, delays):
    times = [phase + np.arange(0, 1, period) for period, phase in zip(periods, phases, strict=False)]
    events = sorted(
        (time + delays[port], port, time) for port, measured in enumerate(times) for time in measured.tolist()
    )
    joiner = FrameJoiner(len(periods))
    got = [joined for _, port, time in events for joined in joiner.push(port, frame(time, time))]
    assert [joined.sequence for joined in got] == list(range(len(got)))
    # each frame once, in order, except those before all ports have sent and the last, which may still be waiting
    begun = max(measured[0] for measured in times)
    joined_times = [joined.time for joined in got]
    assert set(times[0][(times[0] > begun + 0.05) & (times[0] < 0.9)].tolist()) <= set(joined_times)
    assert joined_times == sorted(set(joined_times))
    for joined in got:
        for part, measured, period in zip(values(joined), times, periods, strict=True):
            off = abs(part - joined.time)
            nearest = np.abs(measured - joined.time).min()
            # the nearest frame, unless it arrives after the next frame of the first port
            assert off <= nearest + 1e-6 or nearest + 0.004 >= periods[0] or off <= period + 1e-6
            assert STALE_STATUS not in joined.status


def test_frames_that_waited_for_a_stalled_host_go_together_as_they_were_measured():
    joiner = FrameJoiner(2)
    joiner.push(1, frame(0.9, 0))
    joined = []
    for port in (0, 1):
        for i in range(60):
            time = 1 + 0.01 * i + 0.004 * port
            joined += joiner.push(port, frame(time, i, late=1.7 - time))
    joined += joiner.push(0, frame(1.8, 60))
    assert [values(one) for one in joined] == [[i, i] for i in range(60)]
    assert {one.status for one in joined} == {(0, 0)}
    assert [one.sequence for one in joined] == list(range(60))
