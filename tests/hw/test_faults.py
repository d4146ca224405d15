"""Simulated line faults occur at the requested rates, reproducibly; how they are said."""

import numpy as np
import pytest

from paxisim import InvalidValueError, UnknownNameError
from paxisim.hw.emulation.faults import Faults, FaultyLine

MESSAGE = bytes(range(200)) * 50


def test_a_clean_line_changes_nothing():
    line = FaultyLine(Faults())
    assert line.send(MESSAGE) == (MESSAGE, [(0.0, MESSAGE)])
    assert line.messages == 1
    assert not line.wrong_status()
    assert line.noise() == b""


def test_the_same_seed_does_the_same():
    faults = Faults(drop=0.01, flip=0.01, garble=0.01, split=0.3, merge=0.3, stall=0.3, status=0.5, noise=7)
    lines = [FaultyLine(faults, seed) for seed in (4, 4, 5)]
    first, same, other = (
        [line.noise()] + [(line.send(MESSAGE), line.wrong_status()) for _ in range(9)] for line in lines
    )
    assert first == same
    assert first != other


@pytest.mark.parametrize("kind", ["drop", "flip", "garble"])
def test_bytes_are_damaged_as_often_as_asked(kind):
    written, _ = FaultyLine(Faults(**{kind: 0.02}), 1).send(MESSAGE)
    if kind == "drop":
        damaged = len(MESSAGE) - len(written)
    else:
        changes = np.frombuffer(written, np.uint8) ^ np.frombuffer(MESSAGE, np.uint8)
        damaged = np.count_nonzero(changes)
        if kind == "flip":
            assert set(np.unpackbits(changes).reshape(-1, 8).sum(axis=1)) == {0, 1}
    assert 0.01 < damaged / len(MESSAGE) < 0.03


def test_messages_are_split_merged_and_delayed():
    _, pieces = FaultyLine(Faults(split=1.0), 2).send(MESSAGE)
    assert b"".join(data for _, data in pieces) == MESSAGE
    assert len(pieces) == 2
    assert all(data for _, data in pieces)
    line = FaultyLine(Faults(merge=1.0))
    assert line.send(b"one") == (b"one", [])
    assert line.send(b"two") == (b"two", [(0.0, b"onetwo")])
    line.send(b"three")
    assert line.release() == b"three"
    assert line.held == b""
    assert FaultyLine(Faults(stall=1.0, stall_seconds=3.0)).send(b"late")[1] == [(3.0, b"late")]


def test_faults_from_words():
    assert Faults.parse("") == Faults()
    assert Faults.parse("drop=0.01, flip=1e-3,unplug-after=5,noise=3,") == Faults(
        drop=0.01, flip=1e-3, unplug_after=5, noise=3
    )


@pytest.mark.parametrize(
    ("text", "error", "says"),
    [
        ("dorp=0.1", UnknownNameError, "did you mean 'drop'"),
        ("drop", InvalidValueError, "drop=a number"),
        ("noise=1.5", InvalidValueError, "noise=a whole number"),
        ("drop=2", InvalidValueError, "from 0 to 1"),
        ("flip=nan", InvalidValueError, "from 0 to 1"),
        ("stall_seconds=inf", InvalidValueError, "stall_seconds"),
        ("noise=-1", InvalidValueError, "noise"),
        ("unplug_after=0", InvalidValueError, "at least 1"),
    ],
)
def test_impossible_faults_are_refused(text, error, says):
    with pytest.raises(error, match=says):
        Faults.parse(text)
