"""XELA uSkin: JSON from the vendor's server over a WebSocket, as raw counts or calibrated forces."""

from __future__ import annotations

import contextlib
import itertools
import json
import re
import socket
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import paxisim
from paxisim.cli import main
from paxisim.errors import DeviceTimeoutError, InvalidValueError, PortNotFoundError, ProtocolError
from paxisim.hw.emulation.faults import Faults
from paxisim.hw.emulation.signals import press
from paxisim.hw.families.xela_server.wire import (
    COUNTS_MIDDLE,
    MAX_MESSAGE_BYTES,
    WELCOME,
    Routine,
    RoutineDecoder,
    SensorReading,
)
from paxisim.hw.link.frame_joiner import STALE_STATUS
from paxisim.hw.link.recognise import describe
from paxisim.hw.profiles.load import load_profile
from paxisim.hw.profiles.profile import Profile, Slot

pytest.importorskip("websockets", reason="needs the extra websocket")

from serial_peers import wait_for
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.sync.server import ServerConnection, serve

from paxisim.hw.device import open_sensor
from paxisim.hw.emulation.emulator import Emulator
from paxisim.hw.link.websocket import open_websocket

pytestmark = pytest.mark.filterwarnings("ignore::paxisim.UnverifiedProfileWarning")

PATIENCE = 20.0
TAXELS = 16
FORCE = np.linspace(-2, 3, 3 * TAXELS).reshape(1, 3, 4, 4)


def sensor(number: int = 1, taxels: int = TAXELS, **other: Any) -> dict[str, Any]:
    """The server's entry for one sensor, with the keys that its public client reads."""
    data = ",".join(f"{0x8000 + 10 * number + i:X}" for i in range(3 * taxels))
    return {"time": 1.7e9, "sensor": str(number), "model": "uSPa44", "taxels": taxels, "data": data} | other


def routine(number: int = 1, **sensors: Any) -> dict[str, Any]:
    return {"message": number, "type": "routine"} | (sensors or {"1": sensor()})


def line(message: Any) -> bytes:
    return json.dumps(message).encode() + b"\n"


@contextlib.contextmanager
def server(*texts: str, rate: float = 50.0) -> Iterator[str]:
    """Context manager: address of a server that sends the first text once, then the others repeatedly in turn.

    Messages of number 1 are numbered.
    """

    over, number = threading.Event(), itertools.count(1)

    def talk(connection: ServerConnection) -> None:
        with contextlib.suppress(ConnectionClosed):
            connection.send(texts[0])
            while not over.wait(1 / rate):
                for text in texts[1:]:
                    connection.send(re.sub(r'"message": 1\b', lambda _: f'"message": {next(number)}', text))

    with serve(talk, "127.0.0.1", 0, close_timeout=1) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        try:
            yield f"ws://127.0.0.1:{running.socket.getsockname()[1]}"
        finally:
            over.set()


def spoken(*messages: Any, rate: float = 50.0) -> contextlib.AbstractContextManager[str]:
    return server('{"message": "Welcome"}', *map(json.dumps, messages), rate=rate)


def test_a_message_as_the_public_client_reads_it() -> None:
    decoder = RoutineDecoder()
    (found,) = decoder.feed(WELCOME + line(routine(7, **{"1": sensor(), "12": sensor(12, calibrated=[0.5] * 48)})))
    assert found.number == 7
    assert sorted(found.sensors) == [1, 12]
    np.testing.assert_array_equal(found.sensors[1].counts.ravel(), COUNTS_MIDDLE + 10 + np.arange(48))
    assert found.sensors[1].forces is None
    np.testing.assert_array_equal(found.sensors[12].forces, np.full((16, 3), 0.5))
    assert (decoder.skipped, decoder.pending) == (0, 0)


@pytest.mark.parametrize("piece", [1, 7, 100, 10_000])
def test_messages_come_out_of_any_pieces(piece: int) -> None:
    rng = np.random.default_rng(0)
    sent = [
        Routine(i, {3: SensorReading("uSPa44", rng.integers(0, 65536, (16, 3)).astype(np.float32))}) for i in range(9)
    ]
    data = WELCOME + b"".join(message.encode(1.0) for message in sent)
    decoder = RoutineDecoder()
    found = [m for i in range(0, len(data), piece) for m in decoder.feed(data[i : i + piece])]
    assert [m.number for m in found] == list(range(9))
    for a, b in zip(found, sent, strict=True):
        np.testing.assert_array_equal(a.sensors[3].counts, b.sensors[3].counts)


@pytest.mark.parametrize(
    "text",
    [
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
    ],
)
def test_what_is_no_message_is_left_out(text: bytes) -> None:
    decoder = RoutineDecoder()
    found = decoder.feed(text + b"\n" + line(routine(2)))
    assert [message.number for message in found] == [2]
    assert decoder.skipped == len(text) + 1


def test_a_message_without_end_is_not_kept() -> None:
    decoder = RoutineDecoder()
    for _ in range(10):
        decoder.feed(b"x" * MAX_MESSAGE_BYTES)
        assert decoder.pending <= MAX_MESSAGE_BYTES
    assert [m.number for m in decoder.feed(b"\n" + line(routine(3)))] == [3]


def test_odd_calibrated_values_are_no_forces() -> None:
    for values in (["a"] * 48, [0.0] * 47, [1e9] * 48, [True] * 48, {"0": 1}, [[0.0] * 3] * 16):
        (found,) = RoutineDecoder().feed(line(routine(**{"1": sensor(calibrated=values)})))
        assert found.sensors[1].forces is None


def test_a_key_with_a_zero_does_not_replace_a_sensor() -> None:
    (found,) = RoutineDecoder().feed(
        line(routine(**{"1": sensor(), "01": sensor(sensor="01", data="1,1,1", taxels=1)}))
    )
    assert found.sensors[1].taxels == TAXELS


def test_what_is_heard_is_named() -> None:
    assert "3 messages of the family 'xela-counts'" in describe(WELCOME + 3 * line(routine()))
    assert describe(line({"hello": 1})) == "text of no family: '{\"hello\": 1}\\n'"


@pytest.mark.real_time
def test_counts_are_read_from_the_middle_and_zeroed_in_software() -> None:
    with spoken(routine()) as address, open_sensor(address, "xela-uspa44") as pads:
        frame = pads.read(PATIENCE)
        assert (frame.unit, frame.force.shape, frame.force.dtype) == ("counts", (1, 3, 4, 4), np.float32)
        np.testing.assert_array_equal(frame.force, 10 + np.arange(48).reshape(16, 3).T.reshape(1, 3, 4, 4))
        assert (frame.status, frame.resultant, pads.version(), pads.skipped) == ((0,), None, "", 0)
        pads.zero()
        np.testing.assert_array_equal(pads.read(PATIENCE).force, 0)
        with pytest.raises(paxisim.UnsupportedError, match="takes no commands"):
            pads.zero(software=False)


@pytest.mark.real_time
def test_calibrated_forces_are_newtons() -> None:
    profile = load_profile("xela-uspa44-calibrated")
    with Emulator(profile, lambda now: FORCE) as emulator, open_sensor(emulator.port, profile) as pads:
        frame = pads.read(PATIENCE)
        assert frame.unit == "N"
        np.testing.assert_allclose(frame.force, FORCE, atol=1e-4)
        # the same server also provides raw counts
        with open_sensor(emulator.port, "xela-uspa44") as raw:
            assert raw.read(PATIENCE).unit == "counts"


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("message", "profile", "says"),
    [
        (
            {"hello": 1},
            "xela-uspa44",
            r"expects readings of a XELA server, but received something else: text of no family: ",
        ),
        (routine(**{"2": sensor(2)}), "xela-uspa44", "has no sensor 1, which profile 'xela-uspa44' assigns .*it has 2"),
        (routine(**{"1": sensor(taxels=12)}), "xela-uspa44", r"uSPa44 with 12 taxels, but .* is for uSPa44 with 16"),
        (routine(**{"1": sensor(model="uSPa46")}), "xela-uspa44", "is a uSPa46 with 16 taxels, but .* is for uSPa44"),
        (routine(), "xela-uspa44-calibrated", "no calibrated values for sensor 1 .*enable them"),
        ({"message": 3, "type": "routine"}, "xela-uspa44", "no sensor 1.* it has none"),
    ],
)
def test_a_server_that_is_not_the_profiles_is_named(message: Any, profile: str, says: str) -> None:
    with spoken(message) as address, pytest.raises(ProtocolError, match=says):
        open_sensor(address, profile)


@pytest.mark.real_time
def test_a_server_that_only_welcomes_is_silent() -> None:
    with spoken() as address, pytest.raises(DeviceTimeoutError, match="has no sensor: are they connected"):
        open_sensor(address, "xela-uspa44")


@pytest.mark.real_time
def test_addresses_that_lead_nowhere_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        number = taken.getsockname()[1]
    closed = f"ws://127.0.0.1:{number}"
    with pytest.raises(PortNotFoundError, match=f"cannot connect to {closed}: .*is the sensor's server running"):
        open_sensor(closed, "xela-uspa44")
    for address in ("ws://", "ws://nowhere at all", "/dev/ttyACM0", "http://127.0.0.1"):
        with pytest.raises((InvalidValueError, PortNotFoundError), match=r"WebSocket server|cannot connect"):
            open_sensor(address, "xela-uspa44")
    with pytest.raises(InvalidValueError, match=f"port '{closed}' is not a serial port"):
        open_sensor(closed, "gen2-box-120")
    with contextlib.closing(socket.create_server(("127.0.0.1", 0))) as web:

        def answer() -> None:
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
def test_a_pad_that_a_message_leaves_out_is_in_error_and_others_are_read_on() -> None:
    both = routine(1, **{"1": sensor(), "2": sensor(2)})
    profile = replace(load_profile("xela-uspa44"), slots=(Slot("left", 2), Slot("right", 1)))
    broken = [routine(1, **{"1": sensor()}), routine(1, **{"1": sensor(), "2": sensor(2, taxels=3)})]
    with spoken(both, *broken, rate=1.0) as address, open_sensor(address, profile) as pads:
        frames = [pads.read(PATIENCE) for _ in range(6)]
    assert {frame.status for frame in frames} == {(0, 0), (1, 0)}
    assert sum(frame.status == (1, 0) for frame in frames) >= 3
    for frame in frames:
        assert frame.force[1].min() == 10
        assert frame.force[0].min() == (20 if frame.status == (0, 0) else 0)


@pytest.mark.real_time
def test_a_message_too_long_to_be_one_is_not_read() -> None:
    with (
        server('{"message": "Welcome"}', "x" * (MAX_MESSAGE_BYTES + 1)) as address,
        pytest.raises(ProtocolError, match=f"sent a message of more than {MAX_MESSAGE_BYTES} bytes"),
    ):
        open_sensor(address, "xela-uspa44", reconnect=0)


@pytest.mark.real_time
def test_repeated_and_missing_messages_and_other_sensors_are_told() -> None:
    texts = [routine(n, **{"1": sensor(model=model)}) for n, model in ((2, "uSPa44"), (2, "uSPa44"), (7, "uSPa46"))]
    with spoken(*texts, rate=2.0) as address, open_sensor(address, "xela-uspa44") as pads:
        frames = [pads.read(PATIENCE) for _ in range(3)]
        assert [frame.status for frame in frames] == [(0,), (STALE_STATUS,), (1,)]
        assert pads.timeouts == 4


@pytest.mark.real_time
def test_a_server_that_does_not_answer_is_not_waited_for() -> None:
    over = threading.Event()

    def freeze(connection: ServerConnection) -> None:
        with connection.protocol_mutex:  # no frame is handled meanwhile
            over.wait(PATIENCE)

    with serve(freeze, "127.0.0.1", 0, close_timeout=1) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        transport = open_websocket(f"ws://127.0.0.1:{running.socket.getsockname()[1]}", 0)
        began = time.monotonic()
        transport.close()
        took = time.monotonic() - began
        over.set()
    assert took < 5


@pytest.mark.real_time
def test_a_server_that_goes_away_is_found_again_and_one_that_pauses_is_waited_for() -> None:
    profile = load_profile("xela-uspa44")
    faults = Faults(stall=0.02, stall_seconds=2.5)
    with (
        Emulator(profile, lambda now: FORCE * 100, faults=faults, seed=3) as emulator,
        open_sensor(emulator.port, profile) as pads,
    ):
        address = emulator.port
        with pytest.raises(DeviceTimeoutError, match=r"no frame from ws:.* within 1 s"):
            for _ in pads.stream(1.0):
                pass
        assert pads.read(PATIENCE).unit == "counts"
        emulator.unplug()
        wait_for(lambda: pads._readers[0].fault)
        emulator.plug()
        assert emulator.port == address
        wait_for(lambda: pads.reconnects == 1)
        pads.latest(PATIENCE)
        np.testing.assert_array_equal(pads.read(PATIENCE).force, np.rint(FORCE * 100))


@pytest.mark.real_time
def test_damaged_texts_make_no_wrong_frame() -> None:
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
def test_four_pads_at_100_hz_without_a_drop() -> None:
    slots = tuple(Slot(f"pad{i}", i + 1) for i in range(4))
    profile = replace(load_profile("xela-uspa44"), slots=slots)
    with (
        Emulator(profile, lambda now: np.repeat(FORCE, 4, axis=0) * 100, rate=100.0) as emulator,
        open_sensor(emulator.port, profile) as pads,
    ):
        before = emulator.messages
        frames = [pads.read(PATIENCE) for _ in range(500)]
        sent = emulator.messages - before
    assert (pads.dropped, pads.skipped, pads.timeouts, emulator.overruns) == (0, 0, 0, 0)
    assert sent <= 503
    assert frames[0].force.shape == (4, 3, 4, 4)
    assert [frame.sequence for frame in frames] == list(range(500))
    assert 1 / np.median(np.diff([frame.time for frame in frames])) == pytest.approx(100, rel=0.05)


@pytest.mark.real_time
def test_several_hosts_read_one_server() -> None:
    profile = load_profile("xela-uspa44")
    with Emulator(profile, press(profile)) as emulator, connect(emulator.port, proxy=None) as one:
        assert json.loads(one.recv(PATIENCE)) == {"message": "Welcome"}
        message = json.loads(one.recv(PATIENCE))
        assert message["1"]["taxels"] == 16
        assert len(message["1"]["data"].split(",")) == 48
        with open_sensor(emulator.port, profile) as pads:
            pads.read(PATIENCE)
            assert json.loads(one.recv(PATIENCE))["type"] == "routine"


@pytest.mark.real_time
def test_the_verbs_read_a_server(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    profile = load_profile("xela-uspa44")
    path = tmp_path / "uskin.mcap"
    with Emulator(profile, press(profile)) as emulator:
        assert main(["record", emulator.port, "--profile", "xela-uspa44", "--seconds", "1", "-o", str(path)]) == 0
        assert main(["device", "quality", emulator.port, "--profile", "xela-uspa44", "--seconds", "1"]) == 0
        assert "counts/min" in capsys.readouterr().out
    assert paxisim.Recording.load(path).unit == "counts"
    assert main(["emulate", "--profile", "xela-uspa44", "--signal", str(path), "--seconds", "0"]) == 0
    assert capsys.readouterr().out.startswith("ws://127.0.0.1:")
    link = str(tmp_path / "link")
    assert main(["emulate", "--profile", "xela-uspa44", "--seconds", "0", "--link", link]) == 2
    assert "a link is made to the file of a serial port" in capsys.readouterr().err


def test_slots_are_sensors_of_the_server() -> None:
    profile = load_profile("xela-uspa44")
    assert isinstance(profile, Profile)
    assert (profile.unit, profile.slots, profile.settings) == ("counts", (Slot("pad", 1),), {"model": "uSPa44"})
    assert load_profile("xela-uspa44-calibrated").unit == "N"
