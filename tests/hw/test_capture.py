"""Recording a sensor to a file, with emulated boards, the driver, extra streams and real files."""

import contextlib
import json
import os
import queue
import shutil
import signal
import socket
import subprocess
import threading
import time

import numpy as np
import pytest

import paxisim

pytest.importorskip("serial")
pytest.importorskip("termios")  # the emulator is a pseudo-terminal

from emulated import Numbered, constant, profile

from paxisim.hw.capture.capture import CaptureSummary, capture
from paxisim.hw.capture.extra_streams import CsvLines, ExtraStream, PolledFunction, UdpJson
from paxisim.hw.device import ZeroInDoubtWarning, open_sensor
from paxisim.hw.emulation.emulator import Emulator
from paxisim.hw.emulation.faults import Faults
from paxisim.hw.link.clock import SystemClock
from paxisim.hw.profiles.profile import Slot
from paxisim.logs.mcap_reader import read_log

pytestmark = pytest.mark.real_time

PROFILE = profile()


@pytest.fixture
def board():
    with Emulator(PROFILE, constant(PROFILE)) as emulator:
        yield emulator


@pytest.fixture
def sensor(board):
    with open_sensor(board.port, PROFILE, reconnect=0) as opened:
        yield opened


@contextlib.contextmanager
def unplugged(folder):
    """Context manager: a board unplugged after it was opened, and its sensor, which waits for it to return."""
    with (
        Emulator(PROFILE, constant(PROFILE), link=folder / "port") as board,
        open_sensor(board.port, PROFILE, reconnect=60) as sensor,
    ):
        board.unplug()
        while not sensor._readers[0].fault:
            time.sleep(0.01)
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


def test_frames_land_with_their_numbers_times_and_counts(tmp_path):
    felt, forces = Numbered(PROFILE), []

    def record_what_is_felt(now):
        forces.append(felt(now).astype(np.float32))
        return forces[-1]

    before = time.time()
    with Emulator(PROFILE, record_what_is_felt, gate=0) as board, open_sensor(board.port, PROFILE) as sensor:
        summary = capture(sensor, tmp_path / "press.mcap", seconds=1.2)
    log = read_log(tmp_path / "press.mcap")
    measured = log.streams["measured"]
    assert log.complete
    assert summary.ended == "seconds"
    assert summary.error is None
    assert summary.frames == len(measured.time) > 10
    assert summary.size == (tmp_path / "press.mcap").stat().st_size
    assert (summary.dropped, summary.episodes) == (0, 1)
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


@pytest.mark.parametrize(
    ("name", "slots"),
    [
        ("gen2-box-120", (Slot("left", 2), Slot("right", 5))),
        ("gen1-stream", (Slot("pulp", 0), Slot("tip", 1))),
        ("gen3-highspeed-mc-m2020", (Slot("thumb", 2), Slot("palm", 9))),
    ],
)
def test_two_pads_on_one_port_land_with_their_totals(name, slots, tmp_path):
    two = profile(name, slots=slots)
    pressed = constant(two)
    with Emulator(two, pressed) as board, open_sensor(board.port, two) as sensor:
        capture(sensor, tmp_path / "press.mcap", seconds=0.5)
    loaded = paxisim.Recording.load(tmp_path / "press.mcap")
    assert loaded.pads == tuple(slot.name for slot in slots)
    totals = pressed(0.0).sum(axis=(-2, -1))
    np.testing.assert_allclose(
        loaded.measured.sum(axis=(-2, -1)), np.broadcast_to(totals, (len(loaded), 2, 3)), rtol=1e-5
    )
    if "resultant" in loaded.covariates:
        reported = np.clip(totals, [-12.8, -12.8, 0], [12.7, 12.7, 25.5])
        np.testing.assert_allclose(loaded.covariates["resultant"][-1], reported, rtol=1e-5)
    assert ("resultant" in loaded.covariates) == (name != "gen1-stream")


def test_the_file_knows_the_sensor(sensor, tmp_path):
    capture(sensor, tmp_path / "press.mcap", seconds=0.3)
    metadata = read_log(tmp_path / "press.mcap").metadata
    assert paxisim.TaxelLayout.from_dict(metadata["layout"]) == sensor.layout
    assert tuple(metadata["pads"]) == sensor.pads
    assert metadata["profile"] == PROFILE.name
    assert metadata["profile_verified"] == "in a test"
    assert tuple(metadata["ports"]) == sensor.ports


def test_frames_that_waited_before_it_began_are_not_in_it(sensor, tmp_path):
    while len(sensor._queue._frames) < 20:
        time.sleep(0.01)
    newest = sensor._queue._frames[-1].sequence
    summary = capture(sensor, tmp_path / "press.mcap", seconds=0.3)
    measured = read_log(tmp_path / "press.mcap").streams["measured"]
    assert measured.sequence[0] > newest
    assert len(measured.time) == summary.frames


def test_status_and_arrival_are_kept_beside_the_tensor(sensor, tmp_path):
    from mcap.reader import make_reader

    capture(sensor, tmp_path / "press.mcap", seconds=0.5)
    with open(tmp_path / "press.mcap", "rb") as file:
        messages = [
            json.loads(message.data) for _, _, message in make_reader(file).iter_messages(["/tactile/measured"])
        ]
    assert messages
    for message in messages:
        measured = message["timestamp"]["sec"] + message["timestamp"]["nsec"] * 1e-9
        assert measured <= message["arrival"] + 1e-6
        assert len(message["status"]) == len(sensor.pads)
        assert np.shape(message["resultant"]) == (len(sensor.pads), 3)


def test_all_kinds_of_extra_streams_land_with_their_times_and_values(sensor, tmp_path):
    reader, writer = os.pipe()
    udp = UdpJson(0)
    arm = PolledFunction(lambda: {"pose": [1.0, 2.0, 3.0]}, 100, "arm")
    own_time = time.time() - 5

    def feed():
        # one line at a time while frames arrive; the sources end before the recording does
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            os.write(writer, b"time,gripper\n")
            for i in range(20):
                os.write(writer, f"{own_time + i / 10},{i}\n".encode())
                os.write(writer, b"nonsense\n")
                sender.sendto(b'{"current": %d}' % i, ("127.0.0.1", udp.port))
                sender.sendto(b'{"current": "high"}', ("127.0.0.1", udp.port))
        os.close(writer)

    feeder = threading.Thread(target=feed)
    feeder.start()
    before = time.time()

    def everything(summary):
        lines, datagrams, calls = summary.extra
        return lines.ended and lines.samples == 20 and datagrams.samples == 20 and calls.samples > 3

    summary = capture(
        sensor, tmp_path / "press.mcap", extra=[CsvLines(reader), udp, arm], seconds=60, on_status=Stop(everything)
    )
    feeder.join()
    os.close(reader)
    streams = read_log(tmp_path / "press.mcap").streams
    assert streams["covariate/gripper"].values.tolist() == list(range(20))
    assert streams["covariate/gripper"].time == pytest.approx(own_time + np.arange(20) / 10, abs=1e-6)
    assert streams["covariate/current"].values.tolist() == list(range(20))
    arrivals = streams["covariate/current"].time
    assert before - 1 < arrivals[0] <= arrivals[-1] <= before + summary.seconds + 1
    assert streams["covariate/pose"].values.tolist() == [[1.0, 2.0, 3.0]] * summary.extra[2].samples
    assert [source.bad for source in summary.extra] == [20, 20, 0]
    assert "nonsense" in summary.extra[0].problem
    assert summary.ended == "stopped"
    assert len(streams["measured"].time) == summary.frames > 0


def test_one_stream_has_one_source_and_one_shape(sensor, tmp_path):
    values = iter([[1.0], [1.0, 2.0]])
    first = PolledFunction(lambda: next(values, [3.0]), 50, "pose")
    ready = threading.Event()
    second = PolledFunction(lambda: {"pose": 1.0, "resultant": 2.0} if ready.is_set() else {}, 50, "arm")

    def both_refused(summary):
        if summary.extra[0].samples:
            ready.set()
        return summary.extra[0].bad >= 1 and summary.extra[1].bad >= 2

    summary = capture(sensor, tmp_path / "press.mcap", extra=[first, second], on_status=Stop(both_refused))
    pose = read_log(tmp_path / "press.mcap").streams["covariate/pose"]
    assert pose.values[0] == [1.0]
    assert set(pose.values[1:, 0]) == {3.0}
    assert summary.extra[0].bad == 1
    assert "covariate/pose must keep its shape (1,), got (2,)" in summary.extra[0].problem
    assert summary.extra[1].samples == 0
    assert "arm: the name resultant is reserved" in summary.extra[1].problem


class Enter(ExtraStream):
    """A stream that starts an episode whenever the test requests one."""

    def __init__(self):
        super().__init__("Enter")
        self.wanted = queue.Queue()

    def _run(self):
        from paxisim.hw.capture.extra_streams import EPISODE_WORD, Sample

        while not self._stop.is_set():
            try:
                self.wanted.get(timeout=0.05)
            except queue.Empty:
                continue
            self._put(Sample(self, EPISODE_WORD, np.zeros(()), self._clock.monotonic()))


def test_episodes_begin_when_they_are_asked_for(sensor, tmp_path):
    key = Enter()

    def two_more(summary):
        if summary.frames and key.wanted.empty() and summary.episodes == asked[0]:
            asked[0] += 1
            key.wanted.put(None)
        return summary.episodes >= 3

    asked = [1]
    summary = capture(sensor, tmp_path / "press.mcap", extra=[key], on_status=Stop(two_more))
    episode = read_log(tmp_path / "press.mcap").streams["episode"]
    assert summary.episodes >= 3
    assert episode.values.tolist() == list(range(summary.episodes))
    assert np.all(np.diff(episode.nanoseconds) > 0)


def test_a_flood_of_samples_is_dropped_and_counted_and_frames_go_on(sensor, tmp_path):
    class Flood(ExtraStream):
        def _run(self):
            from paxisim.hw.capture.extra_streams import Sample

            for _ in range(30_000):
                self._put(Sample(self, "covariate/noise", np.ones(()), self._clock.monotonic()))

    flood = Flood("flood")
    summary = capture(sensor, tmp_path / "press.mcap", extra=[flood], on_status=Stop(lambda s: s.extra[0].ended))
    assert summary.extra[0].samples + summary.extra[0].dropped == 30_000
    assert len(read_log(tmp_path / "press.mcap").streams["covariate/noise"].time) == summary.extra[0].samples
    assert summary.frames > 0


def test_a_late_reader_is_told_what_is_missing(board, tmp_path):
    late = []

    def be_late(summary):
        if not late:
            late.append(1)
            time.sleep(0.8)  # longer than a one-frame queue covers
        return summary.dropped > 0

    with open_sensor(board.port, PROFILE, queue=1) as sensor:
        summary = capture(sensor, tmp_path / "press.mcap", on_status=Stop(be_late))
    sequence = read_log(tmp_path / "press.mcap").streams["measured"].sequence
    assert summary.dropped == int((np.diff(sequence) - 1).sum()) > 0


def test_a_port_that_goes_away_ends_it_with_a_whole_file(board, sensor, tmp_path):
    def pull(summary):
        if summary.frames:
            board.unplug()
        return False

    summary = capture(sensor, tmp_path / "press.mcap", seconds=60, on_status=Stop(pull))
    assert summary.ended == "sensor"
    assert isinstance(summary.error, paxisim.PaxisimError)
    log = read_log(tmp_path / "press.mcap")
    assert log.complete
    assert len(log.streams["measured"].time) == summary.frames > 0


def test_a_port_that_comes_back_goes_on_in_the_same_file(tmp_path):
    frames_before = []

    def pull_and_plug(summary):
        if summary.frames and not frames_before:
            frames_before.append(summary.frames)
            board.unplug()
            board.plug()
        return bool(frames_before) and sensor.reconnects > 0 and summary.frames > frames_before[0] + 40

    with (
        Emulator(PROFILE, constant(PROFILE), link=tmp_path / "port") as board,
        open_sensor(board.port, PROFILE, reconnect=30) as sensor,
    ):
        sensor.zero()
        with pytest.warns(ZeroInDoubtWarning):
            summary = capture(sensor, tmp_path / "press.mcap", on_status=Stop(pull_and_plug))
    assert summary.ended == "stopped"
    assert summary.zero_in_doubt
    assert sensor.reconnects == 1
    log = read_log(tmp_path / "press.mcap")
    assert log.complete
    assert len(log.streams["measured"].time) == summary.frames > frames_before[0] + 40


def test_silence_before_the_first_frame_and_after_the_last_is_a_gap(tmp_path):
    pulled = []

    def plug_then_pull(summary):
        if not board.plugged and not pulled and summary.seconds > 0.8:
            board.plug()
        if board.plugged and summary.frames:
            board.unplug()
            pulled.append(summary.seconds)
        return bool(pulled) and summary.seconds > pulled[0] + 0.8

    with unplugged(tmp_path) as (board, sensor):
        summary = capture(sensor, tmp_path / "press.mcap", on_status=Stop(plug_then_pull))
    assert summary.frames > 0
    assert summary.gaps >= 2
    assert 0.8 < summary.longest_gap < summary.seconds
    assert (summary.dropped, summary.reconnects) == (0, 1)


class Jumping(SystemClock):
    """The system clock, with a wall time that can jump as when a time server sets it."""

    def __init__(self):
        self.by = 0.0

    def wall(self):
        return time.time() + self.by


@pytest.mark.parametrize("hours", [2, -2])
def test_a_clock_that_is_set_meanwhile_moves_no_time(sensor, tmp_path, hours):
    clock = Jumping()
    lines, writer = os.pipe()

    def jump(summary):
        if summary.frames > 10:
            if not clock.by:
                clock.by = 3600.0 * hours
                os.write(writer, b"opening\n1\n")
            return summary.extra[0].samples > 0 and summary.extra[1].samples > 20
        return False

    before = time.time()
    arm = PolledFunction(lambda: 1.0, 50, "arm")
    summary = capture(sensor, tmp_path / "press.mcap", extra=[CsvLines(lines), arm], on_status=Stop(jump), clock=clock)
    os.close(lines)
    os.close(writer)
    assert clock.by
    assert (summary.ended, summary.gaps) == ("stopped", 0)
    for stream in read_log(tmp_path / "press.mcap").streams.values():
        assert before - 1 < stream.time[0] <= stream.time[-1] < time.time() + 1
        assert np.all(np.diff(stream.nanoseconds) >= 0)


def test_values_of_one_datagram_are_one_sample(sensor, tmp_path):
    udp = UdpJson(0)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sent = []

        def send(summary):
            if len(sent) < 5:
                sent.append(1)
                sender.sendto(b'{"a": 1, "b": 2, "c": 3}', ("127.0.0.1", udp.port))
            return summary.extra[0].samples >= 5

        summary = capture(sensor, tmp_path / "press.mcap", extra=[udp], on_status=Stop(send))
    streams = read_log(tmp_path / "press.mcap").streams
    assert [len(streams[f"covariate/{name}"].time) for name in "abc"] == [5, 5, 5]
    assert summary.extra[0].samples == 5


def test_silence_alone_is_one_gap(tmp_path):
    with unplugged(tmp_path) as (_, sensor):
        summary = capture(sensor, tmp_path / "press.mcap", seconds=0.7)
    assert (summary.frames, summary.gaps) == (0, 1)
    assert summary.longest_gap == summary.seconds > 0.5


def test_what_never_came_whole_is_counted(tmp_path):
    with (
        Emulator(PROFILE, constant(PROFILE), faults=Faults(garble=0.02), seed=1) as board,
        open_sensor(board.port, PROFILE) as sensor,
    ):
        while not sensor.bad_checksums:
            time.sleep(0.01)
        before = sensor.bad_checksums
        summary = capture(sensor, tmp_path / "press.mcap", on_status=Stop(lambda s: s.bad_checksums > 3))
        assert 3 < summary.bad_checksums <= sensor.bad_checksums - before


def test_without_frames_the_rest_still_reaches_the_disk(tmp_path):
    """The file is read while it is being recorded."""
    path, on_disk = tmp_path / "press.mcap", []

    def look(summary):
        if summary.frames and board.plugged:
            board.unplug()
        on_disk.append(read_log(path).streams.get("covariate/arm"))
        return not board.plugged and on_disk[-1] is not None and len(on_disk[-1].time) > 60

    arm = PolledFunction(lambda: 1.0, 50, "arm")
    # through a link of its own, because the system soon reuses the number of a closed pseudo-terminal
    with (
        Emulator(PROFILE, constant(PROFILE), link=tmp_path / "port") as board,
        open_sensor(board.port, PROFILE, reconnect=60) as sensor,
    ):
        summary = capture(sensor, path, extra=[arm], on_status=Stop(look))
    assert summary.ended == "stopped"
    assert summary.extra[0].samples >= len(on_disk[-1].time) > 60


def test_an_error_of_the_callback_leaves_a_whole_file(sensor, tmp_path):
    def fail(summary: CaptureSummary):
        raise RuntimeError("a bug of the caller")

    before = threading.active_count()
    with pytest.raises(RuntimeError, match="a bug of the caller"):
        capture(sensor, tmp_path / "press.mcap", extra=[PolledFunction(lambda: 1.0, 50, "arm")], on_status=fail)
    assert read_log(tmp_path / "press.mcap").complete
    assert threading.active_count() == before


def test_signals_are_given_back(sensor, tmp_path):
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    capture(sensor, tmp_path / "press.mcap", seconds=0.2)
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_it_runs_in_a_thread_too(sensor, tmp_path):
    done = []
    thread = threading.Thread(target=lambda: done.append(capture(sensor, tmp_path / "press.mcap", seconds=0.3)))
    thread.start()
    thread.join()
    assert done[0].ended == "seconds"


@pytest.mark.parametrize("seconds", [0, -1, float("nan"), float("inf")])
def test_bad_seconds_make_no_file(sensor, tmp_path, seconds):
    with pytest.raises(paxisim.InvalidValueError, match="seconds must be a positive number"):
        capture(sensor, tmp_path / "press.mcap", seconds=seconds)
    assert not (tmp_path / "press.mcap").exists()


def test_a_file_that_is_there_is_kept_unless_asked(sensor, tmp_path):
    (tmp_path / "press.mcap").write_text("precious")
    with pytest.raises(paxisim.OutputExistsError):
        capture(sensor, tmp_path / "press.mcap", seconds=0.2)
    assert (tmp_path / "press.mcap").read_text() == "precious"
    assert capture(sensor, tmp_path / "press.mcap", seconds=0.2, overwrite=True).ended == "seconds"


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 400 KiB; skips the test if this user may not mount one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = shutil.which("mount")
    if (
        not mount
        or subprocess.run(
            [mount, "-t", "tmpfs", "-o", "size=400k", "tmpfs", folder], capture_output=True, check=False
        ).returncode
    ):
        pytest.skip("needs to mount a file system")
    yield folder
    subprocess.run(["umount", folder], check=True)


def test_a_full_disk_ends_it_with_a_file_that_loads(small_disk, sensor):
    rng = np.random.default_rng(0)
    noise = PolledFunction(lambda: rng.random(100), 100, "noise")
    summary = capture(sensor, small_disk / "press.mcap", seconds=60, extra=[noise])
    assert summary.ended == "disk"
    assert "No space left" in str(summary.error)
    measured = read_log(small_disk / "press.mcap").streams["measured"]
    assert 0 < len(measured.time) <= summary.frames
    assert np.all(np.diff(measured.nanoseconds) >= 0)
