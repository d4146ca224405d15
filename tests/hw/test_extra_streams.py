"""Extra streams from real pipes, sockets and functions: samples, their times, and refused and counted input."""

import itertools
import json
import os
import queue
import re
import socket
import threading
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from serial_peers import wait_for

import paxisim
from paxisim.hw.capture.extra_streams import (
    MAX_LINE_BYTES,
    MAX_NAMES,
    CsvLines,
    PolledFunction,
    UdpJson,
    load_function,
)
from paxisim.hw.link.clock import SystemClock

pytestmark = pytest.mark.real_time


def drain(inbox):
    samples = []
    while not inbox.empty():
        samples.append(inbox.get())
    return samples


def lines(data, pieces=1):
    """Write the bytes into a pipe in pieces, close it, and return the `CsvLines` source and its samples."""
    inbox = queue.Queue(100_000)
    reader, writer = os.pipe()
    source = CsvLines(reader)
    try:
        source.start(inbox, SystemClock())
        for part in np.array_split(np.frombuffer(data, np.uint8), pieces):
            os.write(writer, part.tobytes())
        os.close(writer)
        wait_for(lambda: source.ended)
    finally:
        source.close()
        os.close(reader)
    return source, drain(inbox)


@pytest.fixture
def udp():
    source = UdpJson(0)
    yield source
    source.close()


def test_lines_become_one_stream_a_column_at_their_arrival_or_own_time():
    before = time.monotonic()
    source, samples = lines(b"gripper, motor current (A)\r\n0.04,1.5\r\n\r\n0.03,-2e-3\n")
    assert [(s.stream, float(s.value)) for s in samples] == [
        ("covariate/gripper", 0.04),
        ("covariate/motor current (A)", 1.5),
        ("covariate/gripper", 0.03),
        ("covariate/motor current (A)", -2e-3),
    ]
    assert all(before <= s.arrival <= time.monotonic() and s.time is None for s in samples)
    assert (source.bad, source.dropped, source.ended, source.problem) == (0, 0, True, "")
    now = time.time()
    _, samples = lines(f"\ufefftime,gripper\n{now:.6f},0.04\n".encode())
    assert [(s.stream, s.time) for s in samples] == [("covariate/gripper", pytest.approx(now, abs=1e-6))]


# text, good samples, bad lines, what is said of the last bad one
LINES = [
    (b"a,b\n1,2\n1\n3,4\n", 4, 1, r"stdin: line 3 must have 2 numbers \(a, b\), got '1'"),
    (b"a\n1\ntwo\nnan\n\ninf\n2\n", 2, 3, "line 6 must hold finite numbers, got 'inf'"),
    (b"1,2\na,b\n3,4\n", 2, 1, "line 1 must name the columns, each once, got '1,2'"),
    (b"a,a\na,b\n3,4\n", 2, 1, "each once"),
    (b"time\n1\n", 0, 2, "must name the columns"),
    (b"a\n1\n2.34", 1, 1, "line 3 has no end: '2.34'"),
    (b"time,a\n12.5,1\n", 0, 1, "Unix seconds within a day of this machine's clock, got 12.5"),
    (b"a\n\xff\xfe\n1\n", 1, 1, "line 2 must hold finite numbers"),
    (b"a\n" + b"1" * (3 * MAX_LINE_BYTES) + b"\n1\n", 1, 1, "line 2 has no end"),
    (b'"a"\n"1"\n2\n', 2, 0, ""),
    (b"a\n1\r2\x00\n2\n", 1, 1, "line 2 must hold finite numbers"),
    (b"", 0, 0, ""),
]


def test_a_bad_line_is_counted_and_said_and_the_next_one_used():
    for text, good, bad, says in LINES:
        source, samples = lines(text)
        assert (len(samples), source.bad) == (good, bad), text[:40]
        assert re.search(says, source.problem), text[:40]


@settings(max_examples=30, deadline=None)
@given(st.lists(st.binary(max_size=30), max_size=8), st.integers(1, 9))
def test_any_bytes_never_end_the_lines_after_them(garbage, pieces):
    noise = b"".join(part.replace(b"\n", b"") + b"\n" for part in garbage)
    source, samples = lines(b"a,b\n" + noise + b"1,2\n", pieces)
    assert [(s.stream, float(s.value)) for s in samples[-2:]] == [("covariate/a", 1.0), ("covariate/b", 2.0)]
    assert source.bad <= len(garbage)


def test_closing_does_not_wait_for_a_line():
    reader, writer = os.pipe()
    source = CsvLines(reader)
    source.start(queue.Queue(), SystemClock())
    source.close()
    source.close()
    assert source.ended
    os.close(reader)
    os.close(writer)


def test_datagrams_land_with_their_time_and_bad_values_are_counted(udp):
    inbox = queue.Queue()
    udp.start(inbox, SystemClock())
    now = time.time()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for data in (
            json.dumps({"gripper": 0.04, "time": now}).encode(),
            b'{"gripper": 0.05, "pose": [1, 2], "open": true, "tool": "x", "nothing": null}',
            b"[1]",
            b"{",
            b"\xff",
            b'{"gripper": 1, "time": "noon"}',
            b'{"": 1, "last": 7}',
        ):
            sender.sendto(data, ("127.0.0.1", udp.port))
        wait_for(lambda: inbox.qsize() == 3)
    samples = drain(inbox)
    assert [(s.stream, float(s.value), s.time) for s in samples] == [
        ("covariate/gripper", 0.04, now),
        ("covariate/gripper", 0.05, None),
        ("covariate/last", 7.0, None),
    ]
    assert udp.bad == 4 + 3 + 1 + 1
    assert "printable name" in udp.problem


def test_a_taken_port_is_named(udp):
    with pytest.raises(paxisim.PaxisimError, match=f"cannot listen to UDP port {udp.port}"):
        UdpJson(udp.port)
    with pytest.raises(paxisim.InvalidValueError, match="from 0 to 65535, got 70000"):
        UdpJson(70000)


def polled(function, wanted, rate=200.0):
    inbox = queue.Queue()
    source = PolledFunction(function, rate, "opening")
    source.start(inbox, SystemClock())
    try:
        wait_for(lambda: inbox.qsize() >= wanted or source.bad >= wanted)
    finally:
        source.close()
    return source, drain(inbox)


def test_a_function_gives_a_number_an_array_or_a_dict():
    _, samples = polled(lambda: 0.04, 3)
    assert {(s.stream, float(s.value)) for s in samples} == {("covariate/opening", 0.04)}
    assert all(np.diff([s.arrival for s in samples]) > 0)
    _, samples = polled(lambda: np.arange(6).reshape(2, 3), 1)
    assert np.array_equal(samples[0].value, np.arange(6).reshape(2, 3))
    _, samples = polled(lambda: {"pose": [1, 2, 3], "current": np.float32(2)}, 2)
    assert [(s.stream, s.value.tolist()) for s in samples[:2]] == [
        ("covariate/pose", [1.0, 2.0, 3.0]),
        ("covariate/current", 2.0),
    ]


def test_names_without_end_are_left_out_and_counted():
    number = itertools.count()
    source, samples = polled(lambda: {f"joint{next(number)}": 1.0 for _ in range(350)}, MAX_NAMES)
    assert len({sample.stream for sample in samples}) == MAX_NAMES
    assert source.bad >= 200
    assert f"more than {MAX_NAMES} names of streams came" in source.problem


class NoArray:
    """A value that fails to convert, like a torch tensor that requires a gradient."""

    def __array__(self, *_, **__):
        raise RuntimeError("cannot be converted")


class NoText(NoArray):
    def __repr__(self):
        raise RuntimeError("cannot be shown")


@pytest.mark.parametrize("value", [NoArray(), {"pose": NoArray(), "current": 1.0}, NoText()])
def test_an_odd_value_does_not_end_the_stream(value):
    values = iter([value])
    source, samples = polled(lambda: next(values, 0.5), 3)
    assert source.bad == 1
    assert ("cannot be shown" if isinstance(value, NoText) else "must be finite numbers") in source.problem
    assert [float(s.value) for s in samples if s.stream == "covariate/opening"][-1] == 0.5
    assert [float(s.value) for s in samples if s.stream == "covariate/current"] == [1.0] * isinstance(value, dict)


def test_what_is_no_number_is_counted():
    for value in (None, "0.04", float("nan"), True, [], [1, "a"], [[1], [2, 3]], {"pose": None}):
        source, samples = polled(lambda value=value: value, 2)
        assert samples == [], value
        assert "must be finite numbers" in source.problem, value


def test_a_function_that_fails_is_called_again():
    calls = []

    def sometimes():
        calls.append(1)
        if len(calls) % 2:
            raise RuntimeError("the robot is away")
        return 1.0

    source, samples = polled(sometimes, 2)
    assert len(samples) >= 1
    assert source.problem == "opening: the call failed: RuntimeError: the robot is away"


def test_a_full_queue_drops_and_counts():
    inbox = queue.Queue(3)
    source = PolledFunction(lambda: 1.0, 1000, "opening")
    source.start(inbox, SystemClock())
    wait_for(lambda: source.dropped >= 5)
    source.close()
    assert inbox.qsize() == 3


def test_calls_for_which_a_slow_function_leaves_no_time_are_counted_and_one_that_hangs_is_left_behind():
    source, _ = polled(lambda: time.sleep(0.05) or 1.0, 4, rate=100.0)
    assert source.missed >= 3 * 4  # of five calls due while one runs, only one starts
    source, _ = polled(lambda: 1.0, 4, rate=20.0)
    assert source.missed <= 1  # one is tolerated on a busy machine
    release = threading.Event()
    source = PolledFunction(lambda: release.wait(60), 100, "opening")
    source.start(queue.Queue(), SystemClock())
    source.close()
    release.set()
    wait_for(lambda: source.ended)


def test_names_of_functions_that_are_none(tmp_path, monkeypatch):
    (tmp_path / "arm_for_test.py").write_text("number = 3\n\ndef opening():\n    return 0.04\n")
    (tmp_path / "broken_for_test.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    for text, says in [
        ("arm_for_test:opening", "module:function@HZ"),
        ("arm_for_test@50", "module:function@HZ"),
        ("arm_for_test:opening@fast", "module:function@HZ"),
        ("arm_for_test:opening@0", "above 0 and up to 1000 Hz, got 0"),
        ("arm_for_test:opening@-5", "above 0"),
        ("arm_for_test:closing@50", "no function 'closing'"),
        ("arm_for_test:number@50", "no function 'number'"),
        ("broken_for_test:f@50", "cannot import 'broken_for_test'.*ZeroDivisionError"),
        ("no_such_module_at_all:f@50", "cannot import 'no_such_module_at_all'"),
    ]:
        with pytest.raises(paxisim.InvalidValueError, match=says):
            load_function(text)
