import itertools
import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from paxisim.errors import (
    DeviceError,
    DeviceTimeoutError,
    InvalidValueError,
    PortAccessError,
    PortNotFoundError,
    ProtocolError,
    UnknownNameError,
    UnsupportedError,
)
from paxisim.hw import device
from paxisim.hw.device import TactileSensor, ZeroInDoubtWarning, open_sensor
from paxisim.hw.link import reader
from paxisim.hw.link.frame_joiner import STALE_STATUS
from paxisim.hw.profiles.profile import UnverifiedProfileWarning
from paxisim.hw.profiles.write import profile_toml
from paxisim.logs.schemas import NO_TAXELS

pytest.importorskip("serial")
pytest.importorskip("pty", reason="no pseudo-terminals here")

from scripted_board import ONE_PAD, TWO_PADS, ScriptedBoard, message
from serial_peers import PATIENCE, PluggedPort, plugged_port, reader_threads, wait_for


@pytest.fixture(autouse=True)
def no_thread_is_left() -> Iterator[None]:
    yield
    wait_for(lambda: not reader_threads())


@pytest.fixture
def port(tmp_path: Path) -> Iterator[PluggedPort]:
    with plugged_port(tmp_path) as port:
        yield port


@pytest.fixture
def use_board(monkeypatch: pytest.MonkeyPatch) -> Callable[[type[ScriptedBoard]], None]:
    return lambda board: monkeypatch.setattr(device, "board_class", lambda family: board)


@pytest.fixture(autouse=True)
def scripted(use_board: Callable[[type[ScriptedBoard]], None], monkeypatch: pytest.MonkeyPatch) -> None:
    use_board(ScriptedBoard)
    monkeypatch.setattr(reader, "READ_TIMEOUT", 0.1)  # closing a silent port waits up to this long


@contextmanager
def sending(port: PluggedPort, *counts: int) -> Iterator[None]:
    """Context manager: send these counts in turn until the block ends."""
    stop = threading.Event()

    def send() -> None:
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


def count_of(frame: device.Frame) -> int:
    """The count that `frame` was sent with."""
    return round(float(frame.force[0, 0, 0, 0]) * 10)


def send_and_wait(port: PluggedPort, pads: TactileSensor, counts: range) -> None:
    """Send frames and wait until all of them are queued or dropped."""
    arrived = len(pads._queue._frames) + pads.dropped
    for count in counts:
        port.send(message(count))
    wait_for(lambda: len(pads._queue._frames) + pads.dropped == arrived + len(counts))


class Moody(ScriptedBoard):
    """Raises a protocol error for each frame with count 66."""

    def read(self, timeout: float):
        reading = super().read(timeout)
        if reading.counts.max() == 66:
            raise ProtocolError("the board refuses")
        return reading


class TestReading:
    def test_frames_come_in_order_in_newtons(self, port: PluggedPort) -> None:
        with open_sensor(port.path, TWO_PADS) as pads:
            assert port.receive(1) == b"S"
            for count in range(20):
                port.send(message(count))
            frames = [pads.read(PATIENCE) for _ in range(20)]
            for i, frame in enumerate(frames):
                assert frame.force.shape == (2, 3, 2, 3)
                assert frame.force.dtype == np.float32
                np.testing.assert_array_equal(frame.force, np.float32(i * 0.1))
                assert frame.resultant is not None
                np.testing.assert_allclose(frame.resultant, i * 0.6, atol=1e-6)
                assert frame.resultant.dtype == np.float32
                assert frame.sequence == i
                assert frame.status == (0, 0)
                assert frame.time <= frame.arrival
            assert all(a.time <= b.time for a, b in itertools.pairwise(frames))
            assert pads.layout == TWO_PADS.layout
            assert pads.pads == ("left", "right")
        assert port.receive(1) == b"X"

    def test_stream(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD) as pads:
            for count in range(5):
                port.send(message(count))
            assert [count_of(frame) for frame in itertools.islice(pads.stream(PATIENCE), 5)] == list(range(5))
            with pytest.raises(DeviceTimeoutError):
                next(pads.stream(0.01))

    def test_latest_is_the_newest_and_counts_nothing_as_dropped(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD) as pads:
            send_and_wait(port, pads, range(7))
            frame = pads.latest(PATIENCE)
            assert (count_of(frame), frame.sequence, pads.dropped) == (6, 6, 0)
            port.send(message(9))
            assert count_of(pads.latest(PATIENCE)) == 9

    def test_a_full_queue_drops_the_oldest_and_counts(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD, queue=3) as pads:
            send_and_wait(port, pads, range(10))
            assert [pads.read(PATIENCE).sequence for _ in range(3)] == [7, 8, 9]
            assert pads.dropped == 7

    def test_silence(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD) as pads:
            with pytest.raises(DeviceTimeoutError, match=rf"no frame from {port.path} within 0.01 s"):
                pads.read(0.01)
            wait_for(lambda: pads.timeouts)
            with pytest.raises(DeviceTimeoutError, match="the scripted board sent nothing"):
                pads.latest(0.01)
            port.send(message(3))
            assert count_of(pads.read(PATIENCE)) == 3

    def test_waiting_without_end(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD) as pads:
            later = threading.Timer(0.1, port.send, [message(3)])
            later.start()
            assert count_of(pads.read(math.inf)) == 3
            later.join()

    def test_a_board_that_fell_silent_is_started_again(
        self, port: PluggedPort, monkeypatch: pytest.MonkeyPatch
    ) -> None:
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

    def test_a_protocol_error_is_survived(self, port: PluggedPort, use_board) -> None:
        use_board(Moody)
        with open_sensor(port.path, ONE_PAD) as pads:
            port.send(message(66) + message(1))
            assert count_of(pads.read(PATIENCE)) == 1
            assert pads.timeouts == 1

    def test_an_error_that_ends_it_comes_after_the_frames(self, port: PluggedPort, use_board) -> None:
        class Broken(ScriptedBoard):
            def read(self, timeout: float):
                reading = super().read(timeout)
                if reading.counts.max() == 66:
                    raise ZeroDivisionError("a bug")
                return reading

        use_board(Broken)
        with open_sensor(port.path, ONE_PAD) as pads:
            port.send(message(1) + message(2) + message(66) + message(3))
            wait_for(lambda: not reader_threads())
            assert [count_of(pads.read()) for _ in range(2)] == [1, 2]
            for _ in range(2):
                with pytest.raises(ZeroDivisionError):
                    pads.read()
            with pytest.raises(ZeroDivisionError):
                pads.version()

    def test_counters(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD) as pads:
            port.send(b"garbage" + message(1))
            pads.read(PATIENCE)
            assert (pads.skipped, pads.bad_checksums) == (7, 2)
            port.unplug()
            wait_for(lambda: pads._readers[0].fault)
            port.plug_in()
            wait_for(lambda: pads.reconnects)
            port.send(b"!" + message(1))
            pads.read(PATIENCE)
            assert (pads.skipped, pads.bad_checksums) == (8, 4)
        assert (pads.skipped, pads.bad_checksums) == (8, 4)


class TestCommands:
    def test_version_and_zero_run_between_readings(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD) as pads, sending(port, 5):
            assert pads.version() == "scripted 1.0"
            pads.zero()
            pads.zero(software=False)
            assert port.receive(4) == b"SVZZ"
            assert count_of(pads.read(PATIENCE)) == 5

    @pytest.mark.parametrize("software", [None, True])
    def test_software_zero(self, port: PluggedPort, use_board, software: bool | None) -> None:
        class CannotZero(ScriptedBoard):
            def zero(self) -> None:
                raise UnsupportedError("this board cannot zero")

        if software is None:
            use_board(CannotZero)
        with open_sensor(port.path, ONE_PAD) as pads:
            with sending(port, 4, 6):
                pads.zero(software=software)
                frames = [pads.read(PATIENCE) for _ in range(20)]
            # 4 and 6 counts differ from their mean by 1 count, the resultant of 4 taxels by 4 counts
            np.testing.assert_allclose([abs(f.force).max() for f in frames], 0.1, atol=0.01)
            np.testing.assert_allclose(
                [np.abs(f.resultant).max() for f in frames if f.resultant is not None], 0.4, atol=0.04
            )
            assert frames[0].force.dtype == np.float32
            assert len({np.sign(f.force[0, 0, 0, 0]) for f in frames}) == 2
            if software:  # zeroing on the board discards the software zero
                pads.zero()
                port.send(message(5))
                wait_for(lambda: count_of(pads.latest(PATIENCE)) == 5)

    def test_a_software_zero_forgives_what_reading_does(self, port: PluggedPort, use_board) -> None:
        use_board(Moody)
        with open_sensor(port.path, ONE_PAD) as pads, sending(port, 66, 5, 66, 66):
            pads.zero(software=True)
            assert abs(pads.read(PATIENCE).force).max() == 0
            assert pads.timeouts > 3

    def test_a_board_that_cannot_zero_says_so_where_asked(
        self, port: PluggedPort, use_board, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        class CannotZero(ScriptedBoard):
            def zero(self) -> None:
                raise UnsupportedError("this board cannot zero")

        use_board(CannotZero)
        monkeypatch.setattr(reader, "RESTART_AFTER", 0.3)
        with open_sensor(port.path, ONE_PAD) as pads:
            with pytest.raises(UnsupportedError, match="cannot zero"):
                pads.zero(software=False)
            with pytest.raises(DeviceTimeoutError):
                pads.zero()  # no frames arrive to average
            port.send(message(1))
            assert count_of(pads.read(PATIENCE)) == 1

    def test_frames_with_errors_are_no_zero(self, port: PluggedPort, use_board, monkeypatch) -> None:
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

    def test_while_the_port_is_away(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD) as pads:
            port.unplug()
            for command in (pads.zero, pads.version):
                with pytest.raises(PortNotFoundError):
                    command()


class TestUnplugging:
    def test_it_comes_back(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD) as pads:
            for turn in range(3):
                assert port.receive(1) == b"S"
                port.send(message(turn))
                frame = pads.read(PATIENCE)
                assert (count_of(frame), frame.sequence, pads.reconnects) == (turn, turn, turn)
                port.unplug()
                wait_for(lambda: pads._readers[0].fault)
                with pytest.raises(DeviceTimeoutError, match=r"went away|no port"):
                    pads.read(0.01)
                port.plug_in()
            assert port.receive(1) == b"S"

    @pytest.mark.parametrize("again", [None, True])
    def test_the_zero_of_a_board_that_was_away_is_in_doubt(self, port: PluggedPort, again: bool | None) -> None:
        with open_sensor(port.path, ONE_PAD) as pads:
            pads.zero()
            for _ in range(2):
                assert not pads.zero_in_doubt
                before = pads.reconnects
                port.unplug()
                wait_for(lambda: pads._readers[0].fault)
                port.plug_in()
                wait_for(lambda: pads.reconnects > before)  # noqa: B023
                assert pads.zero_in_doubt
                with sending(port, 3):
                    with pytest.warns(ZeroInDoubtWarning, match=f"{port.path} was zeroed, then away"):
                        pads.read(PATIENCE)
                    pads.read(PATIENCE)  # warned only once
                    pads.zero(software=again)

    def test_a_zero_in_software_is_kept(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD) as pads:
            with sending(port, 3):
                pads.zero(software=True)
            port.unplug()
            wait_for(lambda: pads._readers[0].fault)
            port.plug_in()
            wait_for(lambda: pads.reconnects)
            assert not pads.zero_in_doubt
            port.send(message(3))
            assert count_of(pads.read(PATIENCE)) == 0

    def test_another_board_in_its_place_is_not_taken_for_it(self, port: PluggedPort, use_board) -> None:
        with open_sensor(port.path, ONE_PAD, reconnect=0.3) as pads:

            class Foreign(ScriptedBoard):
                def start(self) -> None:
                    raise ProtocolError("a board of another family answers")

            use_board(Foreign)
            port.unplug()
            port.plug_in()
            with pytest.raises(PortNotFoundError, match=r"did not come back within 0.3 s.*another family"):
                pads.read(PATIENCE)

    @pytest.mark.parametrize("reconnect", [0, 0.2])
    def test_it_does_not_come_back(self, port: PluggedPort, reconnect: float) -> None:
        with open_sensor(port.path, ONE_PAD, reconnect=reconnect) as pads:
            send_and_wait(port, pads, range(2))
            port.unplug()
            wait_for(lambda: not reader_threads())
            assert [count_of(pads.read()) for _ in range(2)] == [0, 1]
            for take in (pads.read, pads.latest, lambda: next(pads.stream())):
                with pytest.raises(PortNotFoundError, match=port.path):
                    take()

    def test_close_while_it_is_away(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD, reconnect=1000) as pads:
            port.unplug()
            wait_for(lambda: pads._readers[0].fault)
        assert not reader_threads()


class TestOpeningAndClosing:
    def test_a_name_and_a_warning(self, port: PluggedPort) -> None:
        with (
            pytest.warns(UnverifiedProfileWarning, match="gen2-box-120") as caught,
            open_sensor(port.path, "gen2-box-120") as pads,
        ):
            assert pads.profile.name == "gen2-box-120"
        assert len(caught) == 1
        assert caught[0].filename == __file__

    def test_paths(self, port: PluggedPort, tmp_path: Path) -> None:
        path = tmp_path / "mine.toml"
        path.write_text(profile_toml(ONE_PAD))
        with open_sensor(Path(port.path), path) as pads:
            assert pads.ports == (port.path,)
            assert pads.profile == ONE_PAD
        with open_sensor([Path(port.path)], str(path)) as pads:
            assert pads.ports == (port.path,)

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
    def test_bad_arguments(self, arguments: dict, error: type[Exception], says: str) -> None:
        with pytest.raises(error, match=says):
            open_sensor(**{"port": "/dev/ttyS77", "profile": ONE_PAD, **arguments})

    @pytest.mark.parametrize("error", [ProtocolError("another board"), DeviceTimeoutError("mute"), KeyboardInterrupt()])
    def test_a_board_that_does_not_start(self, tmp_path: Path, port: PluggedPort, use_board, error) -> None:
        class Bad(ScriptedBoard):
            def start(self) -> None:
                super().start()
                if "second" in repr(self.transport):
                    raise error

        use_board(Bad)
        with plugged_port(tmp_path, "second") as second:
            with pytest.raises(type(error)):
                open_sensor([port.path, second.path], ONE_PAD)
            assert not reader_threads()
            use_board(ScriptedBoard)
            # both ports were released
            open_sensor([port.path, second.path], ONE_PAD).close()

    def test_a_board_that_cannot_be_made_gives_the_port_back(self, port: PluggedPort, use_board) -> None:
        class Bad(ScriptedBoard):
            def __init__(self, *args) -> None:
                raise InvalidValueError("slots")

        use_board(Bad)
        with pytest.raises(InvalidValueError, match="slots"):
            open_sensor(port.path, ONE_PAD)
        use_board(ScriptedBoard)
        open_sensor(port.path, ONE_PAD).close()

    def test_a_port_is_opened_once(self, port: PluggedPort) -> None:
        with open_sensor(port.path, ONE_PAD), pytest.raises(PortAccessError, match="in use"):
            open_sensor(port.path, ONE_PAD)

    @pytest.mark.parametrize("ports", [1, 2])
    def test_a_forgotten_sensor_gives_its_ports_back(self, port: PluggedPort, tmp_path: Path, ports: int) -> None:
        with plugged_port(tmp_path, "second") as second:
            names = [port.path, second.path][:ports]
            pads = open_sensor(names, ONE_PAD)
            with pytest.raises(PortAccessError, match=r"close\(\) the sensor that this program opened"):
                open_sensor(names, ONE_PAD)
            with pytest.warns(ResourceWarning, match=f"sensor on {port.path}.* was not closed"):
                del pads
            assert not reader_threads()
            open_sensor(names, ONE_PAD).close()

    def test_closed(self, port: PluggedPort) -> None:
        pads = open_sensor(port.path, ONE_PAD)
        send_and_wait(port, pads, range(2))
        pads.close()
        pads.close()
        for use in (pads.read, pads.latest, pads.zero, pads.version, lambda: next(pads.stream())):
            with pytest.raises(DeviceError, match="is closed"):
                use()

    def test_close_wakes_who_waits(self, port: PluggedPort) -> None:
        pads = open_sensor(port.path, ONE_PAD)
        closer = threading.Timer(0.1, pads.close)
        closer.start()
        with pytest.raises(DeviceError, match="is closed"):
            pads.read(PATIENCE)
        closer.join()

    def test_repr(self, port: PluggedPort) -> None:
        with open_sensor(port.path, TWO_PADS) as pads:
            assert repr(pads) == (
                f"<TactileSensor scripted-two on {port.path}: open, 2 pads of 2x3, "
                "0 dropped, 0 reconnects, 2 bad checksums>"
            )
        assert "closed" in repr(pads)


class TestSeveralPorts:
    @pytest.fixture
    def second(self, tmp_path: Path) -> Iterator[PluggedPort]:
        with plugged_port(tmp_path, "second") as port:
            yield port

    def test_pads_one_after_another(self, port: PluggedPort, second: PluggedPort) -> None:
        with open_sensor([port.path, second.path], TWO_PADS) as pads:
            assert pads.pads == ("left0", "right0", "left1", "right1")
            assert pads.version() == "scripted 1.0\nscripted 1.0"
            for i in range(10):
                second.send(message(100 + i))
                port.send(message(i))
            frame = pads.read(PATIENCE)
            assert frame.force.shape == (4, 3, 2, 3)
            assert frame.resultant is not None
            assert frame.resultant.shape == (4, 3)
            assert len(frame.status) == 4
            assert count_of(frame) < 10
            np.testing.assert_array_equal(frame.force[0], frame.force[1])
            assert frame.force[2].min() >= 10
            assert frame.time <= frame.arrival

    def test_one_of_them_goes_away_and_comes_back(self, port: PluggedPort, second: PluggedPort) -> None:
        with open_sensor([port.path, second.path], ONE_PAD) as pads, sending(port, 1):
            second.send(message(2))
            assert pads.read(PATIENCE).force[1].max() == np.float32(0.2)
            second.unplug()
            wait_for(lambda: pads.latest(PATIENCE).status == (0, STALE_STATUS))
            second.plug_in()
            wait_for(lambda: pads.reconnects)
            second.send(message(3))
            wait_for(lambda: pads.latest(PATIENCE).force[1].max() == np.float32(0.3))

    def test_one_of_them_stays_away(self, port: PluggedPort, second: PluggedPort) -> None:
        with open_sensor([port.path, second.path], ONE_PAD, reconnect=0.1) as pads:
            second.unplug()
            with pytest.raises(PortNotFoundError, match="second"):
                pads.read(PATIENCE)
