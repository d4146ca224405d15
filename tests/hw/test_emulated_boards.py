"""Emulated boards: state machines that answer bytes as the protocols specify, without a port."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from emulated import constant, profile, small

from paxisim import Emulator, InvalidValueError
from paxisim.hw.emulation.emulator import make_board
from paxisim.hw.emulation.faults import Faults, FaultyLine
from paxisim.hw.emulation.pads import EmulatedPads
from paxisim.hw.families.control_box import wire as box
from paxisim.hw.families.control_box.emulated import VERSION_WAIT
from paxisim.hw.families.hand_board import wire as hand_board
from paxisim.hw.families.hand_board.wire import RoundDecoder
from paxisim.hw.families.high_speed import wire as high_speed
from paxisim.hw.families.serial_converter import wire as converter
from paxisim.hw.link.framing import FrameDecoder

BOX = small("control-box", [("left", 0), ("right", 3)], settings={"mode": 5})
CONVERTER = small("serial-converter")
HIGH_SPEED = small("high-speed", [("thumb", 2), ("palm", 21)], rate=100.0)
PARSERS = {
    "control-box": box.parse_reply,
    "serial-converter": converter.parse_reply,
    "high-speed": high_speed.parse_incoming,
}


def board_of(profile, signal=None, faults=None, **options):
    pads = EmulatedPads(profile, signal or constant(profile), **options)
    return make_board(pads, profile.rate, True, FaultyLine(faults or Faults()))


def ask(board, request, now=0.0) -> Any:
    """Send a request to a board and return its only reply, None if there is none."""
    replies = FrameDecoder(PARSERS[board.pads.profile.family]).feed(board.receive(request.encode(), now))
    assert len(replies) < 2
    return replies[0] if replies else None


def expected_bytes(profile, pad):
    """The bytes of the taxels of `constant`, computed independently of the emulator."""
    flat = profile.wire_layout.to_flat(np.rint(constant(profile)(0)[pad] / profile.resolution)).reshape(-1, 3)
    wire = np.empty_like(flat)
    for pad_axis, axis in enumerate(profile.axes):
        wire[:, "xyz".index(axis[1])] = flat[:, pad_axis] * (-1 if axis[0] == "-" else 1)
    return wire.astype(np.int16).astype(np.uint8).tobytes()


# ---- from forces to counts, as in the firmware


def test_a_taxel_that_is_on_has_shear_if_asked():
    chosen = profile()
    force = np.zeros((len(chosen.slots), *chosen.wire_layout.shape))
    force[:, :2] = [[[[0.5]], [[-0.04]]]]
    force[:, 2, 0, 0] = 0.3  # the others are off
    counts = EmulatedPads(chosen, lambda now: force, gate=2, shear_floor=2).counts(0).reshape(-1, 3)
    on = counts[:, 2] != 0
    assert on.sum() == len(chosen.slots)
    assert sorted(np.abs(counts[on][0]).tolist()) == [2, 3, 5]
    assert not counts[~on].any()


def test_small_counts_are_gated_if_asked():
    one_count = np.full((1, 3, 3, 3), 0.1)
    assert np.all(EmulatedPads(profile(), lambda now: one_count).counts(0) == 1)
    assert not EmulatedPads(profile(), lambda now: one_count, gate=2).counts(0).any()


def test_between_two_measurements_the_last_one_is_held():
    pads = EmulatedPads(profile(), lambda now: np.full((1, 3, 3, 3), now), rate=10)
    values = [pads.counts(now)[0, 0, 2] for now in (1.0, 1.05, 1.099, 1.1, 1.3, 1.2)]
    assert values == [10, 10, 10, 11, 13, 12]


def test_the_total_is_the_clipped_sum_or_what_is_said():
    def totals(newtons, **options):
        return EmulatedPads(profile(), lambda now: np.full((1, 3, 3, 3), newtons), **options).totals(0).tolist()

    assert totals(1.1) == [[99, 99, 99]]
    assert totals(-3.0) == [[-128, -128, 0]]
    assert totals(1.0, resultant=lambda counts: 3 * counts.sum(axis=1)) == [[127, 127, 255]]


def test_forces_and_rates_that_are_not_finite_are_refused():
    with pytest.raises(InvalidValueError, match="finite"):
        Emulator(profile(), lambda now: np.full((1, 3, 3, 3), np.nan))
    with pytest.raises(InvalidValueError, match="rate"):
        Emulator(profile(), constant(profile()), rate=np.inf)


# ---- control box

READ_ALL = box.read_request(1038, 36)


def region(board, request=READ_ALL):
    return box.parse_region(ask(board, request, 2.0).data)


def test_a_control_box_tells_its_version_late_and_zeroes_a_port_with_an_error():
    board = board_of(BOX)
    assert board.receive(box.version_request().encode(), 0.0) == b""
    assert board.due == VERSION_WAIT
    assert board.tick(VERSION_WAIT / 2) == b""
    (version,) = FrameDecoder(box.parse_reply).feed(board.tick(VERSION_WAIT))
    assert version.data == b"PAXISIM SMALL-v1.0.0"
    reply = ask(board, box.set_mode_request(5), 1.0)
    assert (reply.main, reply.sub, reply.error) == (0x70, 0xC009, 0)
    assert ask(board, box.get_mode_request(), 1.0).data == b"\5"
    ask(board, box.select_port_request(3), 1.0)
    whole = region(board, box.read_request(1008, 30 + 36))
    assert (whole.status, whole.address) == (0, 1008)
    assert whole.payload == board.pads.total(1, 2.0) + bytes(27) + expected_bytes(BOX, 1)
    assert region(board, box.read_request(1041, 33)).payload == expected_bytes(BOX, 1)[3:]
    assert ask(board, box.write_request(3, 1), 2.0).error == 6
    assert not any(region(board).payload)
    ask(board, box.select_port_request(0), 2.0)
    assert region(board).payload == expected_bytes(BOX, 0)


def test_a_control_box_reports_errors():
    board = board_of(BOX)
    steps = [
        (READ_ALL, 7),  # neither mode nor port
        (box.set_mode_request(5), 0),
        (READ_ALL, 7),  # no port
        (box.select_port_request(2), 0),
        (READ_ALL, 7),  # no pad on this port
        (box.select_port_request(77), 6),
        (box.select_port_request(3), 0),
        (READ_ALL, 0),
        (box.read_request(1038, 37), 5),
        (box.read_request(1, 3), 5),
        (box.Request(0x70, 0xC006, b"\x7b\0"), 1),
        (box.Request(0x70, 0xC006, bytes(5)), 6),
        (box.Request(0x71, 0xC006), 3),
        (box.Request(0x70, 0xC066), 4),
        (box.set_mode_request(2), 0),
        (READ_ALL, 7),  # another mode
    ]
    for now, (request, error) in enumerate(steps):
        assert ask(board, request, float(now)).error == error, now


def test_a_control_box_is_silent_on_damaged_requests_and_works_in_any_pieces():
    board, whole = board_of(BOX), READ_ALL.encode()
    ask(board, box.set_mode_request(5), 0.0)
    ask(board, box.select_port_request(3), 1.0)
    damaged = bytearray(whole)
    damaged[15] ^= 1
    assert board.receive(bytes(damaged), 2.0) == b""
    answers = [board.receive(whole[i : i + 1], 2.0) for i in range(len(whole))]
    assert len(b"".join(answers)) == 17 + 6 + 36
    assert not any(answers[:-1])


# ---- hand board


def test_a_hand_board_streams_rounds_at_its_rate_and_does_not_hurry_after_a_delay():
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
        assert (block.state, block.taxels) == (hand_board.VALID, expected_bytes(chosen, pad))
    assert board.tick(5.0)
    assert board.due == pytest.approx(5.0)


def test_a_hand_board_with_signed_normal_forces_and_without_all_pads():
    chosen = profile("gen1-stream-tip", settings={"signed_normal": True})
    board = board_of(chosen, signal=lambda now: np.full((2, 3, 1, 15), 20.0))
    (found,) = RoundDecoder().feed(board.tick(0.0))
    assert [block.taxels for block in found.blocks] == [bytes(45), b"\x7f" * 45] * 2


# ---- serial converter


def test_a_serial_converter_answers_its_id_alone_with_either_good_status():
    board = board_of(CONVERTER)
    request = converter.Request(1, converter.READ, 1008, 66)
    replies = [ask(board, request) for _ in range(4)]
    assert [reply.status for reply in replies] == [1, 0, 1, 0]
    assert {reply.data for reply in replies} == {board.pads.total(0, 0) + bytes(27) + expected_bytes(CONVERTER, 0)}
    assert ask(board, dataclasses.replace(request, id=2)) is None
    version = ask(board, converter.Request(1, converter.READ, 6100, 100))
    assert len(version.data) == 100
    assert version.data.rstrip(b"\0").isascii()
    refused = ask(board, converter.Request(1, converter.READ, 1038, 37))
    assert (refused.status, refused.data) == (6, b"")


def test_a_serial_converter_acknowledges_zero_without_data_and_hears_no_firmware_update():
    board = board_of(dataclasses.replace(CONVERTER, slots=small("serial-converter", [("pad", 3)]).slots))
    zero = bytes.fromhex("55AA0A000300790300000001000176")
    assert board.receive(zero, 0.0) == bytes.fromhex("AA550A000300790300000001000077")
    assert not any(ask(board, converter.Request(3, converter.READ, 1038, 36)).data)
    assert ask(board, converter.Request(3, converter.WRITE, 35, 1, b"\2")).status == 6
    for function in (0x7A, 0x78):
        frame = bytearray(zero)
        frame[6] = function
        frame[-1] = -sum(frame[:-1]) & 0xFF
        assert board.receive(bytes(frame), 0.0) == b""


# ---- high-speed board


def register(board, at, count):
    return ask(board, high_speed.read_request(at, count)).data


def words(data):
    return np.frombuffer(data, "<u2").tolist()


def test_a_high_speed_board_tells_its_modules():
    board = board_of(HIGH_SPEED)
    assert register(board, 0x0010, 4) == (1 << 2 | 1 << 21).to_bytes(4, "little")
    assert register(board, 0x0016, 1) == b"\3"
    assert register(board, 0x0017, 1) == b"\0"
    counts = words(register(board, 0x0030, 56))
    assert (counts[2], counts[21], sum(counts)) == (12, 12, 24)
    assert register(board, 0x0000, 15).isascii()
    assert register(board, 0x1400, 36) == expected_bytes(HIGH_SPEED, 0)
    assert register(board, 0x3900, 36) == expected_bytes(HIGH_SPEED, 1)
    assert np.frombuffer(register(board, 0x0500 + 6 * 21, 6), "<i2").tolist() == board.pads.totals(0)[1].tolist()
    assert ask(board, high_speed.read_request(0x0100, 2)).function == 0x83


def test_a_high_speed_board_streams_what_is_switched_on():
    board = board_of(HIGH_SPEED)
    assert board.tick(1.0) == b""
    assert ask(board, high_speed.push_request(True), 1.0) == high_speed.Push()
    parse = FrameDecoder(high_speed.parse_push)
    times, sizes = [], []
    for data_type in (3, 3, 1, 2):
        assert ask(board, high_speed.write_request(0x0016, bytes([data_type])), 1.0).data == b"\0"
        times.append(board.due)
        (push,) = parse.feed(board.tick(board.due))
        sizes.append(len(push.data))
    assert np.diff(times) == pytest.approx([0.01] * 3)
    assert sizes == [84, 84, 12, 72]
    assert push.data == expected_bytes(HIGH_SPEED, 0) + expected_bytes(HIGH_SPEED, 1)
    ask(board, high_speed.write_request(0x0010, (1 << 21).to_bytes(4, "little")))
    assert parse.feed(board.tick(board.due))[0].data == expected_bytes(HIGH_SPEED, 1)
    assert ask(board, high_speed.push_request(False), 2.0) == high_speed.Push()
    assert board.tick(3.0) == b""
    assert board.receive(high_speed.write_request(0x0022, b"\1").encode(), 3.0) == b""
    assert register(board, 0x0016, 1) == b"\3"


def test_reads_collide_with_the_stream_and_writes_do_not():
    board = board_of(HIGH_SPEED)
    board.receive(high_speed.push_request(True).encode(), 0.0)
    assert board.receive(high_speed.version_request().encode(), 0.0) == b""
    pushes = FrameDecoder(high_speed.push_parser({0, 84}))
    assert pushes.feed(board.tick(board.due)) == []
    assert len(pushes.feed(board.tick(board.due)) + pushes.flush()) == 1
    assert ask(board, high_speed.zero_request()).data == b"\0"
    (push,) = pushes.feed(board.tick(board.due))
    assert not any(push.data)


def test_the_counts_of_palm_modules_stand_at_both_places_but_for_one():
    for setting in ("contiguous", "0066"):
        pads = [(f"pad{module}", module) for module in (2, 20, 21, 27)]
        board = board_of(small("high-speed", pads, settings={"palm_counts": setting}))
        contiguous, apart = words(register(board, 0x0030, 56)), words(register(board, 0x0066, 16))
        assert contiguous[2] == 12
        assert contiguous[20:27] == [12, 12, 0, 0, 0, 0, 0]
        assert apart[1:] == [12, 0, 0, 0, 0, 0, 12]
        assert contiguous[27] == apart[0] == 12
    # without module 27, both places hold the correct counts
    board = board_of(small("high-speed", [("palm", 20)]))
    assert register(board, 0x0066, 2) == register(board, 0x0058, 2) == b"\x0c\0"


# ---- wrong status


def test_a_wrong_status_is_a_sound_message():
    wrong = Faults(status=1.0)
    assert ask(board_of(BOX, faults=wrong), box.get_mode_request()).error == 0x0D
    reply = ask(board_of(CONVERTER, faults=wrong), converter.Request(1, converter.READ, 1038, 36))
    assert (reply.status, reply.data) == (0x0D, b"")
    streaming = board_of(HIGH_SPEED, faults=Faults(status=0.5))
    while not isinstance(ask(streaming, high_speed.push_request(True)), high_speed.Push):
        pass
    pushes = [streaming.tick(0.01 * k) for k in range(1, 40)]
    assert bytes.fromhex("AA5600010007F8") in pushes, "the protocol's example of a stream error"
    assert ask(board_of(HIGH_SPEED, faults=wrong), high_speed.push_request(True)).function == 0x90
    (found,) = RoundDecoder().feed(board_of(profile("gen1-stream"), faults=wrong).tick(0.0))
    assert [block.state for block in found.blocks] == [0, 1, 1, 1]
