"""The driver of the GEN3 high-speed board: what only this family does, against a scripted board."""

import time

import numpy as np
import pytest
from scripted_peers import Conversation, HighSpeed, numbered_counts

from paxisim import DeviceTimeoutError
from paxisim.hw.families.high_speed.stream_layout import StreamLayout
from paxisim.hw.families.high_speed.wire import Push
from paxisim.logs.schemas import NO_TAXELS


def test_pads_come_in_the_order_of_the_slots_and_other_modules_are_skipped():
    script = HighSpeed(modules={0: 9, 1: 31, 2: 9, 20: 25}, at_once=4)
    with Conversation(script, {"right": 2, "left": 0}) as board:
        board.start()
        for number in range(6):
            script.check(board.read(10), number, modules=(2, 0))


def test_stop_leaves_the_board_silent_and_start_finds_one_that_streams():
    script = HighSpeed()
    script.registers[0x17] = 1
    with Conversation(script) as board:
        board.start()
        board.read(10)
        board.stop()
        deadline = time.monotonic() + 30
        while script.registers[0x17] and time.monotonic() < deadline:
            time.sleep(0.01)
        assert script.registers[0x17] == 0
        board.stop()
        board.start()
        board.read(10)
        assert script.registers[0x16] == 3


def test_zeroing_pauses_the_stream():
    script = HighSpeed(at_once=3)
    with Conversation(script) as board:
        board.start()
        for number in range(4):
            script.check(board.read(10), number)
        board.zero()
        assert script.zeroed == 1
        assert script.registers[0x17] == 1
        first = board.read(10)
        assert first.status == (0, 0)
        np.testing.assert_array_equal(first.counts[0], numbered_counts(100 * (int(first.resultant[0, 2]) - 200)))


class NoTaxels(HighSpeed):
    """Sends resultants without taxels, as a board at rest does, and an error from the second push on."""

    def push(self, number):
        nothing = np.zeros((9, 3), dtype=np.int16)
        data = StreamLayout((0, 2), (9, 9)).encode([np.array([0, 0, 30]), nothing[0]], [nothing, nothing])
        return Push(0x11 if number else 0, data).encode()


def test_an_all_zero_block_of_taxels_with_a_live_resultant_is_marked():
    with Conversation(NoTaxels()) as board:
        board.start()
        reading = board.read(10)
        assert reading.status == (NO_TAXELS, 0)
        assert not reading.counts.any()
        assert reading.resultant.tolist() == [[0, 0, 30], [0, 0, 0]]
        assert board.read(10).status == (NO_TAXELS | 0x11, 0x11)


def test_a_stream_that_ends_says_what_it_expected():
    with Conversation(HighSpeed(frames=2)) as board:
        board.start()
        board.read(10)
        board.read(10)
        with pytest.raises(DeviceTimeoutError, match="66 bytes"):
            board.read(0.1)


def test_counts_of_palm_modules_by_either_source():
    elsewhere = HighSpeed(modules={0: 9, 21: 9})
    elsewhere.registers[0x30 + 42] = 0
    elsewhere.registers[0x66 + 2] = 9
    for script, settings in ((elsewhere, {"palm_counts": "0066"}), (HighSpeed(modules={0: 9, 21: 9}), {})):
        with Conversation(script, {"finger": 0, "palm": 21}, **settings) as board:
            board.start()
            script.check(board.read(10), 0, modules=(0, 21))
