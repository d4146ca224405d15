"""Recording a sensor to a file, with emulated boards, the driver, extra streams and real files."""

import json
import os
import signal
import socket
import threading
import time

import numpy as np
import pytest

import paxisim
from paxisim import Slot, TaxelLayout

pytest.importorskip("serial")
pytest.importorskip("termios")  # the emulator is a pseudo-terminal

from emulated import Numbered, constant, profile

from paxisim import Emulator, open_sensor
from paxisim.hw.capture.capture import capture
from paxisim.hw.capture.extra_streams import EPISODE_WORD, CsvLines, ExtraStream, PolledFunction, Sample, UdpJson
from paxisim.hw.device import ZeroInDoubtWarning
from paxisim.hw.emulation.faults import Faults
from paxisim.hw.link.clock import SystemClock
from paxisim.logs.mcap_reader import read_log

pytestmark = pytest.mark.real_time

PROFILE = profile()


@pytest.fixture
def path(tmp_path):
    return tmp_path / "press.mcap"


@pytest.fixture
def board():
    with Emulator(PROFILE, constant(PROFILE)) as emulator:
        yield emulator


@pytest.fixture
def sensor(board):
    with open_sensor(board.port, PROFILE, reconnect=0) as opened:
        yield opened


@pytest.fixture
def replugged(tmp_path):
    """A board behind a link, as the system soon reuses the number of a closed port, and its sensor, which waits."""
    with (
        Emulator(PROFILE, constant(PROFILE), link=tmp_path / "port") as board,
        open_sensor(board.port, PROFILE, reconnect=60) as sensor,
    ):
        yield board, sensor


@pytest.fixture(autouse=True)
def ctrl_c():
    """Handle Ctrl-C as at a terminal; a test run in the background would ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class Stop:
    """An `on_status` that sends Ctrl-C to this process, once, when `when(summary)` is true."""

    def __init__(self, when, seconds=30.0):
        self.when, self.deadline, self.sent = when, time.monotonic() + seconds, False

    def __call__(self, summary):
        if not self.sent and (self.when(summary) or time.monotonic() > self.deadline):
            self.sent = True
            os.kill(os.getpid(), signal.SIGINT)


class Own(ExtraStream):
    """A stream whose samples `run(put, stopped)` puts: ``put(stream, value)``."""

    def __init__(self, name, run):
        super().__init__(name)
        self.run = run

    def _run(self):
        put = lambda stream, value: self._put(Sample(self, stream, value, self._clock.monotonic()))  # noqa: E731
        self.run(put, self._stop.is_set)


# ---- what a file holds


def test_frames_land_with_their_numbers_times_and_counts(path):
    felt, forces = Numbered(PROFILE), []

    def record_what_is_felt(now):
        forces.append(felt(now).astype(np.float32))
        return forces[-1]

    before, handlers = time.time(), (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM))
    with Emulator(PROFILE, record_what_is_felt, gate=0) as board, open_sensor(board.port, PROFILE) as sensor:
        while len(sensor._queue._frames) < 20:
            time.sleep(0.01)
        newest = sensor._queue._frames[-1].sequence
        summary = capture(sensor, path, seconds=1.0)
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == handlers
    log = read_log(path)
    measured, metadata = log.streams["measured"], log.metadata
    assert log.complete
    assert (summary.ended, summary.error, summary.dropped, summary.episodes) == ("seconds", None, 0, 1)
    assert summary.frames == len(measured.time) > 10
    assert summary.size == path.stat().st_size
    assert measured.sequence[0] > newest, "frames that waited before it began are not in it"
    assert np.all(np.diff(measured.nanoseconds) >= 0)
    assert np.all(np.diff(measured.sequence) == 1)
    # the frames follow the order of the signal; a board that was delayed may send one twice
    at = 0
    for value in measured.values:
        while not np.allclose(forces[at], value, atol=1e-4):
            at += 1
    assert before < measured.time[0] <= measured.time[-1] < time.time()
    assert log.streams["episode"].values.tolist() == [0]
    assert log.streams["episode"].nanoseconds[0] == measured.nanoseconds[0]
    # the file knows the sensor
    assert TaxelLayout.from_dict(metadata["layout"]) == sensor.layout
    assert (tuple(metadata["pads"]), tuple(metadata["ports"])) == (sensor.pads, sensor.ports)
    assert (metadata["profile"], metadata["profile_verified"]) == (PROFILE.name, "in a test")


@pytest.mark.parametrize(
    ("name", "slots"),
    [
        ("gen2-box-120", (Slot("left", 2), Slot("right", 5))),
        ("gen1-stream", (Slot("pulp", 0), Slot("tip", 1))),
        ("gen3-highspeed-mc-m2020", (Slot("thumb", 2), Slot("palm", 9))),
    ],
)
def test_two_pads_on_one_port_land_with_their_totals_status_and_arrival(name, slots, path):
    from mcap.reader import make_reader

    two = profile(name, slots=slots, axes=("-y", "+x", "+z"))
    pressed = constant(two)
    with Emulator(two, pressed) as board, open_sensor(board.port, two) as sensor:
        capture(sensor, path, seconds=0.5)
    loaded = paxisim.Recording.load(path)
    assert loaded.pads == tuple(slot.name for slot in slots)
    totals = pressed(0.0).sum(axis=(-2, -1))
    everywhere = np.broadcast_to(totals, (len(loaded), 2, 3))
    np.testing.assert_allclose(loaded.measured.sum(axis=(-2, -1)), everywhere, rtol=1e-5)
    assert ("resultant" in loaded.covariates) == (name != "gen1-stream")
    if "resultant" in loaded.covariates:
        reported = np.clip(totals, [-12.7, -12.8, 0], [12.8, 12.7, 25.5])
        np.testing.assert_allclose(loaded.covariates["resultant"][-1], reported, rtol=1e-5)
    with open(path, "rb") as file:
        records = make_reader(file).iter_messages(["/tactile/measured"])
        messages = [json.loads(message.data) for _, _, message in records]
    assert messages
    for message in messages:
        measured = message["timestamp"]["sec"] + message["timestamp"]["nsec"] * 1e-9
        assert measured <= message["arrival"] + 1e-6
        assert len(message["status"]) == 2


# ---- extra streams


def test_all_kinds_of_extra_streams_land_with_their_times_and_values(sensor, path):
    reader, writer = os.pipe()
    udp, arm = UdpJson(0), PolledFunction(lambda: {"pose": [1.0, 2.0, 3.0]}, 100, "arm")
    own_time = time.time() - 5

    def feed():
        # one line at a time while frames arrive; the sources end before the recording does
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            os.write(writer, b"time,gripper\n")
            for i in range(20):
                os.write(writer, f"{own_time + i / 10},{i}\nnonsense\n".encode())
                sender.sendto(b'{"current": %d, "voltage": 2}' % i, ("127.0.0.1", udp.port))
                sender.sendto(b'{"current": "high"}', ("127.0.0.1", udp.port))
        os.close(writer)

    def everything(summary):
        lines, datagrams, calls = summary.extra
        return lines.ended and lines.samples == 20 and datagrams.samples == 20 and calls.samples > 3

    feeder = threading.Thread(target=feed)
    feeder.start()
    before = time.time()
    summary = capture(sensor, path, extra=[CsvLines(reader), udp, arm], seconds=60, on_status=Stop(everything))
    feeder.join()
    os.close(reader)
    streams = read_log(path).streams
    assert streams["covariate/gripper"].values.tolist() == list(range(20))
    assert streams["covariate/gripper"].time == pytest.approx(own_time + np.arange(20) / 10, abs=1e-6)
    assert streams["covariate/current"].values.tolist() == list(range(20))
    assert streams["covariate/voltage"].values.tolist() == [2] * 20  # of one datagram: one sample
    arrivals = streams["covariate/current"].time
    assert before - 1 < arrivals[0] <= arrivals[-1] <= before + summary.seconds + 1
    assert streams["covariate/pose"].values.tolist() == [[1.0, 2.0, 3.0]] * summary.extra[2].samples
    assert [source.bad for source in summary.extra] == [20, 20, 0]
    assert "nonsense" in summary.extra[0].problem
    assert summary.ended == "stopped"
    assert len(streams["measured"].time) == summary.frames > 0


def test_one_stream_has_one_source_and_one_shape(sensor, path):
    values, ready = iter([[1.0], [1.0, 2.0]]), threading.Event()
    first = PolledFunction(lambda: next(values, [3.0]), 50, "pose")
    second = PolledFunction(lambda: {"pose": 1.0, "resultant": 2.0} if ready.is_set() else {}, 50, "arm")

    def both_refused(summary):
        if summary.extra[0].samples:
            ready.set()
        return summary.extra[0].bad >= 1 and summary.extra[1].bad >= 2

    summary = capture(sensor, path, extra=[first, second], on_status=Stop(both_refused))
    pose = read_log(path).streams["covariate/pose"]
    assert pose.values[0] == [1.0]
    assert set(pose.values[1:, 0]) == {3.0}
    assert (summary.extra[0].bad, summary.extra[1].samples) == (1, 0)
    assert "covariate/pose must keep its shape (1,), got (2,)" in summary.extra[0].problem
    assert "arm: the name resultant is reserved" in summary.extra[1].problem


def test_episodes_begin_when_they_are_asked_for(sensor, path):
    def enter(put, stopped):
        while not stopped():
            put(EPISODE_WORD, np.zeros(()))
            time.sleep(0.05)

    summary = capture(sensor, path, extra=[Own("Enter", enter)], on_status=Stop(lambda s: s.episodes >= 3))
    episode = read_log(path).streams["episode"]
    assert summary.episodes >= 3
    assert episode.values.tolist() == list(range(summary.episodes))
    assert np.all(np.diff(episode.nanoseconds) > 0)


def test_a_flood_of_samples_is_dropped_and_counted_and_frames_go_on(sensor, path):
    def pour(put, stopped):
        for _ in range(30_000):
            put("covariate/noise", np.ones(()))

    summary = capture(sensor, path, extra=[Own("flood", pour)], on_status=Stop(lambda s: s.extra[0].ended))
    assert summary.extra[0].samples + summary.extra[0].dropped == 30_000
    assert len(read_log(path).streams["covariate/noise"].time) == summary.extra[0].samples
    assert summary.frames > 0


# ---- gaps, loss and ports that go away


def test_a_late_reader_is_told_what_is_missing(board, path):
    late = []

    def be_late(summary):
        if not late:
            late.append(1)
            time.sleep(0.8)  # longer than a one-frame queue covers
        return summary.dropped > 0

    with open_sensor(board.port, PROFILE, queue=1) as sensor:
        summary = capture(sensor, path, on_status=Stop(be_late))
    sequence = read_log(path).streams["measured"].sequence
    assert summary.dropped == int((np.diff(sequence) - 1).sum()) > 0


def test_what_never_came_whole_is_counted(path):
    with (
        Emulator(PROFILE, constant(PROFILE), faults=Faults(garble=0.02), seed=1) as board,
        open_sensor(board.port, PROFILE) as sensor,
    ):
        while not sensor.bad_checksums:
            time.sleep(0.01)
        before = sensor.bad_checksums
        summary = capture(sensor, path, on_status=Stop(lambda s: s.bad_checksums > 3))
        assert 3 < summary.bad_checksums <= sensor.bad_checksums - before


def test_a_port_that_goes_away_ends_it_with_a_whole_file(board, sensor, path):
    summary = capture(sensor, path, seconds=60, on_status=Stop(lambda s: s.frames and board.unplug()))
    assert summary.ended == "sensor"
    assert isinstance(summary.error, paxisim.PaxisimError)
    log = read_log(path)
    assert log.complete
    assert len(log.streams["measured"].time) == summary.frames > 0


def test_a_port_that_comes_back_goes_on_in_the_same_file(replugged, path):
    (board, sensor), frames_before = replugged, []

    def pull_and_plug(summary):
        if summary.frames and not frames_before:
            frames_before.append(summary.frames)
            board.unplug()
            board.plug()
        return bool(frames_before) and sensor.reconnects > 0 and summary.frames > frames_before[0] + 40

    sensor.zero()
    with pytest.warns(ZeroInDoubtWarning):
        summary = capture(sensor, path, on_status=Stop(pull_and_plug))
    assert (summary.ended, summary.zero_in_doubt, sensor.reconnects) == ("stopped", True, 1)
    log = read_log(path)
    assert log.complete
    assert len(log.streams["measured"].time) == summary.frames > frames_before[0] + 40


def test_silence_is_a_gap_before_the_first_frame_after_the_last_and_alone(replugged, path):
    (board, sensor), pulled = replugged, []

    def plug_then_pull(summary):
        if not board.plugged and not pulled and summary.seconds > 0.8:
            board.plug()
        if board.plugged and summary.frames:
            board.unplug()
            pulled.append(summary.seconds)
        return bool(pulled) and summary.seconds > pulled[0] + 0.8

    board.unplug()
    while not sensor._readers[0].fault:
        time.sleep(0.01)
    alone = capture(sensor, path.with_name("alone.mcap"), seconds=0.6)
    assert (alone.frames, alone.gaps) == (0, 1)
    assert alone.longest_gap == alone.seconds > 0.5
    summary = capture(sensor, path, on_status=Stop(plug_then_pull))
    assert summary.frames > 0
    assert summary.gaps >= 2
    assert 0.8 < summary.longest_gap < summary.seconds
    assert (summary.dropped, summary.reconnects) == (0, 1)


def test_without_frames_the_rest_still_reaches_the_disk(replugged, path):
    """The file is read while it is being recorded."""
    (board, sensor), on_disk = replugged, []

    def look(summary):
        if summary.frames and board.plugged:
            board.unplug()
        on_disk.append(read_log(path).streams.get("covariate/arm"))
        return not board.plugged and on_disk[-1] is not None and len(on_disk[-1].time) > 40

    summary = capture(sensor, path, extra=[PolledFunction(lambda: 1.0, 50, "arm")], on_status=Stop(look))
    assert summary.ended == "stopped"
    assert summary.extra[0].samples >= len(on_disk[-1].time) > 40


class Jumping(SystemClock):
    """The system clock, with a wall time that can jump as when a time server sets it."""

    by = 0.0

    def wall(self):
        return time.time() + self.by


@pytest.mark.parametrize("hours", [2, -2])
def test_a_clock_that_is_set_meanwhile_moves_no_time(sensor, path, hours):
    clock, (lines, writer) = Jumping(), os.pipe()

    def jump(summary):
        if summary.frames > 10:
            if not clock.by:
                clock.by = 3600.0 * hours
                os.write(writer, b"opening\n1\n")
            return summary.extra[0].samples > 0 and summary.extra[1].samples > 20
        return False

    before = time.time()
    arm = PolledFunction(lambda: 1.0, 50, "arm")
    summary = capture(sensor, path, extra=[CsvLines(lines), arm], on_status=Stop(jump), clock=clock)
    os.close(lines)
    os.close(writer)
    assert clock.by
    assert (summary.ended, summary.gaps) == ("stopped", 0)
    for stream in read_log(path).streams.values():
        assert before - 1 < stream.time[0] <= stream.time[-1] < time.time() + 1
        assert np.all(np.diff(stream.nanoseconds) >= 0)


# ---- how it ends, and what is refused


def test_an_error_of_the_callback_leaves_a_whole_file(sensor, path):
    def fail(summary):
        raise RuntimeError("a bug of the caller")

    before = threading.active_count()
    with pytest.raises(RuntimeError, match="a bug of the caller"):
        capture(sensor, path, extra=[PolledFunction(lambda: 1.0, 50, "arm")], on_status=fail)
    assert read_log(path).complete
    assert threading.active_count() == before


def test_bad_seconds_make_no_file_and_one_that_is_there_is_kept_unless_asked(sensor, path):
    for seconds in (0, -1, float("nan"), float("inf")):
        with pytest.raises(paxisim.InvalidValueError, match="seconds must be a positive number"):
            capture(sensor, path, seconds=seconds)
        assert not path.exists()
    path.write_text("precious")
    with pytest.raises(paxisim.OutputExistsError):
        capture(sensor, path, seconds=0.2)
    assert path.read_text() == "precious"
    done = []  # in a thread, which cannot handle signals
    thread = threading.Thread(target=lambda: done.append(capture(sensor, path, seconds=0.2, overwrite=True)))
    thread.start()
    thread.join()
    assert done[0].ended == "seconds"
