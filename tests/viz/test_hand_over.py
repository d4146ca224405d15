"""The queue between a reader that must not wait and a drawing consumer that may be slow."""

import itertools
import threading

import pytest

from paxisim.errors import InvalidValueError
from paxisim.viz.hand_over import HandOver

LONG = 30.0  # s: longer than any step here takes, even on a slow machine


class Consumer:
    """Consumer that records the values it receives and can be blocked."""

    def __init__(self):
        self.batches, self.counts = [], []
        self.busy, self.go = threading.Event(), threading.Event()
        self.go.set()

    def __call__(self, values, given):
        self.busy.set()
        assert self.go.wait(LONG)
        self.batches.append(values)
        self.counts.append(given)


def held_up(**options):
    """Return a consumer blocked on the value 0 until `go` is set, and its queue."""
    consumer = Consumer()
    consumer.go.clear()
    queue = HandOver(consumer, **options)
    queue.put(0)
    assert consumer.busy.wait(LONG)
    return consumer, queue


def test_a_slow_consumer_costs_the_oldest_values_and_never_a_wait():
    consumer, queue = held_up(size=3)
    for value in range(1, 100):  # would block forever if `put` waited for the consumer
        queue.put(value)
    assert (queue.given, queue.dropped) == (100, 96)
    consumer.go.set()
    queue.close()
    assert consumer.batches == [[0], [97, 98, 99]]
    assert consumer.counts == [1, 100]
    assert queue.taken == 4


def test_beyond_the_rate_values_are_left_out_evenly():
    consumer, queue = held_up(size=1000, period=0.0, rate=100.0)
    for value in range(1, 1001):
        queue.put(value)
    consumer.go.set()
    queue.close()
    chosen = consumer.batches[1]
    assert 90 <= len(chosen) <= 100  # the number allowed in one second
    assert chosen[-1] == 1000
    steps = {b - a for a, b in itertools.pairwise(chosen)}
    assert max(steps) - min(steps) <= 1
    assert queue.taken + queue.dropped == queue.given == 1001


def fail(values, given):
    raise OSError("no room")


def test_what_the_consumer_raises_reaches_the_producer_once():
    def put_for_ever(queue):
        for value in itertools.count():
            queue.put(value, wait=True)  # must not wait for a consumer that has given up

    queue = HandOver(fail, size=2)
    with pytest.raises(OSError, match="no room"):
        put_for_ever(queue)
    queue.close()
    queue = HandOver(fail, size=2)
    queue.put(1)
    with pytest.raises(OSError, match="no room"):
        queue.close()


def test_what_was_closed_takes_nothing_more():
    consumer = Consumer()
    queue = HandOver(consumer, size=1)
    queue.close()
    queue.close()
    for wait in (False, True, True):  # one more than fits: would block forever
        with pytest.raises(InvalidValueError, match="was closed"):
            queue.put(1, wait)
    assert (queue.given, queue.dropped, consumer.batches) == (0, 0, [])


def test_a_producer_that_waits_is_let_go_when_another_thread_closes():
    consumer, queue = held_up(size=1)
    queue.put(1)
    closing = threading.Thread(target=queue.close)
    closing.start()
    with pytest.raises(InvalidValueError, match="was closed"):
        queue.put(2, wait=True)
    consumer.go.set()
    closing.join(LONG)
    assert consumer.batches == [[0], [1]]
