"""The table and the report state what is wrong with a layout and which taxels are swapped or dead."""

from dataclasses import replace

import numpy as np
import pytest

from paxisim.augment import Chain, Creep, DeadTaxels, FailingTaxels, LayoutFault, SwappedTaxels
from paxisim.diagnose.diagnosis import Diagnosis
from paxisim.diagnose.report.text import fault_in_words
from paxisim.diagnose.result import FittedParameter, FoundCause, HeldOut, Interval, Place, Symptoms


def diagnosis(name, member):
    many = tuple(FittedParameter(f"dead_{i}", "1", Interval(0.0)) for i in range(24))
    cause = FoundCause(name, many, Interval(0.9), (), "It is so.")
    symptoms = Symptoms(pads=(Place("left", 1.0, 0.0), Place("right", 0.0, 0.0)), axes=(Place("z", 1.0, 0.0),))
    missing = {"creep": "not asked for", "drift": "too short"}
    told = HeldOut(0.3, 0.1, 0.1, "repeated motions", None, (0.9, 0.9))
    model = Chain([member], [name])
    return Diagnosis("explained", (cause,), told, {name: 1.0}, missing, symptoms, (), model)


def taxels(*places):
    grid = np.zeros((2, 4, 3))
    for place in places:
        grid[place] = 1.0
    return grid


def moments():
    """Return failure times: taxel (1, 2) of the left pad fails on all axes, (0, 0) of the right pad only on z."""
    since = np.zeros((2, 3, 4, 3))
    since[0, :, 1, 2] = 12.34
    since[1, :, 0, 0] = np.inf, np.inf, 7.0
    return since


@pytest.mark.parametrize(
    ("name", "member", "words"),
    [
        ("layout", LayoutFault(flip_rows=True), "rows reversed"),
        ("layout", LayoutFault(flip_rows=True, flip_cols=True), "rows and columns reversed"),
        ("layout", LayoutFault(transpose=True, axis_signs=(1, -1, 1)), "rows and columns swapped; sign of y reversed"),
        ("layout", LayoutFault(axis_order=(1, 0, 2)), "x and y swapped"),
        ("layout", LayoutFault(axis_order=(2, 0, 1)), "z read as x, x read as y, y read as z"),
        ("layout", LayoutFault(pad_order=(1, 0)), "pad left and pad right swapped"),
        (
            "dead_taxels",
            DeadTaxels(taxels((0, 1, 2), (0, 3, 0)), taxels((1, 0, 0)), np.zeros((2, 3, 4, 3))),
            "no response: pad left (1, 2), (3, 0); stuck: pad right (0, 0)",
        ),
        ("dead_taxels", Chain([DeadTaxels(taxels((0, 1, 2)))]), "no response: pad left (1, 2)"),
        (
            "dead_taxels",
            FailingTaxels(taxels((0, 1, 2), (0, 3, 0)), taxels((1, 0, 0)), np.zeros((2, 3, 4, 3)), moments()),
            "no response: pad left (1, 2) since 12.3 s, (3, 0); stuck: pad right (0, 0) z since 7.0 s",
        ),
        (
            "swapped_taxels",
            SwappedTaxels([(1, 0, 0, 3, 2), (0, 1, 1, 1, 2), (0, 0, 0, 0, 1)]),
            "pad left (1, 1) and (1, 2) swapped, (0, 0) and (0, 1) swapped; pad right (0, 0) and (3, 2) swapped",
        ),
    ],
)
def test_it_is_said_what_is_wrong(name, member, words):
    found = diagnosis(name, member)
    assert fault_in_words(found, name) == words
    flat = " ".join(str(found).split())
    assert words in flat
    assert "numbers from" not in flat
    assert fault_in_words(Diagnosis.from_json(found.to_json()), name) == words


def test_the_report_says_it_too_and_of_many_taxels_a_few_are_listed():
    pytest.importorskip("matplotlib")
    pytest.importorskip("jinja2")
    page = diagnosis("dead_taxels", DeadTaxels(taxels((0, 1, 2)))).report()
    assert "no response: pad left (1, 2)" in page
    assert "not asked for" not in page
    assert "<h2>What this recording cannot test</h2>" in page
    assert "<b>drift</b>: too short" in page
    assert (
        fault_in_words(diagnosis("dead_taxels", DeadTaxels(np.ones((2, 4, 4)))), "dead_taxels").count("and 8 more") == 2
    )
    found = diagnosis("creep", Creep((0.2,), (0.3,)))
    assert fault_in_words(found, "creep") == ""
    assert "24 numbers from" in str(found)
    assert "not asked for" not in str(found)


def test_a_long_array_says_what_its_numbers_are_and_is_left_out_beside_other_parameters():
    def text_of(name, indices, *others):
        places = ["_".join(map(str, place)) for place in np.ndindex(*indices)]
        many = [FittedParameter(f"{name}_{place}", "N", Interval(0.1)) for place in places]
        found = diagnosis("creep", Creep((0.2,), (0.3,)))
        return str(replace(found, causes=(replace(found.causes[0], parameters=(*others, *many)),)))

    assert "gain of 24 taxels from 0.1 to 0.1 N" in text_of("gain", (2, 4, 3))
    assert "offset of 72 channels from" in text_of("offset", (2, 3, 4, 3))
    assert "amounts of 72 channels from" in text_of("amounts", (3, 2, 3, 4, 3))
    width = FittedParameter("loop_width", "1", Interval(0.1), size=9.0)
    assert "loop_width 0.1\n" in text_of("play", (10,), width)
