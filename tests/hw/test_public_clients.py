"""Public drivers, or imitations of them, work with the emulator as with the hardware."""

import time

import numpy as np
import pytest
from emulated import constant, profile, small

pytest.importorskip("serial")

from paxisim import Emulator
from paxisim.hw.families.control_box import wire as box
from paxisim.hw.families.high_speed import wire as high_speed
from paxisim.hw.families.high_speed.stream_layout import StreamLayout
from paxisim.hw.families.serial_converter import wire as converter
from paxisim.hw.link.framing import FrameDecoder

pytestmark = pytest.mark.real_time
NO_SDK = "paxini-sdk is not installed: pip install 'paxisim[hw]'"


def counts_of(chosen, signal):
    """``(pads, N, 3)`` counts in wire order."""
    return chosen.to_counts(signal(0.0), 2)


# paxini-sdk


def test_paxini_sdk_makes_the_same_requests_and_reads_the_same_answers():
    sdk = pytest.importorskip("paxini_sdk.protocol", reason=NO_SDK)
    errors = pytest.importorskip("paxini_sdk.exceptions", reason=NO_SDK)
    rng = np.random.default_rng(0)
    for _ in range(50):
        id, count, data = int(rng.integers(256)), int(rng.integers(1, 512)), rng.bytes(int(rng.integers(1, 11)))
        address, register = int(rng.integers(2**32)), int(rng.integers(65536))
        pairs = [
            (
                converter.read_request(id, address, count),
                sdk.build_fin_request(sdk.FIN_FUNC_FORCE, address, read=True, data_len=count, device_id=id),
            ),
            (
                converter.Request(id, converter.WRITE, address, len(data), data),
                sdk.build_fin_request(sdk.FIN_FUNC_CALIBRATION, address, read=False, data=data, device_id=id),
            ),
            (
                high_speed.read_request(register, count),
                sdk.build_simple_request(high_speed.READ, register, data_len=count),
            ),
            (
                high_speed.write_request(register, data),
                sdk.build_simple_request(high_speed.WRITE, register, data=data),
            ),
        ]
        for mine, theirs in pairs:
            assert mine.encode() == theirs
        status, error = int(rng.choice([0, 1, 7])), int(rng.integers(1, 128))
        reply = converter.Reply(id, converter.READ, address, len(data), status, data)
        read = sdk.parse_fin_response(reply.encode())
        assert (read.device_id, read.func_code, read.addr) == (id, converter.READ, address)
        assert (read.data_len, read.status, read.data) == (len(data), status, data)
        read = sdk.parse_simple_response(high_speed.Reply(high_speed.READ, register, data).encode())
        assert (read.func_code, read.reg_addr, read.data) == (high_speed.READ, register, data)
        read = sdk.parse_auto_push(high_speed.Push(error, data).encode())
        assert (read.error_code, read.valid_data) == (error, data)
        with pytest.raises(errors.DeviceError) as caught:
            sdk.parse_simple_response(high_speed.Reply(0x80 | error, register).encode())
        assert caught.value.code == error


@pytest.mark.parametrize("data_type", [1, 2, 3])
def test_paxini_sdk_reads_the_same_from_a_push(data_type):
    sdk = pytest.importorskip("paxini_sdk.boards.high_speed", reason=NO_SDK)
    names = pytest.importorskip("paxini_sdk.registers", reason=NO_SDK).MODULE_NAMES
    taxels = {0: 9, 5: 31, 20: 25, 27: 9}
    rng = np.random.default_rng(data_type)
    counts = [rng.integers([-128, -128, 0], [128, 128, 256], (n + 1, 3)).astype(np.int16) for n in taxels.values()]
    layout = StreamLayout(tuple(taxels), tuple(taxels.values()), data_type)
    data = layout.encode([one[0] for one in counts], [one[1:] for one in counts])
    assert len(data) == layout.size
    config = sdk.AutoPushConfig(
        active_modules=list(taxels),
        has_resultant=bool(data_type & 1),
        has_distributed=bool(data_type & 2),
        point_counts=taxels,
    )
    frame = sdk.AutoPushFrame(config=config, error_code=0, valid_data=data, raw=b"")
    for module, (resultant, *points) in zip(taxels, counts, strict=True):
        if data_type & 1:
            assert frame.resultant_forces[names[module]] == tuple(resultant.tolist())
        if data_type & 2:
            assert frame.distributed_forces[names[module]] == [tuple(point.tolist()) for point in points]


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
        times = [time.monotonic()]
        for _ in range(100):
            client.read_distributed_force()
            times.append(time.monotonic())
        # its author measured 176 readings per second on this part; a busy machine delays most of ours, not all
        assert (times[-1] - times[0]) / 100 > 1 / 200
        assert min(np.diff(times)) < 1 / 100
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


def test_a_client_of_the_box_waits_10_ms_for_the_version_and_reads_as_fast_as_usb_is():
    chosen = small("control-box", [("left", 15), ("right", 20)], wire_layout=profile("gen2-box-120").wire_layout)
    signal = constant(chosen)
    with Emulator(chosen, signal) as board, BoxClient(board.port) as client:
        assert b"SMALL" in client.ask(box.version_request(), 10e-3).data
        client.ask(box.set_mode_request(5), 10e-3)
        sent = counts_of(chosen, signal).astype(np.uint8).reshape(2, -1)
        times = [time.monotonic()]
        for _ in range(50):
            for pad, port in enumerate((15, 20)):
                client.read(box.select_port_request(port), 17)
                region = box.parse_region(client.read(box.read_request(1038, 360), 360 + 23).data)
                assert region.payload == sent[pad].tobytes()
            times.append(time.monotonic())
        # 4 to 6 ms on hardware, 18 ms at the nominal baud rate; a busy machine delays most of ours, not all
        assert (times[-1] - times[0]) / 50 > 4e-3
        assert min(np.diff(times)) < 12e-3
