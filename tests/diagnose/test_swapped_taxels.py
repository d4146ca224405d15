"""Two swapped taxels are named as swapped, not as reversed columns."""

from dataclasses import replace

import numpy as np
import pytest
from recorded import diagnosed, names, plain, small

from paxisim import augment
from paxisim.diagnose.diagnosis import Diagnosis

READ = ("layout", "swapped_taxels", "quantisation", "dead_taxels")


def swapped(recording, *pairs):
    """Return the recording of a sensor whose wiring swaps the pairs ``(pad, row, col, row, col)``."""
    measured = recording.measured.copy()
    for pad, row, col, other_row, other_col in pairs:
        measured[:, pad, :, row, col] = recording.measured[:, pad, :, other_row, other_col]
        measured[:, pad, :, other_row, other_col] = recording.measured[:, pad, :, row, col]
    return replace(recording, measured=measured)


def told(found):
    fault = found.model["swapped_taxels"]
    return (fault[0] if isinstance(fault, augment.Chain) else fault).rings


@pytest.mark.parametrize(
    ("pair", "seed"),
    [
        ((1, 2, 0, 2, 2), 62),  # the ends of a row are no reversed columns
        pytest.param((0, 1, 1, 1, 2), 61, marks=pytest.mark.slow),
        pytest.param((0, 1, 1, 2, 1), 63, marks=pytest.mark.slow),
        pytest.param((0, 1, 1, 1, 2), 62, marks=pytest.mark.slow),
        pytest.param((1, 2, 0, 2, 2), 63, marks=pytest.mark.slow),
    ],
)
def test_a_swap_of_two_is_named_and_nothing_else_is(pair, seed):
    found = diagnosed(swapped(small(seed=seed), pair), (*READ, "axis_gain", "taxel_gain", "gel_operator"))
    assert names(found) == ["swapped_taxels"]
    assert told(found) == (pair,)
    assert found.verdict in ("explained", "partly_explained")
    assert found.heldout.explained.value > 0.8
    words = f"pad{pair[0]} ({pair[1]}, {pair[2]}) and ({pair[3]}, {pair[4]}) swapped"
    for each in (found, Diagnosis.from_json(found.to_json())):
        assert words in " ".join(str(each).split())


def test_pairs_of_both_pads_are_told_and_a_gain_beside_them():
    gains = np.reshape([1.0, 1.0, 1.25], (3, 1, 1))
    pairs = ((0, 1, 0, 1, 1), (1, 1, 2, 2, 1), (1, 1, 1, 2, 0))
    recording = plain(lambda force, time: gains * force, seed=5)
    found = diagnosed(swapped(recording, *pairs), (*READ, "axis_gain", "taxel_gain"))
    assert sorted(names(found)) == ["axis_gain", "swapped_taxels"]
    assert set(told(found)) == set(pairs)


def test_what_reverses_all_is_a_layout_and_two_taxels_are_named_beside_it():
    recording = small(seed=62)
    for fault in ({"flip_cols": True}, {"flip_rows": True}, {"pad_order": (1, 0)}):
        moved = augment.LayoutFault(**fault)(recording.measured)
        assert names(diagnosed(replace(recording, measured=moved), READ)) == ["layout"], fault
    flip, swap = augment.LayoutFault(flip_cols=True), augment.SwappedTaxels([(0, 1, 1, 2, 1)])
    found = diagnosed(replace(recording, measured=swap(flip(recording.measured))), READ)
    assert sorted(names(found)) == ["layout", "swapped_taxels"]
    assert told(found) == ((0, 1, 1, 2, 1),)


@pytest.mark.parametrize(("rows", "cols"), [(1, 3), (3, 1)])
def test_where_a_reversal_swaps_but_two_it_is_called_a_reversal(rows, cols):
    recording = small(seed=7700, rows=rows, cols=cols, pads=1)
    found = diagnosed(swapped(recording, (0, 0, 0, rows - 1, cols - 1)), READ)
    assert names(found) == ["layout"]


@pytest.mark.parametrize("ring", [(0, 1, 0, 1, 2, 1, 1), (1, 0, 0, 3, 2, 1, 1, 2, 0)])
def test_a_ring_is_named_with_its_order(ring):
    recording = plain(seed=6)
    fault = augment.SwappedTaxels([ring, (0, 0, 0, 3, 1)])
    found = diagnosed(replace(recording, measured=fault(recording.measured)), (*READ, "taxel_gain"))
    assert names(found) == ["swapped_taxels"]
    assert set(told(found)) == set(fault.rings)
    text = " ".join(str(found).split())
    assert f"({ring[3]}, {ring[4]}) read as ({ring[1]}, {ring[2]}), ({ring[5]}, {ring[6]}) read as" in text
    assert "pad0 (0, 0) and (3, 1) swapped" in text


def test_a_swap_of_normal_forces_alone_is_none():
    recording = plain(seed=6)
    measured = recording.measured.copy()
    measured[:, 0, 2, 1, 1:] = recording.measured[:, 0, 2, 1, :0:-1]
    assert "swapped_taxels" not in names(diagnosed(replace(recording, measured=measured), READ))
    rows = small(seed=5, rows=3, cols=2)
    assert names(diagnosed(swapped(rows, (0, 0, 1, 2, 1), (1, 0, 1, 2, 1)), ("layout",))) == []


@pytest.mark.parametrize(("seed", "pads"), [(7700, 1), (7706, 2), (7719, 2)])
def test_presses_at_one_place_whose_edge_is_a_little_off_show_no_swap(seed, pads):
    recording = small(seed=seed, pads=pads, family="poor")
    assert names(diagnosed(recording, ("layout", "swapped_taxels"))) == []


@pytest.mark.parametrize("effect", [augment.Crosstalk(0.12), augment.Poisson(0.3, 0.3)], ids=lambda effect: effect.name)
def test_forces_that_spread_to_neighbours_are_no_swap(effect):
    recording = plain(lambda force, time: effect(force), seed=7)
    assert names(diagnosed(recording, ("swapped_taxels", "layout"))) == []
