"""The driver of the GEN3 serial converter: what only this family does, against a scripted sensor."""

import pytest
from scripted_peers import Conversation, Converter

from paxisim.hw.families.serial_converter import wire as frames


def test_resultant_and_taxels_are_read_in_one_request_at_1008_and_zeroed_at_3():
    script = Converter()
    talk = Conversation(script)
    with talk as board:
        board.start()
        board.zero()
        script.check(board.read(10))
    assert frames.read_request(1, 1008, 30 + 27) in talk.peer.requests
    assert talk.peer.requests.count(frames.zero_request(1)) == 1


def no_version(request, reply):
    return b"" if request.address == 6100 else reply.encode()


@pytest.mark.parametrize(
    ("script", "part", "version"),
    [
        (Converter(), "PXSR-STDMC03A", "PAXINI PXSR-STDMC03A-v1.0.5"),
        (Converter(), "pxsr-stdmc03a", "PAXINI PXSR-STDMC03A-v1.0.5"),
        (Converter(), "", "PAXINI PXSR-STDMC03A-v1.0.5"),
        (Converter(version=""), "PXSR-STDDP03G", ""),
        (Converter(version="something else"), "PXSR-STDDP03G", "something else"),
        (Converter(no_version), "PXSR-STDDP03G", ""),
    ],
    ids=["same", "lower case", "any", "no text", "no part", "no answer"],
)
def test_the_part_that_the_profile_names_or_one_that_tells_nothing_is_accepted(script, part, version):
    with Conversation(script, part=part) as board:
        board.start()
        assert board.version() == version
        script.check(board.read(10))


def test_a_scan_finds_the_sensor_under_another_id():
    script = Converter(id=3)
    with Conversation(script, slots={"pad": 0}, scan=True) as board:
        board.start()
        assert board.id == 3
        script.check(board.read(10))


def test_a_late_reply_is_not_taken_for_the_next_reading():
    numbers, late = iter(range(1, 100)), []

    def change(request, reply):
        if request.count != len(Converter.block):
            return reply.encode()
        number = next(numbers)
        frame = frames.answer(request, bytes([number]) + Converter.block[1:]).encode()
        if number == 2:
            late.append(frame)
            return b""  # arrives together with the answer to the repeated request
        return late.pop() + frame if late else frame

    with Conversation(Converter(change)) as board:
        board.start()
        read = [int(board.read(10).resultant[0, 0]) for _ in range(4)]
    # replies 2 and 3 arrive together and 2 is the answer; 3 would be outdated as the next reading
    assert 3 not in read
    assert read == sorted(set(read))
