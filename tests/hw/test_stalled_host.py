"""A host suspended for a while (SIGSTOP) reports correct times and no missing frames once it runs again."""

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from emulated import profile, small

pytest.importorskip("serial")

from paxisim.hw.emulation.emulator import Emulator, make_board
from paxisim.hw.emulation.faults import Faults, FaultyLine
from paxisim.hw.emulation.pads import EmulatedPads
from paxisim.hw.families.control_box.driver import ControlBox
from paxisim.hw.families.serial_converter.driver import SerialConverter
from paxisim.logs.mcap_records import McapRecords

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="no SIGSTOP here"),
]

HOST = """
import json, sys, time
from paxisim.hw.device import open_sensor
import test_stalled_host
chosen = test_stalled_host.PROFILES[sys.argv[2]]()
with open_sensor(sys.argv[1], chosen, queue=100_000) as sensor:
    sensor.read(20.0)
    skipped = sensor.skipped
    print("open", flush=True)
    frames, end = [], time.monotonic() + float(sys.argv[3])
    while time.monotonic() < end:
        frames.append(sensor.read(20.0))
    said = [sensor.dropped, sensor.timeouts, sensor.bad_checksums, sensor.skipped - skipped, sensor.reconnects]
flagged = [f.time_error for f in frames]
numbers = [[f.time, f.sequence, *f.force[:, 2, 0, :2].ravel().tolist()] for f in frames]
print(json.dumps([said, numbers, flagged]))
"""
RECORDER = """
import json, sys
from paxisim.hw.capture.capture import capture
from paxisim.hw.device import open_sensor
import test_stalled_host
with open_sensor(sys.argv[1], test_stalled_host.PROFILES[sys.argv[2]]()) as sensor:
    print("open", flush=True)
    said = capture(sensor, sys.argv[3], seconds=4.2)
print(json.dumps([said.gaps, said.longest_gap, said.dropped, said.frames, said.uncertain, said.longest_stall]))
"""
PROFILES = {
    "high-speed": lambda: profile("gen3-highspeed-mc-m2020"),
    "hand-board": lambda: profile("gen1-stream"),
    "serial-converter": lambda: profile("gen3-serial-mc-m2020"),
    "control-box": lambda: small(
        "control-box", [("left", 0), ("right", 1)], settings={"mode": 5}, axes=("+x", "+y", "+z")
    ),
}
TICK = 1e-3
"""Resolution of the time that the signal encodes (s)."""


class Ticking:
    """Forces that encode the time in ticks: low base-250 digit in the first taxel's normal force, high in the second's.

    Attributes:
        start: The emulator's time 0 on the machine's monotonic clock (s).
    """

    def __init__(self, chosen):
        self._force = np.zeros((len(chosen.slots), *chosen.wire_layout.shape))
        self.start = math.inf

    def __call__(self, now):
        if now > 0:  # the emulator evaluates the signal once before it starts
            self.start = min(self.start, time.monotonic() - now)
        ticks = round(now / TICK)
        self._force[:, 2, 0, 0] = ticks % 250 * 0.1
        self._force[:, 2, 0, 1] = ticks // 250 % 250 * 0.1
        return self._force


def run_stopped(script, port, name, stalls, more):
    """Run a script in its own process, suspend it for each ``(wait, length)`` (s), and return its JSON output."""
    paths = os.pathsep.join([os.path.dirname(__file__), *filter(None, sys.path)])
    command = [sys.executable, "-W", "ignore", "-c", script, port, name, str(more)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": paths}) as host:
        killer = threading.Timer(60.0, host.kill)
        killer.start()
        assert host.stdout is not None
        assert host.stdout.readline() == "open\n"
        for wait, length in stalls:
            time.sleep(wait)
            host.send_signal(signal.SIGSTOP)
            time.sleep(length)
            host.send_signal(signal.SIGCONT)
        said = json.loads(host.communicate()[0])
        killer.cancel()
    return said


def watch(name, stalls, seconds):
    """Read an emulated board from a host that is suspended.

    Returns:
        The host's counters, the frames' sequence numbers, the ``(frames, pads)`` errors (s) of the frame times:
        positive if later than the pad's measurement, and the frames' stated time errors (s).
    """
    chosen = PROFILES[name]()
    clock = Ticking(chosen)
    with Emulator(chosen, clock, gate=0) as board:
        said, frames, flagged = run_stopped(HOST, board.port, name, stalls, seconds)
        assert board.overruns == 0
    frames = np.array(frames)
    measured = clock.start + (np.round(frames[:, 2::2] * 10) + 250 * np.round(frames[:, 3::2] * 10)) * TICK
    return said, frames[:, 1], frames[:, :1] - measured, np.array(flagged)


SLOW = pytest.mark.slow


LONG = [(0.8, 0.3), (2.0, 0.6), (0.7, 1.6)]


@pytest.mark.parametrize(
    ("name", "stalls", "seconds"),
    [
        ("high-speed", [(0.8, 0.3), (2.0, 1.2)], 5.0),
        *(pytest.param(name, LONG, 6.8, marks=SLOW, id=f"{name} at length") for name in PROFILES),
    ],
)
def test_after_a_stall_nothing_is_dated_wrongly_or_said_to_be_missing(name, stalls, seconds):
    said, numbers, errors, flagged = watch(name, stalls, seconds)
    assert np.all((np.abs(errors).max(axis=1) < 0.1) | (np.abs(errors).max(axis=1) <= flagged + 0.1))
    assert np.abs(errors).max() <= 0.02
    assert said == [0, 0, 0, 0, 0]
    assert np.all(np.diff(numbers) == 1)


@pytest.mark.parametrize("name", ["hand-board", pytest.param("high-speed", marks=SLOW)])
def test_a_recorder_that_was_stopped_says_no_gap_where_no_frame_is_missing(name, tmp_path):
    chosen = PROFILES[name]()
    with Emulator(chosen, Ticking(chosen)) as board:
        gaps, longest, dropped, frames, uncertain, stall = run_stopped(
            RECORDER, board.port, name, [(2.0, 0.7), (0.3, 0.7)], tmp_path / "press.mcap"
        )
    assert (gaps, dropped) == (0, 0)
    assert longest < 0.1
    assert frames > 250
    assert 50 < uncertain < 200, "frames that waited are counted, others are not"
    assert 0.6 < stall < 1.0
    assert b"time_error" in b"".join(body for _, body in McapRecords(tmp_path / "press.mcap"))


class Stalling:
    """Transport and clock of an emulated board that measures and answers after `LATENCY`; one read or sleep stalls.

    Attributes:
        now: Current time (s).
        stall: Number of reads and sleeps before the one that stalls; none stalls if it is below 0.
        length: Duration of the stalled read or sleep (s).
    """

    LATENCY = 0.05

    def __init__(self, chosen):
        self.now, self.stall, self.length = 10.0, -1, 0.0
        self._board = make_board(EmulatedPads(chosen, Ticking(chosen)), None, True, FaultyLine(Faults()))
        self._answers, self._ready = b"", 0.0

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.stall -= 1
        self.now += self.length if self.stall == -1 else seconds

    def write(self, data):
        self._ready = self.now + self.LATENCY
        self._answers += self._board.receive(data, self._ready)

    def read(self, timeout):
        self.sleep(min(timeout, max(self._ready - self.now, 1e-3)) if self._answers else timeout)
        if self.now < self._ready:
            return b""
        data, self._answers = self._answers + self._board.tick(self.now), b""
        return data

    def discard_input(self):
        self._answers = b""


@pytest.mark.parametrize("length", [0.3, 0.6, 1.6])
@pytest.mark.parametrize("family", [SerialConverter, ControlBox], ids=["serial-converter", "control-box"])
def test_a_reply_that_waited_is_asked_for_again_and_the_time_does_not_count(family, length):
    chosen = PROFILES["serial-converter" if family is SerialConverter else "control-box"]()
    for stall in range(10):
        line = Stalling(chosen)
        board = family(line, chosen, line)
        board.start()
        line.stall, line.length = stall, length
        for _ in range(6):
            reading = board.read(0.5)
            low, high = np.round(chosen.to_force(reading.counts)[:, 2, 0, :2].T * 10)
            # a box measures its pads one after the other, with two requests each
            np.testing.assert_allclose(reading.time, (low + 250 * high) * TICK, atol=0.02 + 2 * line.LATENCY)
        assert line.stall < -1
