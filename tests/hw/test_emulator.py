"""The emulator behaves like a serial port, at the speed of the line."""

import dataclasses
import os
import time

import numpy as np
import pytest
from emulated import Numbered, constant, small
from serial_peers import wait_for

from paxisim import DeviceError, Emulator, InvalidValueError
from paxisim.hw.emulation.faults import Faults
from paxisim.hw.emulation.pacing import PacedLine
from paxisim.hw.families import registers
from paxisim.hw.families.high_speed import wire as high_speed
from paxisim.hw.link.framing import FrameDecoder

serial = pytest.importorskip("serial")

pytestmark = pytest.mark.real_time

PACED = small("high-speed", [("pad", 0)], rate=200.0, baud=115200)
DEADLINE = 20.0


def read_until(port, enough, data=b""):
    """Read from the port until `enough(data)` is true and return all bytes."""
    deadline = time.monotonic() + DEADLINE
    while not enough(data):
        assert time.monotonic() < deadline, f"only {len(data)} bytes arrived"
        data += port.read(max(port.in_waiting, 1))
    return data


def pushes_in(data):
    return FrameDecoder(high_speed.parse_push).feed(data)


def test_what_leaves_is_what_comes_byte_for_byte():
    with Emulator(PACED, Numbered(PACED), pace=False, record_sent=True) as emulator:
        with serial.Serial(emulator.port, 115200, timeout=0.2) as port:
            port.write(high_speed.push_request(True).encode())
            # enough data to contain every byte value, so a terminal that translates some bytes is detected
            data = read_until(port, lambda data: len(data) > 50_000)
        sent = b"".join(item.message for item in list(emulator.sent))
    assert set(data) == set(range(256))
    assert data == sent[: len(data)]
    assert emulator.overruns == 0
    assert all(item.message == item.written for item in emulator.sent)


def test_a_stream_keeps_to_its_rate_and_its_line():
    start = time.monotonic()
    with Emulator(PACED, Numbered(PACED)) as emulator, serial.Serial(emulator.port, 115200, timeout=0.2) as port:
        port.write(high_speed.push_request(True).encode())
        data = read_until(port, lambda data: len(pushes_in(data)) > 60)
        seconds = time.monotonic() - start
    # a slow machine may fall short of the rate
    assert len(data) <= 11520 * seconds
    assert len(pushes_in(data)) - 2 <= 200 * seconds


def test_a_host_that_does_not_read_loses_bytes_and_gets_fresh_ones():
    fast = dataclasses.replace(PACED, baud=50_000_000)
    with Emulator(fast, Numbered(fast), rate=1e6) as quick, serial.Serial(quick.port, 115200, timeout=0.2) as port:
        port.write(high_speed.push_request(True).encode())
        wait_for(lambda: quick.overruns > 0)
        sent = quick.messages
        read_until(port, lambda data: len(pushes_in(data)) > 3 and quick.messages > sent)


def test_a_link_follows_the_port(tmp_path):
    link = tmp_path / "sensor"
    with Emulator(PACED, Numbered(PACED), link=link) as emulator:
        assert emulator.port == str(link)
        first = os.readlink(link)
        port = serial.Serial(str(link), 115200, timeout=0.2)
        emulator.unplug()
        assert not emulator.plugged
        assert not link.is_symlink()
        with pytest.raises(DeviceError, match="unplugged"):
            _ = emulator.port
        deadline = time.monotonic() + DEADLINE
        with pytest.raises((serial.SerialException, OSError)):  # noqa: PT012
            while time.monotonic() < deadline:
                port.read(1)
        emulator.plug()
        # the old pseudo-terminal is still open, so the new one has another name
        assert os.readlink(link) != first
        port.close()
        with serial.Serial(str(link), 115200, timeout=0.2) as port:
            port.write(high_speed.version_request().encode())
            read_until(port, lambda data: len(data) > 15)
    assert not link.is_symlink()


def test_unplugging_after_so_many_messages_and_power_on_again():
    signal = constant(PACED)
    with Emulator(PACED, signal, faults=Faults(unplug_after=5), pace=False) as emulator:
        with serial.Serial(emulator.port, 115200, timeout=0.2) as port:
            port.write(high_speed.push_request(True).encode())
            wait_for(lambda: not emulator.plugged)
        assert emulator.messages == 5
        emulator.plug()
        with serial.Serial(emulator.port, 115200, timeout=0.2) as port:
            port.write(high_speed.read_request(registers.HIGH_SPEED_PUSH, 1).encode())
            data = read_until(port, lambda data: len(data) >= 10)
        assert FrameDecoder(high_speed.parse_reply).feed(data)[0].data == b"\0"


def test_noise_comes_once_when_the_port_is_opened():
    with Emulator(PACED, Numbered(PACED), faults=Faults(noise=50), pace=False) as emulator:
        device = os.open(emulator.port, os.O_RDWR | os.O_NOCTTY)
        noise = b""
        while len(noise) < 50:
            noise += os.read(device, 50)
        os.close(device)
        time.sleep(0.1)  # usually enough for the emulator to notice the close; if not, no further noise is due anyway
        with serial.Serial(emulator.port, 115200, timeout=0.2) as port:
            port.write(high_speed.version_request().encode())
            assert len(read_until(port, lambda data: len(data) >= 24)) == 24


def test_a_signal_that_fails_later_ends_the_emulator_with_its_words():
    def signal(now):
        if now > 0:
            raise KeyError("finger")
        return np.zeros((1, 3, 3, 4))

    emulator = Emulator(PACED, signal).start()
    with serial.Serial(emulator.port, 115200, timeout=0.2) as port:
        port.write(high_speed.push_request(True).encode())
        with pytest.raises(InvalidValueError, match="KeyError: 'finger'"):
            emulator.wait(DEADLINE)
    assert not emulator.plugged
    emulator.stop()
    emulator.stop()


def test_bytes_take_their_time():
    line = PacedLine(1000.0)
    line.put([(0.0, b"a" * 100), (0.5, b"b" * 100)], 10.0)
    assert line.free_at == pytest.approx(10.7)
    assert line.take(10.0) == b""
    assert line.take(10.0505) == b"a" * 50
    assert line.take(10.3) == b"a" * 50
    assert line.next == pytest.approx(10.602, abs=2e-3)
    assert line.take(10.6505) == b"b" * 50
    assert line.take(99.0) == b"b" * 50
    assert line.next == np.inf
    line.put([(0.0, b"c")], 99.0)
    line.clear()
    assert line.take(100.0) == b""


def test_no_byte_is_lost_or_early_on_a_paced_line_and_a_fast_one_lets_all_pass_at_once():
    for sizes in ((1, 7, 300), (5000,)):
        line, now, came = PacedLine(46080.0), 0.0, b""
        sent = b"".join(bytes([i]) * size for i, size in enumerate(sizes))
        line.put([(0.0, bytes([i]) * size) for i, size in enumerate(sizes)], now)
        while line.next < np.inf:
            now = line.next
            came += line.take(now)
            assert len(came) <= 46080 * now + 1e-6
        assert came == sent
        assert now == pytest.approx(len(sent) / 46080)
    line = PacedLine()
    line.put([(0.0, b"abc"), (1.0, b"def")], 0.0)
    assert line.take(0.0) == b"abc"
    assert line.take(1.0) == b"def"
