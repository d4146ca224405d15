"""A serial port as bytes: reading, writing, unplugging, and the words of what cannot be opened."""

import os
import socket
import threading
from contextlib import closing

import pytest

from paxisim import (
    DeviceTimeoutError,
    InvalidValueError,
    MissingExtraError,
    PortAccessError,
    PortNotFoundError,
    UnsupportedError,
)
from paxisim.hw.link.transport import open_transport

pytest.importorskip("serial")

from serial.tools.list_ports_common import ListPortInfo
from serial_peers import PATIENCE, plugged_port, wait_for


@pytest.fixture
def port(tmp_path):
    with plugged_port(tmp_path) as port:
        yield port


@pytest.fixture
def transport(port):
    with closing(open_transport(port.path, 921600)) as transport:
        yield transport


def read(transport, count):
    got = b""
    while len(got) < count:
        more = transport.read(PATIENCE)
        assert more, got
        got += more
    return got


# ---- bytes


def test_bytes_go_both_ways_unchanged(port, transport):
    data = bytes(range(256)) * 3
    port.send(data)
    wait_for(lambda: transport._serial.in_waiting == len(data))
    assert transport.read(PATIENCE) == data  # all that is there at once
    transport.write(data)
    assert port.receive(len(data)) == data
    later = threading.Timer(0.1, port.send, [b"late"])
    later.start()
    assert read(transport, 4) == b"late"
    later.join()
    for timeout in (0.02, 0, -1):
        assert transport.read(timeout) == b""
    port.send(b"old")
    wait_for(lambda: transport._serial.in_waiting == 3)
    transport.discard_input()
    port.send(b"new")
    assert read(transport, 3) == b"new"


def test_what_is_stuck_times_out(port, transport):
    with pytest.raises(DeviceTimeoutError, match="did not take"):
        transport.write(bytes(1_000_000))  # more than the system buffers


@pytest.mark.parametrize("use", ["read", "write", "discard_input"])
def test_unplugged_and_closed(port, transport, use):
    arguments = {"read": (PATIENCE,), "write": (b"x",), "discard_input": ()}[use]
    port.unplug()
    with pytest.raises(PortNotFoundError, match="went away"):
        getattr(transport, use)(*arguments)
    assert "open" in repr(transport)
    transport.close()
    transport.close()
    assert "closed" in repr(transport)
    with pytest.raises(PortNotFoundError, match="is closed"):
        getattr(transport, use)(*arguments)


def test_unplugged_while_it_waits(port, transport):
    later = threading.Timer(0.1, port.unplug)
    later.start()
    with pytest.raises(PortNotFoundError, match=port.path):
        transport.read(PATIENCE)
    later.join()


def test_urls():
    with closing(open_transport("loop://", 460800)) as transport:
        assert transport.read(0.01) == b""
        transport.write(b"there and back")
        assert read(transport, 14) == b"there and back"
        transport.write(b"old")
        transport.discard_input()
        assert transport.read(0) == b""
    with closing(socket.create_server(("127.0.0.1", 0))) as server:
        name = f"socket://127.0.0.1:{server.getsockname()[1]}"
        with closing(open_transport(name, 460800)) as transport:
            with closing(server.accept()[0]) as peer:
                data = bytes(range(256)) * 100
                peer.sendall(data)
                assert read(transport, len(data)) == data
                assert transport.read(0.01) == b""
                transport.write(b"hello")
                assert peer.recv(100) == b"hello"
            with pytest.raises(PortNotFoundError, match="went away"):
                transport.read(PATIENCE)
    with pytest.raises(PortNotFoundError, match="cannot open"):
        open_transport(name, 460800)


# ---- what cannot be opened


def test_no_such_port_names_those_there_are(monkeypatch):
    found = []
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: found)
    with pytest.raises(PortNotFoundError, match="plugged in"):
        open_transport("/dev/ttyACM97", 9600)
    for name in ("/dev/ttyACM98", "/dev/modem"):
        info = ListPortInfo(name)
        info.description = "tactile box"
        found.append(info)
    near = r"no port '/dev/ttyACM97'; did you mean /dev/ttyACM98 \(tactile box\)\?$"
    with pytest.raises(PortNotFoundError, match=near):
        open_transport("/dev/ttyACM97", 9600)
    with pytest.raises(PortNotFoundError, match=r"there are: /dev/modem \(tactile box\), /dev/ttyACM98"):
        open_transport("COM3", 9600)


@pytest.mark.parametrize(
    ("name", "error", "says"),
    [
        ("link", PortNotFoundError, "no port"),
        ("file", PortNotFoundError, "not a serial port"),
        (".", PortNotFoundError, "not a serial port"),
        ("hwgrep://no such device", PortNotFoundError, "no ports found"),
        ("serial2000://x", InvalidValueError, "port 'serial2000://x'"),
        ("nothing://", InvalidValueError, "port 'nothing://'"),
    ],
)
def test_what_is_no_port(tmp_path, name, error, says):
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    (tmp_path / "file").write_text("no port")
    with pytest.raises(error, match=says):
        open_transport(name if "://" in name else str(tmp_path / name), 9600)


def test_what_is_no_baud_rate_and_what_the_port_refuses(port):
    for baud in (0, -9600, 9600.0, "9600", True):
        with pytest.raises(InvalidValueError, match="baud"):
            open_transport(port.path, baud)
    with pytest.raises(UnsupportedError, match=f"{10**12} baud"):
        open_transport(port.path, 10**12)
    open_transport(port.path, 9600).close()  # the failed attempt left the port closed


def test_a_port_that_another_has_or_that_may_not_be_opened(port, transport, monkeypatch):
    with pytest.raises(PortAccessError, match="in use"):
        open_transport(port.path, 921600)

    def refuse(*_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("serial.serialposix.os.open", refuse)  # patched, because root may open any port
    with pytest.raises(PortAccessError, match=r"dialout.*udev"):
        open_transport(port.path, 9600)


def test_without_pyserial(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "serial", None)
    with pytest.raises(MissingExtraError, match=r"paxisim\[hw\]"):
        open_transport("/dev/ttyACM0", 9600)


# ---- files of the process


def test_a_port_beyond_a_thousand_files_is_refused_in_words(port):
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    if 0 <= before[1] < 2048:
        pytest.skip("this system allows too few files")
    resource.setrlimit(resource.RLIMIT_NOFILE, (2048, before[1]))
    held = [os.open(os.devnull, os.O_RDONLY) for _ in range(1024)]
    try:
        with closing(open_transport(port.path, 9600)) as transport:
            for use in (lambda: transport.write(b"x"), lambda: transport.read(0)):
                with pytest.raises(UnsupportedError, match=r"about 1024 files open.*open the sensor first"):
                    use()
    finally:
        for descriptor in held:
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="this system does not list open files")
def test_no_file_stays_open(port, tmp_path):
    (tmp_path / "file").write_text("no port")
    before = os.listdir("/proc/self/fd")
    for name in (port.path, str(tmp_path / "file")):
        for baud in (9600, 10**12):
            try:
                open_transport(name, baud).close()
            except (PortNotFoundError, UnsupportedError):
                continue
    assert len(os.listdir("/proc/self/fd")) == len(before)
