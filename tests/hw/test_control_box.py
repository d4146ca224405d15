"""The driver of the GEN1 / GEN2 control box: what only this family does, against a scripted box."""

import numpy as np
import pytest
from scripted_peers import Box, Conversation

from paxisim import ProtocolError
from paxisim.hw.families.control_box import wire


def test_power_up_asks_for_the_mode_until_it_is_taken_then_port_by_port():
    script = Box(slow=3)
    talk = Conversation(script)
    with talk as board:
        board.start()
        script.check(board.read(20))
        assert (board.skipped, board.bad_checksums) == (0, 0)
    kinds = [(request.main, request.sub) for request in talk.peer.requests]
    assert kinds[:2] == [wire.GET_VERSION, wire.SET_MODE]
    assert set(kinds[2:6]) == {wire.GET_MODE}
    assert kinds[6:10] == [wire.SELECT_PORT, wire.READ_REGISTERS] * 2


def test_the_resultant_comes_in_the_same_request():
    script = Box()
    with Conversation(script, resultant_address=1008) as board:
        board.start()
        reading = board.read(20)
    script.check(reading)
    np.testing.assert_array_equal(reading.resultant, np.concatenate([script.totals[2], script.totals[5]]))


def test_zeroing_succeeds_with_error_6_on_every_port():
    script = Box()
    with Conversation(script) as board:
        board.start()
        board.zero()
    assert script.zeroed == [(2, b"\3\1"), (5, b"\3\1")]


def test_a_pad_that_fails_later_does_not_silence_the_others():
    failing = []

    def change(request, reply):
        failed = reply.sub == 0xC006 and script.port in failing
        return (wire.Reply(*wire.READ_REGISTERS, b"", 7) if failed else reply).encode()

    script = Box(change)
    with Conversation(script) as board:
        board.start()
        failing.append(5)
        reading = board.read(20)
        assert reading.status == (0, 7)
        np.testing.assert_array_equal(reading.counts, np.stack([script.pads[2], np.zeros_like(script.pads[5])]))
        failing.append(2)
        with pytest.raises(ProtocolError, match=r"2 \(left\): error 0x07 \(no data\)"):
            board.read(20)
