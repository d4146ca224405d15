"""Emulated boards: state machines that answer bytes as the protocols specify, without a port."""

import dataclasses

import numpy as np
import pytest
from emulated import constant, profile, small

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.hw.emulation.emulator import Emulator, make_board
from paxisim.hw.emulation.faults import Faults, FaultyLine
from paxisim.hw.emulation.pads import EmulatedPads
from paxisim.hw.emulation.signals import press
from paxisim.hw.families.control_box import wire as box
from paxisim.hw.families.control_box.emulated import VERSION_WAIT
from paxisim.hw.families.hand_board import wire as hand_board
from paxisim.hw.families.hand_board.wire import RoundDecoder
from paxisim.hw.families.high_speed import wire as high_speed
from paxisim.hw.families.serial_converter import wire as serial_converter
from paxisim.hw.link.framing import FrameDecoder

pytestmark = pytest.mark.real_time

BOX = small("control-box", [("left", 0), ("right", 3)], settings={"mode": 5})
CONVERTER = small("serial-converter")
HIGH_SPEED = small("high-speed", [("thumb", 2), ("palm", 21)], rate=100.0)


def board_of(profile, signal=None, faults=None, **options):
    signal = constant(profile) if signal is None else signal
    pads = EmulatedPads(profile, signal, **options)
    return make_board(pads, profile.rate, True, FaultyLine(Faults() if faults is None else faults))


def expected_bytes(profile, pad: int) -> bytes:
    """The bytes of the taxels of `constant`, computed independently of the emulator."""
    flat = profile.wire_layout.to_flat(np.rint(constant(profile)(0)[pad] / profile.resolution)).reshape(-1, 3)
    wire = np.empty_like(flat)
    for pad_axis, axis in enumerate(profile.axes):
        wire[:, "xyz".index(axis[1])] = flat[:, pad_axis] * (-1 if axis[0] == "-" else 1)
    return wire.astype(np.int16).astype(np.uint8).tobytes()


# ---- from forces to counts, as in the firmware


def test_counts_are_rounded_gated_and_clipped():
    chosen = profile()
    force = np.zeros((1, 3, 3, 3))
    force[0, :, 0] = [[0.14, 0.16, -0.19], [-30, 30, -12.8], [-1, 30, 0.1]]
    pads = EmulatedPads(chosen, lambda now: force, gate=2)
    order = np.argsort(chosen.wire_layout.vendor_order)[:3]
    assert pads.counts(0)[0, order].tolist() == [[0, -128, 0], [2, 127, 255], [-2, -128, 0]]
    ungated = EmulatedPads(chosen, lambda now: force)
    assert ungated.counts(0)[0, order].tolist() == [[1, -128, 0], [2, 127, 255], [-2, -128, 1]]


def test_between_two_measurements_the_last_one_is_held():
    chosen = profile()
    pads = EmulatedPads(chosen, lambda now: np.full((1, 3, 3, 3), now), rate=10)
    values = [pads.counts(now)[0, 0, 2] for now in (1.0, 1.05, 1.099, 1.1, 1.3, 1.2)]
    assert values == [10, 10, 10, 11, 13, 12]


def test_the_total_is_the_clipped_sum_or_what_is_said():
    chosen = profile()
    pads = EmulatedPads(chosen, lambda now: np.full((1, 3, 3, 3), 1.1))
    assert pads.totals(0).tolist() == [[99, 99, 99]]
    pads = EmulatedPads(chosen, lambda now: np.full((1, 3, 3, 3), -3.0))
    assert pads.totals(0).tolist() == [[-128, -128, 0]]
    pads = EmulatedPads(chosen, lambda now: np.ones((1, 3, 3, 3)), resultant=lambda counts: 3 * counts.sum(axis=1))
    assert pads.totals(0).tolist() == [[127, 127, 255]]


@pytest.mark.parametrize(
    ("signal", "options", "says"),
    [
        (lambda now: np.zeros((1, 3, 2, 2)), {}, r"\(1, 3, 3, 3\).*got \(1, 3, 2, 2\)"),
        (lambda now: np.full((1, 3, 3, 3), np.nan), {}, "finite"),
        (lambda now: 1 / 0, {}, "ZeroDivisionError"),
        (lambda now: np.zeros((1, 3, 3, 3)), {"gate": -1}, "gate"),
        (lambda now: np.zeros((1, 3, 3, 3)), {"rate": 0}, "rate"),
        (lambda now: np.zeros((1, 3, 3, 3)), {"rate": np.inf}, "rate"),
    ],
)
def test_what_does_not_fit_is_refused(signal, options, says):
    with pytest.raises(InvalidValueError, match=says):
        Emulator(profile(), signal, **options)


def test_unknown_profiles_are_named():
    with pytest.raises(UnknownNameError, match="gen3-highspeed"):
        Emulator("gen3-highsped", press(profile()))


# ---- control box


def ask(board, request, now):
    """Send a request to a control box and return its only reply."""
    (reply,) = FrameDecoder(box.parse_reply).feed(board.receive(request.encode(), now))
    return reply


def ready_box(**options):
    board = board_of(BOX, **options)
    ask(board, box.set_mode_request(5), 0.0)
    ask(board, box.select_port_request(3), 1.0)
    return board


def test_a_control_box_comes_up_as_the_document_says():
    board = board_of(BOX)
    assert board.receive(box.version_request().encode(), 0.0) == b""
    assert board.due == VERSION_WAIT
    assert board.tick(VERSION_WAIT / 2) == b""
    (version,) = FrameDecoder(box.parse_reply).feed(board.tick(VERSION_WAIT))
    assert version.data == b"PAXISIM SMALL-v1.0.0"
    reply = ask(board, box.set_mode_request(5), 1.0)
    assert (reply.main, reply.sub, reply.error) == (0x70, 0xC009, 0)
    assert ask(board, box.get_mode_request(), 1.0).data == b"\5"
    assert board.receive(box.select_port_request(0).encode(), 2.0).hex() == "55aa7b7b0e0070b10a000000c755aa7d7d"


def test_a_control_box_reads_taxels_and_their_total():
    board = ready_box()
    reply = ask(board, box.read_request(1008, 30 + 36), 2.0)
    region = box.parse_region(reply.data)
    assert (reply.error, region.status, region.address) == (0, 0, 1008)
    assert region.payload[30:] == expected_bytes(BOX, 1)
    assert region.payload[:30] == board.pads.total(1, 2.0) + bytes(27)
    assert box.parse_region(ask(board, box.read_request(1041, 33), 2.0).data).payload == expected_bytes(BOX, 1)[3:]
    ask(board, box.select_port_request(0), 2.0)
    assert box.parse_region(ask(board, box.read_request(1038, 36), 2.0).data).payload == expected_bytes(BOX, 0)


def test_a_control_box_reports_errors():
    board = board_of(BOX)
    read = box.read_request(1038, 36)
    assert ask(board, read, 0.0).error == 7  # neither mode nor port
    ask(board, box.set_mode_request(5), 0.0)
    assert ask(board, read, 1.0).error == 7  # no port
    ask(board, box.select_port_request(2), 1.0)
    assert ask(board, read, 1.0).error == 7  # no pad on this port
    assert ask(board, box.select_port_request(77), 1.0).error == 6
    ask(board, box.select_port_request(3), 1.0)
    assert ask(board, read, 1.0).error == 0
    assert ask(board, box.read_request(1038, 37), 1.0).error == 5
    assert ask(board, box.read_request(1, 3), 1.0).error == 5
    assert ask(board, box.Request(0x70, 0xC006, b"\x7b\0"), 1.0).error == 1
    assert ask(board, box.Request(0x70, 0xC006, bytes(5)), 1.0).error == 6
    assert ask(board, box.Request(0x71, 0xC006), 1.0).error == 3
    assert ask(board, box.Request(0x70, 0xC066), 1.0).error == 4
    ask(board, box.set_mode_request(2), 2.0)
    assert ask(board, read, 3.0).error == 7  # another mode


def test_a_control_box_zeroes_the_selected_port_and_calls_it_an_error():
    board = ready_box()
    assert ask(board, box.write_request(3, 1), 2.0).error == 6
    assert not any(box.parse_region(ask(board, box.read_request(1038, 36), 2.0).data).payload)
    ask(board, box.select_port_request(0), 2.0)
    assert box.parse_region(ask(board, box.read_request(1038, 36), 2.0).data).payload == expected_bytes(BOX, 0)


def test_a_control_box_is_silent_on_damaged_requests_and_works_in_any_pieces():
    board = ready_box()
    request = bytearray(box.read_request(1038, 36).encode())
    whole = bytes(request)
    request[15] ^= 1
    assert board.receive(bytes(request), 2.0) == b""
    answers = [board.receive(whole[i : i + 1], 2.0) for i in range(len(whole))]
    assert len(b"".join(answers)) == 17 + 6 + 36
    assert not any(answers[:-1])


# ---- hand board


def test_a_hand_board_streams_rounds_at_its_rate():
    chosen = profile("gen1-stream")
    board = board_of(chosen)
    assert board.receive(b"hello?", 0.0) == b""
    times = [board.due]
    for _ in range(3):
        (found,) = RoundDecoder().feed(board.tick(board.due))
        times.append(board.due)
    assert np.diff(times) == pytest.approx([0.01] * 3)
    assert board.tick(board.due - 1e-3) == b""
    for pad, block in enumerate(found.blocks):
        assert block.state == hand_board.VALID
        assert block.taxels == expected_bytes(chosen, pad)


def test_a_hand_board_that_was_held_up_does_not_hurry():
    board = board_of(profile("gen1-stream"))
    assert board.tick(0.0)
    assert board.tick(5.0)
    assert board.due == pytest.approx(5.0)


def test_a_hand_board_with_signed_normal_forces_and_without_all_pads():
    chosen = profile("gen1-stream-tip", settings={"signed_normal": True})
    board = board_of(chosen, signal=lambda now: np.full((2, 3, 1, 15), 20.0))
    (found,) = RoundDecoder().feed(board.tick(0.0))
    assert [block.taxels for block in found.blocks] == [bytes(45), b"\x7f" * 45] * 2


# ---- serial converter


def converter_reply(board, request, now=0.0):
    found = FrameDecoder(serial_converter.parse_reply).feed(board.receive(request.encode(), now))
    return found[0] if found else None


def test_a_serial_converter_answers_its_id_alone_with_either_good_status():
    board = board_of(CONVERTER)
    request = serial_converter.Request(1, serial_converter.READ, 1008, 66)
    replies = [converter_reply(board, request) for _ in range(4)]
    assert [reply.status for reply in replies] == [1, 0, 1, 0]
    assert {reply.data for reply in replies} == {board.pads.total(0, 0) + bytes(27) + expected_bytes(CONVERTER, 0)}
    assert converter_reply(board, dataclasses.replace(request, id=2)) is None
    version = converter_reply(board, serial_converter.Request(1, serial_converter.READ, 6100, 100))
    assert len(version.data) == 100
    assert version.data.rstrip(b"\0").isascii()
    refused = converter_reply(board, serial_converter.Request(1, serial_converter.READ, 1038, 37))
    assert (refused.status, refused.data) == (6, b"")


def test_a_serial_converter_acknowledges_zero_without_data():
    chosen = dataclasses.replace(CONVERTER, slots=small("serial-converter", [("pad", 3)]).slots)
    board = board_of(chosen)
    zero = bytes.fromhex("55AA0A000300790300000001000176")
    assert board.receive(zero, 0.0) == bytes.fromhex("AA550A000300790300000001000077")
    reply = converter_reply(board, serial_converter.Request(3, serial_converter.READ, 1038, 36))
    assert not any(reply.data)
    refused = converter_reply(board, serial_converter.Request(3, serial_converter.WRITE, 35, 1, b"\2"))
    assert refused.status == 6


def test_a_serial_converter_never_hears_a_firmware_update():
    board = board_of(CONVERTER)
    frame = bytearray(bytes.fromhex("55AA0A000100790300000001000178"))
    for function in (0x7A, 0x78):
        frame[6] = function
        frame[-1] = -sum(frame[:-1]) & 0xFF
        assert board.receive(bytes(frame), 0.0) == b""


# ---- high-speed board


def high_speed_reply(board, request, now=0.0):
    return FrameDecoder(high_speed.parse_incoming).feed(board.receive(request.encode(), now))[0]


def read_register(board, register, count):
    return high_speed_reply(board, high_speed.read_request(register, count)).data


def test_a_high_speed_board_tells_its_modules():
    board = board_of(HIGH_SPEED)
    assert read_register(board, 0x0010, 4) == (1 << 2 | 1 << 21).to_bytes(4, "little")
    assert read_register(board, 0x0016, 1) == b"\3"
    assert read_register(board, 0x0017, 1) == b"\0"
    counts = np.frombuffer(read_register(board, 0x0030, 56), "<u2")
    assert counts[[2, 21]].tolist() == [12, 12]
    assert counts.sum() == 24
    assert read_register(board, 0x0000, 15).isascii()
    assert read_register(board, 0x1400, 36) == expected_bytes(HIGH_SPEED, 0)
    assert read_register(board, 0x3900, 36) == expected_bytes(HIGH_SPEED, 1)
    assert np.frombuffer(read_register(board, 0x0500 + 6 * 21, 6), "<i2").tolist() == board.pads.totals(0)[1].tolist()
    assert high_speed_reply(board, high_speed.read_request(0x0100, 2)).function == 0x83


def test_a_high_speed_board_streams_what_is_switched_on():
    board = board_of(HIGH_SPEED)
    assert board.tick(1.0) == b""
    assert high_speed_reply(board, high_speed.push_request(True), 1.0) == high_speed.Push()
    parse = FrameDecoder(high_speed.parse_push)
    times, sizes = [], []
    for data_type in (3, 3, 1, 2):
        assert high_speed_reply(board, high_speed.write_request(0x0016, bytes([data_type])), 1.0).data == b"\0"
        times.append(board.due)
        (push,) = parse.feed(board.tick(board.due))
        sizes.append(len(push.data))
    assert np.diff(times) == pytest.approx([0.01] * 3)
    assert sizes == [84, 84, 12, 72]
    assert push.data == expected_bytes(HIGH_SPEED, 0) + expected_bytes(HIGH_SPEED, 1)
    high_speed_reply(board, high_speed.write_request(0x0010, (1 << 21).to_bytes(4, "little")))
    assert parse.feed(board.tick(board.due))[0].data == expected_bytes(HIGH_SPEED, 1)
    assert high_speed_reply(board, high_speed.push_request(False), 2.0) == high_speed.Push()
    assert board.tick(3.0) == b""
    assert board.receive(high_speed.write_request(0x0022, b"\1").encode(), 3.0) == b""
    assert read_register(board, 0x0016, 1) == b"\3"


def test_reads_collide_with_the_stream_and_writes_do_not():
    board = board_of(HIGH_SPEED)
    board.receive(high_speed.push_request(True).encode(), 0.0)
    assert board.receive(high_speed.version_request().encode(), 0.0) == b""
    pushes = FrameDecoder(high_speed.push_parser({0, 84}))
    assert pushes.feed(board.tick(board.due)) == []
    assert len(pushes.feed(board.tick(board.due)) + pushes.flush()) == 1
    assert high_speed_reply(board, high_speed.zero_request()).data == b"\0"
    (push,) = pushes.feed(board.tick(board.due))
    assert not any(push.data)


def test_the_counts_of_palm_modules_where_the_other_source_puts_them():
    chosen = dataclasses.replace(HIGH_SPEED, settings={"palm_counts": "0066"})
    board = board_of(chosen)
    assert np.frombuffer(read_register(board, 0x0066, 16), "<u2").tolist() == [0, 12, 0, 0, 0, 0, 0, 0]
    assert np.frombuffer(read_register(board, 0x0030, 40), "<u2")[2] == 12


def test_the_counts_of_palm_modules_stand_at_both_places_but_for_one():
    counts = {20: 12, 21: 12, 27: 12}
    for setting in ("contiguous", "0066"):
        chosen = small("high-speed", [(f"pad{m}", m) for m in counts], settings={"palm_counts": setting})
        board = board_of(chosen)
        contiguous = np.frombuffer(read_register(board, 0x0030, 56), "<u2").tolist()
        apart = np.frombuffer(read_register(board, 0x0066, 16), "<u2").tolist()
        assert contiguous[20:27] == [12, 12, 0, 0, 0, 0, 0]
        assert apart[1:] == [12, 0, 0, 0, 0, 0, 12]
        assert contiguous[27] == apart[0] == 12
    # without module 27, both places hold the correct counts
    board = board_of(small("high-speed", [("palm", 20)]))
    assert read_register(board, 0x0066, 2) == read_register(board, 0x0058, 2) == b"\x0c\0"


# ---- wrong status


@pytest.mark.parametrize("chosen", [BOX, CONVERTER, HIGH_SPEED, profile("gen1-stream")], ids=lambda p: p.family)
def test_a_wrong_status_is_a_sound_message(chosen):
    board = board_of(chosen, faults=Faults(status=1.0))
    if chosen.family == "control-box":
        assert ask(board, box.get_mode_request(), 0.0).error == 0x0D
    elif chosen.family == "serial-converter":
        reply = converter_reply(board, serial_converter.Request(1, serial_converter.READ, 1038, 36))
        assert (reply.status, reply.data) == (0x0D, b"")
    elif chosen.family == "high-speed":
        assert high_speed_reply(board, high_speed.push_request(True)).function == 0x90
    else:
        (found,) = RoundDecoder().feed(board.tick(0.0))
        assert [block.state for block in found.blocks] == [0, 1, 1, 1]
