import os
import socket
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from paxisim.errors import (
    DeviceTimeoutError,
    InvalidValueError,
    MissingExtraError,
    PortAccessError,
    PortNotFoundError,
    UnsupportedError,
)
from paxisim.hw.link.transport import SerialTransport, open_transport

pytest.importorskip("serial")
pytest.importorskip("pty", reason="no pseudo-terminals here")

from serial.tools.list_ports_common import ListPortInfo
from serial_peers import PATIENCE, PluggedPort, plugged_port, wait_for


@pytest.fixture
def port(tmp_path: Path) -> Iterator[PluggedPort]:
    with plugged_port(tmp_path) as port:
        yield port


@pytest.fixture
def transport(port: PluggedPort) -> Iterator[SerialTransport]:
    with closing(open_transport(port.path, 921600)) as transport:
        yield transport


def read(transport: SerialTransport, count: int) -> bytes:
    got = b""
    while len(got) < count:
        more = transport.read(PATIENCE)
        assert more, got
        got += more
    return got


def test_bytes_go_both_ways_unchanged(port: PluggedPort, transport: SerialTransport) -> None:
    data = bytes(range(256)) * 3
    port.send(data)
    assert read(transport, len(data)) == data
    transport.write(data)
    assert port.receive(len(data)) == data


def test_read_returns_all_that_is_there_at_once(port: PluggedPort, transport: SerialTransport) -> None:
    port.send(b"x" * 1000)
    wait_for(lambda: transport._serial.in_waiting == 1000)
    assert transport.read(PATIENCE) == b"x" * 1000


def test_read_waits_for_bytes(port: PluggedPort, transport: SerialTransport) -> None:
    later = threading.Timer(0.1, port.send, [b"late"])
    later.start()
    assert read(transport, 4) == b"late"
    later.join()


def test_read_returns_nothing_where_nothing_comes(transport: SerialTransport) -> None:
    assert transport.read(0.02) == b""
    assert transport.read(0) == b""
    assert transport.read(-1) == b""


def test_discard_input(port: PluggedPort, transport: SerialTransport) -> None:
    port.send(b"old")
    wait_for(lambda: transport._serial.in_waiting == 3)
    transport.discard_input()
    port.send(b"new")
    assert read(transport, 3) == b"new"


@pytest.mark.parametrize(
    "use",
    [
        lambda transport: transport.read(PATIENCE),
        lambda transport: transport.write(b"x"),
        lambda transport: transport.discard_input(),
    ],
    ids=["read", "write", "discard_input"],
)
def test_unplugged(port: PluggedPort, transport: SerialTransport, use) -> None:
    port.unplug()
    with pytest.raises(PortNotFoundError, match="went away"):
        use(transport)
    transport.close()
    with pytest.raises(PortNotFoundError, match="is closed"):
        use(transport)


def test_unplugged_while_it_waits(port: PluggedPort, transport: SerialTransport) -> None:
    later = threading.Timer(0.1, port.unplug)
    later.start()
    with pytest.raises(PortNotFoundError, match=port.path):
        transport.read(PATIENCE)
    later.join()


def test_what_is_stuck_times_out(port: PluggedPort, transport: SerialTransport) -> None:
    with pytest.raises(DeviceTimeoutError, match="did not take"):
        transport.write(bytes(1_000_000))  # more than the system buffers


def test_close_twice_and_open_again(port: PluggedPort) -> None:
    for _ in range(2):
        transport = open_transport(port.path, 460800)
        assert "open" in repr(transport)
        transport.close()
        transport.close()
        assert "closed" in repr(transport)


def test_no_such_port_names_those_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    found = []
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: found)
    with pytest.raises(PortNotFoundError, match="plugged in"):
        open_transport("/dev/ttyACM97", 9600)
    for name in ("/dev/ttyACM98", "/dev/modem"):
        info = ListPortInfo(name)
        info.description = "tactile box"
        found.append(info)
    with pytest.raises(
        PortNotFoundError, match=r"no port '/dev/ttyACM97'; did you mean /dev/ttyACM98 \(tactile box\)\?$"
    ):
        open_transport("/dev/ttyACM97", 9600)
    with pytest.raises(PortNotFoundError, match=r"there are: /dev/modem \(tactile box\), /dev/ttyACM98"):
        open_transport("COM3", 9600)


def test_a_link_to_nowhere_a_file_and_a_folder_are_no_ports(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    (tmp_path / "file").write_text("no port")
    with pytest.raises(PortNotFoundError, match="no port"):
        open_transport(str(tmp_path / "link"), 9600)
    for name in ("file", ""):
        with pytest.raises(PortNotFoundError, match="not a serial port"):
            open_transport(str(tmp_path / name), 9600)


def test_a_port_that_another_has(port: PluggedPort, transport: SerialTransport) -> None:
    with pytest.raises(PortAccessError, match="in use"):
        open_transport(port.path, 921600)


def test_no_permission_says_how_to_get_it(port: PluggedPort, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("serial.serialposix.os.open", refuse)  # patched, because root may open any port
    with pytest.raises(PortAccessError, match=r"dialout.*udev"):
        open_transport(port.path, 9600)


@pytest.mark.parametrize("baud", [0, -9600, 9600.0, "9600", True])
def test_what_is_no_baud_rate(port: PluggedPort, baud) -> None:
    with pytest.raises(InvalidValueError, match="baud"):
        open_transport(port.path, baud)


def test_a_baud_rate_that_the_port_refuses(port: PluggedPort) -> None:
    with pytest.raises(UnsupportedError, match=f"{10**12} baud"):
        open_transport(port.path, 10**12)
    open_transport(port.path, 9600).close()  # the failed attempt left the port closed


def test_loop() -> None:
    with closing(open_transport("loop://", 460800)) as transport:
        assert transport.read(0.01) == b""
        transport.write(b"there and back")
        assert read(transport, 14) == b"there and back"
        transport.write(b"old")
        transport.discard_input()
        assert transport.read(0) == b""


def test_socket() -> None:
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


@pytest.mark.parametrize("url", ["serial2000://x", "nothing://"])
def test_unknown_url(url: str) -> None:
    with pytest.raises(InvalidValueError, match=f"port '{url}'"):
        open_transport(url, 9600)


def test_pattern_that_fits_no_port() -> None:
    with pytest.raises(PortNotFoundError, match="no ports found"):
        open_transport("hwgrep://no such device", 9600)


def test_without_pyserial(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "serial", None)
    with pytest.raises(MissingExtraError, match=r"paxisim\[hw\]"):
        open_transport("/dev/ttyACM0", 9600)


def test_a_port_beyond_a_thousand_files_is_refused_in_words(port: PluggedPort) -> None:
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


def test_no_file_stays_open(port: PluggedPort, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no port")
    before = os.listdir("/proc/self/fd") if os.path.isdir("/proc/self/fd") else []
    for name in (port.path, "file"):
        for baud in (9600, 10**12):
            try:
                open_transport(str(tmp_path / name), baud).close()
            except (PortNotFoundError, UnsupportedError):
                continue
    if before:
        assert len(os.listdir("/proc/self/fd")) == len(before)
