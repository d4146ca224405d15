"""Checks of the judge on answers made by hand."""

from types import SimpleNamespace

import pytest

from .judge import judge


def answer(kind, true, verdict, named, said=(), **about):
    about = {"accepted": (), "tolerated": (), "effects": (), **about}
    return SimpleNamespace(kind=kind, true=true, verdict=verdict, named=named, said=said, about=about)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (answer("single", ("creep",), "explained", {"creep": ()}), "exact right"),
        (answer("single", ("creep",), "explained", {"creep": (), "offset": ()}), "contained false confident"),
        (answer("single", ("creep",), "ambiguous", {"hysteresis": ("creep",)}), "by_rival contained right"),
        (answer("single", ("creep",), "explained", {"hysteresis": ("creep",)}), "false confident"),
        (answer("single", ("creep",), "unexplained", {}), ""),
        (answer("pair", ("creep", "offset"), "ambiguous", {"hysteresis": ("creep",), "offset": ()}),
         "by_rival contained right"),
        (answer("pair", ("creep", "offset"), "explained", {"offset": ()}), ""),
        (answer("null", (), "explained", {"quantisation": ()}, tolerated=("quantisation",)), "exact right"),
        (answer("null", (), "partly_explained", {"drift": ()}), "false"),
        (answer("outsider", (), "partly_explained", {"creep": ()}), "false right"),
        (answer("outsider", (), "no_discrepancy", {}), "exact"),
        (answer("poor", ("creep",), "explained", {"hysteresis": ()}, accepted=("hysteresis",)), "right"),
        (answer("poor", ("creep",), "explained", {"rotation": ()}, accepted=("hysteresis",)), "false confident"),
        (answer("poor", ("creep",), "no_discrepancy", {}), "right"),
        (answer("broken", (), "no_discrepancy", {}, ("the clocks differ by 2.0 s",), broken="clocks"), "exact right"),
        (answer("broken", (), "explained", {"latency": ()}, broken="clocks"), "false confident"),
        (answer("broken", (), "unrelated", {}, broken="another"), "right"),
        (answer("broken", (), "explained", {"axis_gain": ()}, ("columns",), broken="milli", accepted=("axis_gain",)),
         ""),
        (answer("broken", (), "explained", {"axis_gain": ()}, ("in mN?",), broken="milli", accepted=("axis_gain",)),
         "right"),
    ],
)  # fmt: skip
def test_the_judge(given, expected):
    found, words = judge(given), set(expected.split())
    assert found.exact == ("exact" in words)
    assert found.by_rival == ("by_rival" in words)
    assert found.contained == bool({"contained", "exact"} & words or (not given.true and given.verdict != "unrelated"))
    assert bool(found.false) == ("false" in words)
    assert found.confident == ("confident" in words)
    assert found.right == ("right" in words)
