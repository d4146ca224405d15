"""Two swapped taxels are named as swapped, not as reversed columns."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from paxisim import augment
from paxisim.diagnose.diagnosis import Diagnosis

sys.path.insert(0, str(Path(__file__).parent))
from recorded import diagnosed, names, plain, small

READ = ("layout", "swapped_taxels", "quantisation", "dead_taxels")
SEEDS = (61, 62, 63)


def swapped(recording, *pairs):
    """Return the recording of a sensor whose wiring swaps the pairs ``(pad, row, col, row, col)``."""
    measured = recording.measured.copy()
    for pad, row, col, other_row, other_col in pairs:
        measured[:, pad, :, row, col] = recording.measured[:, pad, :, other_row, other_col]
        measured[:, pad, :, other_row, other_col] = recording.measured[:, pad, :, row, col]
    return replace(recording, measured=measured)


def told(found):
    fault = found.model["swapped_taxels"]
    return (fault[0] if isinstance(fault, augment.Chain) else fault).pairs


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("pair", [(0, 1, 1, 1, 2), (1, 2, 0, 2, 2), (0, 1, 1, 2, 1)], ids=str)
def test_a_swap_of_two_is_named_and_nothing_else_is(seed, pair):
    found = diagnosed(swapped(small(seed=seed), pair))
    assert names(found) == ["swapped_taxels"]
    assert told(found) == (pair,)
    assert found.verdict in ("explained", "partly_explained")
    assert found.heldout.explained.value > 0.8
    words = f"pad{pair[0]} ({pair[1]}, {pair[2]}) and ({pair[3]}, {pair[4]}) swapped"
    assert words in " ".join(str(found).split())
    assert words in " ".join(str(Diagnosis.from_json(found.to_json())).split())


@pytest.mark.parametrize("seed", SEEDS)
def test_the_ends_of_a_row_that_are_swapped_are_no_reversed_columns(seed):
    pair = (0, 2, 0, 2, 2)
    found = diagnosed(swapped(small(seed=seed), pair), READ)
    assert names(found) == ["swapped_taxels"]
    assert told(found) == (pair,)


def test_pairs_of_both_pads_are_told_and_a_gain_beside_them():
    gains = np.reshape([1.0, 1.0, 1.25], (3, 1, 1))
    pairs = ((0, 1, 0, 1, 1), (1, 1, 2, 2, 1), (1, 1, 1, 2, 0))
    recording = plain(lambda force, time: gains * force, seed=5)
    found = diagnosed(swapped(recording, *pairs), (*READ, "axis_gain", "taxel_gain"))
    assert sorted(names(found)) == ["axis_gain", "swapped_taxels"]
    assert set(told(found)) == set(pairs)


@pytest.mark.parametrize("fault", [{"flip_cols": True}, {"flip_rows": True}, {"pad_order": (1, 0)}])
def test_what_reverses_all_is_a_layout(fault):
    recording = small(seed=62)
    moved = augment.LayoutFault(**fault)(recording.measured)
    assert names(diagnosed(replace(recording, measured=moved), READ)) == ["layout"]


def test_two_taxels_beside_a_reversal_are_named_beside_it():
    recording = small(seed=62)
    flip, swap = augment.LayoutFault(flip_cols=True), augment.SwappedTaxels([(0, 1, 1, 2, 1)])
    found = diagnosed(replace(recording, measured=swap(flip(recording.measured))), READ)
    assert sorted(names(found)) == ["layout", "swapped_taxels"]
    assert told(found) == ((0, 1, 1, 2, 1),)


@pytest.mark.parametrize(("rows", "cols"), [(1, 3), (3, 1)])
def test_where_a_reversal_swaps_but_two_it_is_called_a_reversal(rows, cols):
    recording = small(seed=7700, rows=rows, cols=cols, pads=1)
    found = diagnosed(swapped(recording, (0, 0, 0, rows - 1, cols - 1)), READ)
    assert names(found) == ["layout"]


def test_two_taxels_that_move_in_turn_with_a_third_are_no_pair():
    recording = plain(seed=6)
    measured = recording.measured.copy()
    measured[:, 0, :, 1, :] = np.roll(recording.measured[:, 0, :, 1, :], 1, axis=-1)
    assert "swapped_taxels" not in names(diagnosed(replace(recording, measured=measured), READ))


def test_normal_forces_alone_that_are_swapped_are_no_taxels():
    recording = plain(seed=6)
    measured = recording.measured.copy()
    measured[:, 0, 2, 1, 1:] = recording.measured[:, 0, 2, 1, :0:-1]
    assert "swapped_taxels" not in names(diagnosed(replace(recording, measured=measured), READ))


@pytest.mark.parametrize(("seed", "pads"), [(7700, 1), (7706, 2), (7719, 2)])
def test_presses_at_one_place_whose_edge_is_a_little_off_show_no_swap(seed, pads):
    recording = small(seed=seed, pads=pads, family="poor")
    assert names(diagnosed(recording, ("layout", "swapped_taxels"))) == []


@pytest.mark.parametrize("effect", [augment.Crosstalk(0.12), augment.Poisson(0.3, 0.3)], ids=lambda effect: effect.name)
def test_forces_that_spread_to_neighbours_are_no_swap(effect):
    recording = plain(lambda force, time: effect(force), seed=7)
    assert names(diagnosed(recording, ("swapped_taxels", "layout"))) == []
