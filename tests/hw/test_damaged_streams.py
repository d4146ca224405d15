"""Noise, changed and lost bytes at random, all families on serial ports: benchmarks/damaged_streams.py, but shorter."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import damaged_streams

SIZE = 2_000_000


@pytest.mark.parametrize(
    ("family", "kind"), [(name, kind) for name, family in damaged_streams.FAMILIES.items() for kind in family.kinds]
)
def test_a_damaged_stream_gives_no_wrong_frame_and_loses_no_good_one(family, kind):
    result = damaged_streams.measure(family, kind, SIZE, seed=1)
    assert result.faults == 0
    if family not in ("hand-board", "magnetometer-board"):  # which have no check byte
        assert result.collisions <= result.damaged / 100
        assert result.undecidable == 0
    if family == "magnetometer-board":  # whose bursts are known by their neighbours
        assert result.missed_undecidable <= result.damaged / 20
    else:  # one frame in 32768 that noise follows
        assert result.missed_undecidable <= 3
    assert result.most_held < 1200
    # it is ten times as fast on a machine at rest
    assert result.bytes / result.seconds > 1e6
