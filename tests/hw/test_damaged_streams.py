"""Random noise, changed and lost bytes for all families on serial ports: a short benchmarks/damaged_streams.py."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import damaged_streams

CASES = [(name, kind) for name, family in damaged_streams.FAMILIES.items() for kind in family.kinds]


def check(family, kind, size):
    """Check that the decoder makes no wrong frame, loses no undamaged one and holds little back."""
    result = damaged_streams.measure(family, kind, size, seed=1)
    assert result.faults == 0
    if family not in ("hand-board", "magnetometer-board"):  # these two have no check byte
        assert result.collisions <= max(2, result.damaged / 100)
        assert result.undecidable == 0
    if family == "magnetometer-board":  # a burst is recognised by the bursts next to it
        assert result.missed_undecidable <= result.damaged / 20
    else:  # about one in 32768 of the frames followed by noise
        assert result.missed_undecidable <= 3
    assert result.most_held < 1200


@pytest.mark.parametrize(("family", "kind"), CASES)
def test_a_damaged_stream_gives_no_wrong_frame_and_loses_no_good_one(family, kind):
    check(family, kind, 300_000)


@pytest.mark.slow
@pytest.mark.parametrize(("family", "kind"), CASES)
def test_a_long_damaged_stream(family, kind):
    check(family, kind, 2_000_000)
