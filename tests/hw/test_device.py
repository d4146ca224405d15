"""`open_sensor` and `TactileSensor` with a scripted board: reading, zeroing, unplugging, opening and closing."""

import itertools
import math
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from paxisim import (
    DeviceError,
    DeviceTimeoutError,
    InvalidValueError,
    PortAccessError,
    PortNotFoundError,
    ProtocolError,
    UnknownNameError,
    UnsupportedError,
    UnverifiedProfileWarning,
)
from paxisim.hw import device
from paxisim.hw.device import ZeroInDoubtWarning, open_sensor
from paxisim.hw.link import reader
from paxisim.hw.link.frame_joiner import STALE_STATUS
from paxisim.hw.profiles.write import profile_toml
from paxisim.logs.schemas import NO_TAXELS

pytest.importorskip("serial")

from scripted_board import ONE_PAD, TWO_PADS, ScriptedBoard, message
from serial_peers import PATIENCE, plugged_port, reader_threads, wait_for


@pytest.fixture(autouse=True)
def no_thread_is_left():
    yield
    wait_for(lambda: not reader_threads())


@pytest.fixture
def port(tmp_path):
    with plugged_port(tmp_path) as port:
        yield port


@pytest.fixture
def second(tmp_path):
    with plugged_port(tmp_path, "second") as port:
        yield port


@pytest.fixture
def use_board(monkeypatch):
    return lambda board: monkeypatch.setattr(device, "board_class", lambda family: board)


@pytest.fixture(autouse=True)
def scripted(use_board, monkeypatch):
    use_board(ScriptedBoard)
    monkeypatch.setattr(reader, "READ_TIMEOUT", 0.1)  # closing a silent port waits up to this long


@contextmanager
def sending(port, *counts):
    """Context manager: send these counts in turn until the block ends."""
    stop = threading.Event()

    def send():
        for count in itertools.cycle(counts):
            port.send(message(count))
            if stop.wait(0.002):
                return

    sender = threading.Thread(target=send)
    sender.start()
    try:
        yield
    finally:
        stop.set()
        sender.join()


def count_of(frame):
    """The count that `frame` was sent with."""
    return round(float(frame.force[0, 0, 0, 0]) * 10)


def send_and_wait(port, pads, counts):
    """Send frames and wait until all of them are queued or dropped."""
    arrived = len(pads._queue._frames) + pads.dropped
    for count in counts:
        port.send(message(count))
    wait_for(lambda: len(pads._queue._frames) + pads.dropped == arrived + len(counts))


def away(pads):
    """Whether the sensor has noticed that its port went away."""
    return pads._readers[0].fault


def unplug_and_plug(port, pads):
    before = pads.reconnects
    port.unplug()
    wait_for(lambda: away(pads))
    port.plug_in()
    wait_for(lambda: pads.reconnects > before)


class Failing(ScriptedBoard):
    """Raises `error` for each frame with count 66."""

    error: Exception = ProtocolError("the board refuses")

    def read(self, timeout):
        reading = super().read(timeout)
        if reading.counts.max() == 66:
            raise self.error
        return reading


class CannotZero(ScriptedBoard):
    def zero(self):
        raise UnsupportedError("this board cannot zero")


# ---- reading


def test_frames_come_in_order_in_newtons(port):
    with open_sensor(port.path, TWO_PADS) as pads:
        assert port.receive(1) == b"S"
        assert (pads.layout, pads.pads) == (TWO_PADS.layout, ("left", "right"))
        said = f"<TactileSensor scripted-two on {port.path}: open, 2 pads of 2x3, 0 dropped, 0 reconnects, 2 bad"
        assert repr(pads).startswith(said)
        for count in range(20):
            port.send(message(count))
        frames = [pads.read(PATIENCE) for _ in range(20)]
    assert port.receive(1) == b"X"
    assert "closed" in repr(pads)
    for i, frame in enumerate(frames):
        assert frame.force.shape == (2, 3, 2, 3)
        assert frame.force.dtype == frame.resultant.dtype == np.float32
        np.testing.assert_array_equal(frame.force, np.float32(i * 0.1))
        np.testing.assert_allclose(frame.resultant, i * 0.6, atol=1e-6)
        assert (frame.sequence, frame.status) == (i, (0, 0))
        assert frame.time <= frame.arrival
    assert all(a.time <= b.time for a, b in itertools.pairwise(frames))


def test_stream_latest_and_a_queue_that_drops_the_oldest(port):
    with open_sensor(port.path, ONE_PAD, queue=3) as pads:
        for count in range(3):
            port.send(message(count))
        assert [count_of(frame) for frame in itertools.islice(pads.stream(PATIENCE), 3)] == [0, 1, 2]
        with pytest.raises(DeviceTimeoutError):
            next(pads.stream(0.01))
        send_and_wait(port, pads, range(10))
        assert [pads.read(PATIENCE).sequence for _ in range(3)] == [10, 11, 12]
        assert pads.dropped == 7
        send_and_wait(port, pads, range(3))
        frame = pads.latest(PATIENCE)  # frames that were passed over do not count as dropped
        assert (count_of(frame), frame.sequence, pads.dropped) == (2, 15, 7)
        port.send(message(9))
        assert count_of(pads.latest(PATIENCE)) == 9


def test_silence_is_a_timeout_unless_the_caller_waits_without_end(port):
    with open_sensor(port.path, ONE_PAD) as pads:
        with pytest.raises(DeviceTimeoutError, match=rf"no frame from {port.path} within 0.01 s"):
            pads.read(0.01)
        wait_for(lambda: pads.timeouts)
        with pytest.raises(DeviceTimeoutError, match="the scripted board sent nothing"):
            pads.latest(0.01)
        later = threading.Timer(0.1, port.send, [message(3)])
        later.start()
        assert count_of(pads.read(math.inf)) == 3
        later.join()


def test_a_board_that_fell_silent_is_started_again(port, monkeypatch):
    monkeypatch.setattr(reader, "READ_TIMEOUT", 0.02)
    monkeypatch.setattr(reader, "RESTART_AFTER", 0.1)
    with open_sensor(port.path, ONE_PAD) as pads:
        assert port.receive(3) == b"SSS"
        port.send(message(3))
        assert count_of(pads.read(PATIENCE)) == 3
        assert pads.reconnects == 0
        assert not pads.zero_in_doubt
        pads.zero()
        wait_for(lambda: pads.zero_in_doubt)
        with pytest.warns(ZeroInDoubtWarning, match="or silent"), pytest.raises(DeviceTimeoutError):
            pads.read(0.01)


def test_a_protocol_error_is_survived_and_another_ends_it_after_the_frames(port, use_board):
    use_board(Failing)
    with open_sensor(port.path, ONE_PAD) as pads:
        port.send(message(66) + message(1))
        assert count_of(pads.read(PATIENCE)) == 1
        assert pads.timeouts == 1

    class Broken(Failing):
        error = ZeroDivisionError("a bug")

    use_board(Broken)
    with open_sensor(port.path, ONE_PAD) as pads:
        port.send(message(1) + message(2) + message(66) + message(3))
        wait_for(lambda: not reader_threads())
        assert [count_of(pads.read()) for _ in range(2)] == [1, 2]
        for use in (pads.read, pads.read, pads.version):
            with pytest.raises(ZeroDivisionError):
                use()


def test_counters_go_on_after_the_port_was_away(port):
    with open_sensor(port.path, ONE_PAD) as pads:
        port.send(b"garbage" + message(1))
        pads.read(PATIENCE)
        assert (pads.skipped, pads.bad_checksums) == (7, 2)
        port.unplug()
        wait_for(lambda: away(pads))
        with pytest.raises(DeviceTimeoutError, match=r"went away|no port"):
            pads.read(0.01)
        port.plug_in()
        wait_for(lambda: pads.reconnects == 1)
        assert port.receive(1) == b"S"
        port.send(b"!" + message(4))
        frame = pads.read(PATIENCE)
        assert (count_of(frame), frame.sequence) == (4, 1)
        assert (pads.skipped, pads.bad_checksums) == (8, 4)
    assert (pads.skipped, pads.bad_checksums) == (8, 4)


# ---- commands


def test_version_and_zero_run_between_readings(port):
    with open_sensor(port.path, ONE_PAD) as pads:
        with sending(port, 5):
            assert pads.version() == "scripted 1.0"
            pads.zero()
            pads.zero(software=False)
            assert port.receive(4) == b"SVZZ"
            assert count_of(pads.read(PATIENCE)) == 5
        port.unplug()
        for command in (pads.zero, pads.version):
            with pytest.raises(PortNotFoundError):
                command()


@pytest.mark.parametrize("software", [None, True])
def test_software_zero(port, use_board, software):
    if software is None:
        use_board(CannotZero)
    with open_sensor(port.path, ONE_PAD) as pads:
        with sending(port, 4, 6):
            pads.zero(software=software)
            frames = [pads.read(PATIENCE) for _ in range(20)]
        # 4 and 6 counts differ from their mean by 1 count, the resultant of 4 taxels by 4 counts
        np.testing.assert_allclose([abs(f.force).max() for f in frames], 0.1, atol=0.01)
        np.testing.assert_allclose([np.abs(f.resultant).max() for f in frames], 0.4, atol=0.04)
        assert frames[0].force.dtype == np.float32
        assert len({np.sign(f.force[0, 0, 0, 0]) for f in frames}) == 2
        if software:  # zeroing on the board discards the software zero
            pads.zero()
            port.send(message(5))
            wait_for(lambda: count_of(pads.latest(PATIENCE)) == 5)


def test_a_software_zero_forgives_what_reading_does(port, use_board):
    use_board(Failing)
    with open_sensor(port.path, ONE_PAD) as pads, sending(port, 66, 5, 66, 66):
        pads.zero(software=True)
        assert abs(pads.read(PATIENCE).force).max() == 0
        assert pads.timeouts > 3


def test_a_board_that_cannot_zero_says_so_where_asked(port, use_board, monkeypatch):
    use_board(CannotZero)
    monkeypatch.setattr(reader, "RESTART_AFTER", 0.3)
    with open_sensor(port.path, ONE_PAD) as pads:
        with pytest.raises(UnsupportedError, match="cannot zero"):
            pads.zero(software=False)
        with pytest.raises(DeviceTimeoutError):
            pads.zero()  # no frames arrive to average
        port.send(message(1))
        assert count_of(pads.read(PATIENCE)) == 1


def test_frames_with_errors_are_no_zero(port, use_board, monkeypatch):
    class Faulty(ScriptedBoard):
        status = 7

    monkeypatch.setattr(reader, "ZERO_TIME", 0.0)
    use_board(Faulty)
    with open_sensor(port.path, ONE_PAD) as pads:
        port.send(message(5))
        assert pads.read(PATIENCE).status == (7,)
        with sending(port, 5), pytest.raises(DeviceError, match="error with each frame"):
            pads.zero(software=True)
        monkeypatch.setattr(Faulty, "status", NO_TAXELS)  # as of a board at rest: no error
        with sending(port, 5):
            pads.zero(software=True)
            assert abs(pads.read(PATIENCE).force).max() == 0


# ---- unplugging


@pytest.mark.parametrize("again", [None, True])
def test_the_zero_of_a_board_that_was_away_is_in_doubt(port, again):
    with open_sensor(port.path, ONE_PAD) as pads:
        for _ in range(2):
            pads.zero()
            assert not pads.zero_in_doubt
            unplug_and_plug(port, pads)
            assert pads.zero_in_doubt
            with sending(port, 3):
                with pytest.warns(ZeroInDoubtWarning, match=f"{port.path} was zeroed, then away"):
                    pads.read(PATIENCE)
                pads.read(PATIENCE)  # warned only once
                pads.zero(software=again)
            assert not pads.zero_in_doubt


def test_a_zero_in_software_is_kept(port):
    with open_sensor(port.path, ONE_PAD) as pads:
        with sending(port, 3):
            pads.zero(software=True)
        unplug_and_plug(port, pads)
        assert not pads.zero_in_doubt
        port.send(message(3))
        assert count_of(pads.read(PATIENCE)) == 0


def test_another_board_in_its_place_is_not_taken_for_it(port, use_board):
    class Foreign(ScriptedBoard):
        def start(self):
            raise ProtocolError("a board of another family answers")

    with open_sensor(port.path, ONE_PAD, reconnect=0.3) as pads:
        use_board(Foreign)
        port.unplug()
        port.plug_in()
        with pytest.raises(PortNotFoundError, match=r"did not come back within 0.3 s.*another family"):
            pads.read(PATIENCE)


@pytest.mark.parametrize("reconnect", [0, 0.2])
def test_it_does_not_come_back(port, reconnect):
    with open_sensor(port.path, ONE_PAD, reconnect=reconnect) as pads:
        send_and_wait(port, pads, range(2))
        port.unplug()
        wait_for(lambda: not reader_threads())
        assert [count_of(pads.read()) for _ in range(2)] == [0, 1]
        for take in (pads.read, pads.latest, lambda: next(pads.stream())):
            with pytest.raises(PortNotFoundError, match=port.path):
                take()


# ---- opening and closing


def test_a_profile_by_name_warns_where_it_was_opened_and_files_are_paths(port, tmp_path):
    with (
        pytest.warns(UnverifiedProfileWarning, match="gen2-box-120") as caught,
        open_sensor(port.path, "gen2-box-120") as pads,
    ):
        assert pads.profile.name == "gen2-box-120"
    assert [warning.filename for warning in caught] == [__file__]
    path = tmp_path / "mine.toml"
    path.write_text(profile_toml(ONE_PAD))
    for ports, profile in ((Path(port.path), path), ([Path(port.path)], str(path))):
        with open_sensor(ports, profile) as pads:
            assert (pads.ports, pads.profile) == ((port.path,), ONE_PAD)


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ({"port": []}, InvalidValueError, "port"),
        ({"port": ["/dev/ttyS77", "/dev/ttyS77"]}, InvalidValueError, "different"),
        ({"queue": 0}, InvalidValueError, "queue"),
        ({"queue": 2.5}, InvalidValueError, "queue"),
        ({"reconnect": -1}, InvalidValueError, "reconnect"),
        ({"reconnect": float("nan")}, InvalidValueError, "reconnect"),
        ({"profile": "gen2-bx-120"}, UnknownNameError, "gen2-box-120"),
        ({"port": "/dev/ttyS77"}, PortNotFoundError, "ttyS77"),
    ],
)
def test_bad_arguments(arguments, error, says):
    with pytest.raises(error, match=says):
        open_sensor(**{"port": "/dev/ttyS77", "profile": ONE_PAD, **arguments})


@pytest.mark.parametrize("error", [ProtocolError("another board"), DeviceTimeoutError("mute"), KeyboardInterrupt()])
@pytest.mark.parametrize("when", ["made", "started"])
def test_a_board_that_does_not_start_gives_both_ports_back(port, second, use_board, error, when):
    class Bad(ScriptedBoard):
        def __init__(self, *args):
            super().__init__(*args)
            if when == "made":
                raise error

        def start(self):
            super().start()
            if "second" in repr(self.transport):
                raise error

    use_board(Bad)
    with pytest.raises(type(error)):
        open_sensor([port.path, second.path], ONE_PAD)
    assert not reader_threads()
    use_board(ScriptedBoard)
    open_sensor([port.path, second.path], ONE_PAD).close()


@pytest.mark.parametrize("ports", [1, 2])
def test_a_port_is_opened_once_and_a_forgotten_sensor_gives_its_ports_back(port, second, ports):
    names = [port.path, second.path][:ports]
    pads = open_sensor(names, ONE_PAD)
    with pytest.raises(PortAccessError, match=r"in use.*close\(\) the sensor that this program opened"):
        open_sensor(names, ONE_PAD)
    with pytest.warns(ResourceWarning, match=f"sensor on {port.path}.* was not closed"):
        del pads
    assert not reader_threads()
    open_sensor(names, ONE_PAD).close()


def test_close_ends_all_use_and_wakes_who_waits(port):
    pads = open_sensor(port.path, ONE_PAD)
    closer = threading.Timer(0.1, pads.close)
    closer.start()
    with pytest.raises(DeviceError, match="is closed"):
        pads.read(PATIENCE)
    closer.join()
    pads.close()
    with open_sensor(port.path, ONE_PAD, reconnect=1000) as pads:
        send_and_wait(port, pads, range(2))
        port.unplug()
        wait_for(lambda: away(pads))
    assert not reader_threads()
    for use in (pads.read, pads.latest, pads.zero, pads.version, lambda: next(pads.stream())):
        with pytest.raises(DeviceError, match="is closed"):
            use()


# ---- several ports


def test_one_of_several_ports_goes_away_and_comes_back(port, second):
    with open_sensor([port.path, second.path], ONE_PAD) as pads, sending(port, 1):
        second.send(message(2))
        assert pads.read(PATIENCE).force[1].max() == np.float32(0.2)
        second.unplug()
        wait_for(lambda: pads.latest(PATIENCE).status == (0, STALE_STATUS))
        second.plug_in()
        wait_for(lambda: pads.reconnects)
        second.send(message(3))
        wait_for(lambda: pads.latest(PATIENCE).force[1].max() == np.float32(0.3))


def test_one_of_several_ports_stays_away(port, second):
    with open_sensor([port.path, second.path], ONE_PAD, reconnect=0.1) as pads:
        second.unplug()
        with pytest.raises(PortNotFoundError, match="second"):
            pads.read(PATIENCE)
