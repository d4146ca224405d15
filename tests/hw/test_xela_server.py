"""XELA uSkin: JSON from the vendor's server over a WebSocket, as raw counts or calibrated forces."""

import contextlib
import itertools
import json
import re
import socket
import threading
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import paxisim
from paxisim import DeviceTimeoutError, InvalidValueError, PortNotFoundError, ProtocolError, Slot, load_profile
from paxisim.cli import main
from paxisim.hw.emulation.faults import Faults
from paxisim.hw.emulation.signals import press
from paxisim.hw.families.xela_server.wire import COUNTS_MIDDLE, MAX_MESSAGE_BYTES, WELCOME, RoutineDecoder
from paxisim.hw.link.frame_joiner import STALE_STATUS
from paxisim.hw.link.recognise import describe

pytest.importorskip("websockets", reason="needs the extra websocket")

from serial_peers import PATIENCE
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.sync.server import serve

from paxisim import Emulator, open_sensor
from paxisim.hw.link.websocket import open_websocket

pytestmark = pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")

TAXELS = 16
FORCE = np.linspace(-2, 3, 3 * TAXELS).reshape(1, 3, 4, 4)


def sensor(number=1, taxels=TAXELS, **other):
    """The server's entry for one sensor, with the keys that its public client reads."""
    data = ",".join(f"{0x8000 + 10 * number + i:X}" for i in range(3 * taxels))
    return {"time": 1.7e9, "sensor": str(number), "model": "uSPa44", "taxels": taxels, "data": data} | other


def routine(number: int = 1, **sensors: Any):
    return {"message": number, "type": "routine"} | (sensors or {"1": sensor()})


def line(message):
    return json.dumps(message).encode() + b"\n"


@contextlib.contextmanager
def listening(talk):
    """Context manager: address of a server that calls `talk(connection)` for each client."""
    with serve(talk, "127.0.0.1", 0, close_timeout=1) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        yield f"ws://127.0.0.1:{running.socket.getsockname()[1]}"


@contextlib.contextmanager
def spoken(*messages, rate=50.0):
    """Context manager: address of a server that welcomes once, then sends the messages repeatedly in turn.

    Messages of number 1 are numbered. A text is sent as it is.
    """
    over, number = threading.Event(), itertools.count(1)
    texts = [message if isinstance(message, str) else json.dumps(message) for message in messages]

    def talk(connection):
        with contextlib.suppress(ConnectionClosed):
            connection.send('{"message": "Welcome"}')
            while not over.wait(1 / rate):
                for text in texts:
                    connection.send(re.sub(r'"message": 1\b', lambda _: f'"message": {next(number)}', text))

    with listening(talk) as address:
        try:
            yield address
        finally:
            over.set()


# ---- texts, without a server


def test_a_message_as_the_public_client_reads_it():
    decoder = RoutineDecoder()
    (found,) = decoder.feed(WELCOME + line(routine(7, **{"1": sensor(), "12": sensor(12, calibrated=[0.5] * 48)})))
    assert found.number == 7
    assert sorted(found.sensors) == [1, 12]
    np.testing.assert_array_equal(found.sensors[1].counts.ravel(), COUNTS_MIDDLE + 10 + np.arange(48))
    assert found.sensors[1].forces is None
    np.testing.assert_array_equal(found.sensors[12].forces, np.full((16, 3), 0.5))
    assert (decoder.skipped, decoder.pending) == (0, 0)


NO_MESSAGES = [
    b"[" * 100_000,
    b'{"message": ' + b"9" * 5000 + b', "type": "routine"}',
    line({"hello": 1}),
    line([1, 2]),
    line({"message": 1, "type": "routine", "1": 5}),
    line(routine(**{"1": sensor(data="7F00,zz,1")})),
    line(routine(**{"1": sensor(data="7F00,-1,1", taxels=1)})),
    line(routine(**{"1": sensor(data="F" * 5000 + ",1,1", taxels=1)})),
    line(routine(**{"1": sensor() | {"taxels": [16]}})),
    line(routine(**{"1": sensor() | {"taxels": 15}})),
    line(routine(**{"1": sensor(model=None)})),
    line(routine(**{"1": sensor(data="FFFFFF,1,1", taxels=1)})),
    line(routine(**{"1": sensor(data="0x7_f,1,1", taxels=1)})),
    line(routine(**{"1": sensor(2)})),
    line(routine() | {"message": True}),
    line(routine()).replace(b"}", b"\xff}"),
    line(routine())[:-20] + b"\n",
]


def test_what_is_no_message_is_left_out():
    for text in NO_MESSAGES:
        decoder = RoutineDecoder()
        found = decoder.feed(text + b"\n" + line(routine(2)))
        assert [message.number for message in found] == [2], text[:80]
        assert decoder.skipped == len(text) + 1, text[:80]
    decoder = RoutineDecoder()
    for _ in range(10):
        decoder.feed(b"x" * MAX_MESSAGE_BYTES)  # without end
        assert decoder.pending <= MAX_MESSAGE_BYTES
    assert [m.number for m in decoder.feed(b"\n" + line(routine(3)))] == [3]


def test_odd_values_are_no_forces_and_a_key_with_a_zero_no_sensor():
    for values in (["a"] * 48, [0.0] * 47, [1e9] * 48, [True] * 48, {"0": 1}, [[0.0] * 3] * 16):
        (found,) = RoutineDecoder().feed(line(routine(**{"1": sensor(calibrated=values)})))
        assert found.sensors[1].forces is None, values
    twice = routine(**{"1": sensor(), "01": sensor(sensor="01", data="1,1,1", taxels=1)})
    (found,) = RoutineDecoder().feed(line(twice))
    assert found.sensors[1].taxels == TAXELS


def test_what_is_heard_is_named():
    assert "3 messages of the family 'xela-counts'" in describe(WELCOME + 3 * line(routine()))


# ---- the driver against a server


@pytest.mark.real_time
def test_counts_are_read_from_the_middle():
    profile = load_profile("xela-uspa44")
    assert (profile.unit, profile.slots, profile.settings) == ("counts", (Slot("pad", 1),), {"model": "uSPa44"})
    with spoken(routine()) as address, open_sensor(address, "xela-uspa44") as pads:
        frame = pads.read(PATIENCE)
        assert (frame.unit, frame.force.shape, frame.force.dtype) == ("counts", (1, 3, 4, 4), np.float32)
        np.testing.assert_array_equal(frame.force, 10 + np.arange(48).reshape(16, 3).T.reshape(1, 3, 4, 4))
        assert (frame.status, frame.resultant, pads.version(), pads.skipped) == ((0,), None, "", 0)


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("messages", "profile", "error", "says"),
    [
        ([{"hello": 1}], "xela-uspa44", ProtocolError, "received something else: text of no family: "),
        ([routine(**{"2": sensor(2)})], "xela-uspa44", ProtocolError, "no sensor 1, .*'xela-uspa44' .*it has 2"),
        ([routine(**{"1": sensor(taxels=12)})], "xela-uspa44", ProtocolError, "uSPa44 with 12 taxels, but .* with 16"),
        ([routine(**{"1": sensor(model="uSPa46")})], "xela-uspa44", ProtocolError, "uSPa46 with 16 .* is for uSPa44"),
        ([routine()], "xela-uspa44-calibrated", ProtocolError, "no calibrated values for sensor 1 .*enable them"),
        ([{"message": 3, "type": "routine"}], "xela-uspa44", ProtocolError, "no sensor 1.* it has none"),
        ([], "xela-uspa44", DeviceTimeoutError, "has no sensor: are they connected"),
        (["x" * (MAX_MESSAGE_BYTES + 1)], "xela-uspa44", ProtocolError, f"more than {MAX_MESSAGE_BYTES} bytes"),
    ],
    ids=["no family", "other sensor", "taxels", "model", "uncalibrated", "none", "only welcome", "too long"],
)
def test_a_server_that_is_not_the_profiles_is_named(messages, profile, error, says):
    with spoken(*messages) as address, pytest.raises(error, match=says):
        open_sensor(address, profile, reconnect=0)


@pytest.mark.real_time
def test_addresses_that_lead_nowhere_are_named(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        closed = f"ws://127.0.0.1:{taken.getsockname()[1]}"
    with pytest.raises(PortNotFoundError, match=f"cannot connect to {closed}: .*is the sensor's server running"):
        open_sensor(closed, "xela-uspa44")
    for address in ("ws://", "ws://nowhere at all", "/dev/ttyACM0", "http://127.0.0.1"):
        with pytest.raises((InvalidValueError, PortNotFoundError), match=r"WebSocket server|cannot connect"):
            open_sensor(address, "xela-uspa44")
    with pytest.raises(InvalidValueError, match=f"port '{closed}' is not a serial port"):
        open_sensor(closed, "gen2-box-120")
    with contextlib.closing(socket.create_server(("127.0.0.1", 0))) as web:

        def answer():
            with contextlib.suppress(OSError), web.accept()[0] as other:
                other.recv(4096)
                other.sendall(b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\n\r\n")

        threading.Thread(target=answer, daemon=True).start()
        with pytest.raises(ProtocolError, match="is not a WebSocket server"):
            open_sensor(f"ws://127.0.0.1:{web.getsockname()[1]}", "xela-uspa44")
    assert main(["record", closed, "--profile", "xela-uspa44", "-o", "never.mcap"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "cannot connect" in said


@pytest.mark.real_time
def test_a_pad_that_a_message_leaves_out_is_in_error_and_others_are_read_on():
    both = routine(1, **{"1": sensor(), "2": sensor(2)})
    profile = replace(load_profile("xela-uspa44"), slots=(Slot("left", 2), Slot("right", 1)))
    broken = [routine(1, **{"1": sensor()}), routine(1, **{"1": sensor(), "2": sensor(2, taxels=3)})]
    with spoken(both, *broken, rate=2.0) as address, open_sensor(address, profile) as pads:
        frames = [pads.read(PATIENCE) for _ in range(6)]
    assert {frame.status for frame in frames} == {(0, 0), (1, 0)}
    assert sum(frame.status == (1, 0) for frame in frames) >= 3
    for frame in frames:
        assert frame.force[1].min() == 10
        assert frame.force[0].min() == (20 if frame.status == (0, 0) else 0)


@pytest.mark.real_time
def test_repeated_and_missing_messages_and_other_sensors_are_told():
    texts = [routine(n, **{"1": sensor(model=model)}) for n, model in ((2, "uSPa44"), (2, "uSPa44"), (7, "uSPa46"))]
    with spoken(*texts, rate=2.0) as address, open_sensor(address, "xela-uspa44") as pads:
        frames = [pads.read(PATIENCE) for _ in range(3)]
        assert [frame.status for frame in frames] == [(0,), (STALE_STATUS,), (1,)]
        assert pads.timeouts == 4


@pytest.mark.real_time
def test_a_server_that_does_not_answer_is_not_waited_for():
    over = threading.Event()

    def freeze(connection):
        with connection.protocol_mutex:  # no frame is handled meanwhile
            over.wait(PATIENCE)

    with listening(freeze) as address:
        transport = open_websocket(address, 0)
        began = time.monotonic()
        transport.close()
        took = time.monotonic() - began
        over.set()
    assert took < 5


@pytest.mark.real_time
def test_a_server_that_pauses_is_waited_for():
    profile = load_profile("xela-uspa44")
    faults = Faults(stall=0.02, stall_seconds=2.5)
    with (
        Emulator(profile, lambda now: FORCE * 100, faults=faults, seed=3) as emulator,
        open_sensor(emulator.port, profile) as pads,
    ):
        with pytest.raises(DeviceTimeoutError, match=r"no frame from ws:.* within 1 s"):
            for _ in pads.stream(1.0):
                pass
        np.testing.assert_array_equal(pads.read(PATIENCE).force, np.rint(FORCE * 100))


@pytest.mark.real_time
def test_damaged_texts_make_no_wrong_frame():
    profile = load_profile("xela-uspa44")
    with (
        Emulator(profile, lambda now: FORCE * 100, faults=Faults(drop=5e-4), seed=4) as emulator,
        open_sensor(emulator.port, profile) as pads,
    ):
        good = [frame for frame in (pads.read(PATIENCE) for _ in range(100)) if not any(frame.status)]
        assert pads.skipped > 0
    # JSON has no check byte, so a lost digit gives another number; a lost comma or quote invalidates the message
    wrong = np.array([(frame.force != np.rint(FORCE * 100)).sum() for frame in good])
    assert wrong.max() <= 3
    assert np.mean(wrong > 0) < 0.25


@pytest.mark.real_time
def test_four_pads_at_100_hz_without_a_drop():
    slots = tuple(Slot(f"pad{i}", i + 1) for i in range(4))
    profile = replace(load_profile("xela-uspa44"), slots=slots)
    with (
        Emulator(profile, lambda now: np.repeat(FORCE, 4, axis=0) * 100, rate=100.0) as emulator,
        open_sensor(emulator.port, profile) as pads,
    ):
        before = emulator.messages
        frames = [pads.read(PATIENCE) for _ in range(250)]
        sent = emulator.messages - before
    assert (pads.dropped, pads.skipped, pads.timeouts, emulator.overruns) == (0, 0, 0, 0)
    assert sent <= 253
    assert frames[0].force.shape == (4, 3, 4, 4)
    assert [frame.sequence for frame in frames] == list(range(250))
    assert 1 / np.median(np.diff([frame.time for frame in frames])) == pytest.approx(100, rel=0.05)


@pytest.mark.real_time
@pytest.mark.slow
def test_several_hosts_and_the_verbs_read_one_server(tmp_path, capsys):
    profile, path = load_profile("xela-uspa44"), tmp_path / "uskin.mcap"
    calibrated = load_profile("xela-uspa44-calibrated")
    with Emulator(calibrated, lambda now: FORCE) as emulator, open_sensor(emulator.port, profile) as raw:
        assert raw.read(PATIENCE).unit == "counts"
        with open_sensor(emulator.port, calibrated) as pads:
            frame = pads.read(PATIENCE)
        assert frame.unit == "N"
        np.testing.assert_allclose(frame.force, FORCE, atol=1e-4)
    with Emulator(profile, press(profile)) as emulator, connect(emulator.port, proxy=None) as one:
        assert json.loads(one.recv(PATIENCE)) == {"message": "Welcome"}
        message = json.loads(one.recv(PATIENCE))
        assert message["1"]["taxels"] == 16
        assert len(message["1"]["data"].split(",")) == 48
        common = [emulator.port, "--profile", "xela-uspa44", "--seconds", "1"]
        assert main(["record", *common, "-o", str(path)]) == 0
        assert json.loads(one.recv(PATIENCE))["type"] == "routine"
        assert main(["device", "quality", *common]) == 0
        assert "counts/min" in capsys.readouterr().out
    assert paxisim.Recording.load(path).unit == "counts"
    emulate = ["emulate", "--profile", "xela-uspa44", "--seconds", "0"]
    assert main([*emulate, "--signal", str(path)]) == 0
    assert capsys.readouterr().out.startswith("ws://127.0.0.1:")
    assert main([*emulate, "--link", str(tmp_path / "link")]) == 2
    assert "a link is made to the file of a serial port" in capsys.readouterr().err
