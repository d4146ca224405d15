"""Public drivers, or imitations of them, work with the emulator as with the hardware."""

import time

import numpy as np
import pytest
from emulated import constant, profile, small

pytest.importorskip("serial")

from paxisim.hw.emulation.emulator import Emulator
from paxisim.hw.families.control_box import wire as box
from paxisim.hw.link.framing import FrameDecoder

pytestmark = pytest.mark.real_time
NO_SDK = "paxini-sdk is not installed: pip install 'paxisim[hw]'"


def counts_of(chosen, signal):
    """``(pads, N, 3)`` counts in wire order."""
    return chosen.to_counts(signal(0.0), 2)


# paxini-sdk


def test_paxini_sdk_polls_a_serial_converter():
    sdk = pytest.importorskip("paxini_sdk", reason=NO_SDK)
    chosen = profile("gen3-serial-dp-l3530")
    signal = constant(chosen)
    with (
        Emulator(chosen, signal) as board,
        sdk.SingleSensorBoard(board.port, sensor="PXSR-STDDP03A", device_id=chosen.slots[0].index) as client,
    ):
        sent = counts_of(chosen, signal)[0]
        assert [point.as_tuple() for point in client.read_distributed_force()] == [tuple(taxel) for taxel in sent]
        assert client.read_resultant_force() == tuple(np.clip(sent.sum(axis=0), [-128, -128, 0], [127, 127, 255]))
        start = time.monotonic()
        for _ in range(100):
            client.read_distributed_force()
        # its author measured 176 readings per second on this part
        assert 100 < 100 / (time.monotonic() - start) < 200
        client.calibrate()
        assert not any(any(point.as_tuple()) for point in client.read_distributed_force())


@pytest.mark.parametrize("modules", [(0, 2), (3, 20, 26)], ids=["fingers", "finger and palm"])
def test_paxini_sdk_takes_the_stream_of_a_high_speed_board(modules):
    sdk = pytest.importorskip("paxini_sdk", reason=NO_SDK)
    names = pytest.importorskip("paxini_sdk.registers", reason=NO_SDK).MODULE_NAMES
    chosen = small("high-speed", [(f"pad{m}", m) for m in modules], baud=921600)
    signal = constant(chosen)
    with Emulator(chosen, signal) as board, sdk.HighSpeedHandBoard(board.port) as client:
        assert client.read_version().startswith("PAXISIM")
        assert client.read_active_modules() == list(modules)
        for module in modules:
            assert client.read_distribution_point_count(module) == 12
        # the client clears the port while the stream runs, which may cut its first frames
        frames = list(client.stream_auto_push(max_frames=30))
        for frame in frames:
            for module, sent in zip(modules, counts_of(chosen, signal), strict=True):
                assert frame.distributed_forces[names[module]] == [tuple(taxel) for taxel in sent]
        client.calibrate()
        (frame,) = client.stream_auto_push(max_frames=1)
        assert not any(any(point) for points in frame.distributed_forces.values() for point in points)


# imitations of public drivers of the control box, none of which is a package


class BoxClient:
    """Writes a request, sleeps as long as public drivers do, and reads the bytes that have arrived."""

    def __init__(self, port):
        from serial import Serial

        self.port = Serial(port, 460800, timeout=0.5)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.port.close()

    def ask(self, request, wait):
        self.port.reset_input_buffer()
        self.port.write(request.encode())
        time.sleep(wait)
        (reply,) = FrameDecoder(box.parse_reply).feed(self.port.read(self.port.in_waiting))
        return reply

    def read(self, request, size):
        """Like `ask`, but wait for `size` bytes."""
        self.port.write(request.encode())
        (reply,) = FrameDecoder(box.parse_reply).feed(self.port.read(size))
        return reply


def test_a_client_of_the_box_that_waits_10_ms_for_the_version_and_reads_at_once():
    chosen = profile("gen2-box-dp-m2826")
    signal = constant(chosen)
    with Emulator(chosen, signal) as board, BoxClient(board.port) as client:
        assert b"DP-M2826" in client.ask(box.version_request(), 10e-3).data
        client.ask(box.set_mode_request(5), 10e-3)
        client.ask(box.select_port_request(chosen.slots[0].index), 10e-3)
        region = box.parse_region(client.read(box.read_request(1038, 360), 360 + 23).data)
        assert np.frombuffer(region.payload, np.uint8).tolist() == (
            counts_of(chosen, signal)[0].astype(np.uint8).ravel().tolist()
        )


def test_a_client_of_the_box_uses_ports_15_and_20_as_fast_as_usb_is():
    chosen = small("control-box", [("left", 15), ("right", 20)], wire_layout=profile("gen2-box-120").wire_layout)
    signal = constant(chosen)
    with Emulator(chosen, signal) as board, BoxClient(board.port) as client:
        client.ask(box.set_mode_request(5), 10e-3)
        sent = counts_of(chosen, signal).astype(np.uint8).reshape(2, -1)
        start = time.monotonic()
        for _ in range(50):
            for pad, port in enumerate((15, 20)):
                client.read(box.select_port_request(port), 17)
                region = box.parse_region(client.read(box.read_request(1038, 360), 360 + 23).data)
                assert region.payload == sent[pad].tobytes()
        # 4 to 6 ms on hardware, plus delays of a busy machine; 18 ms at the nominal baud rate
        assert 4e-3 < (time.monotonic() - start) / 50 < 12e-3
