"""Profiles: the shipped ones, user files and their mistakes, and the conversion from counts to the pad's tensor."""

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paxisim import (
    InvalidValueError,
    MissingExtraError,
    Profile,
    Slot,
    TaxelLayout,
    UnknownNameError,
    UnverifiedProfileWarning,
    known_profiles,
    load_profile,
)
from paxisim.hw.families.table import FAMILIES
from paxisim.hw.profiles.load import shipped_entry
from paxisim.hw.profiles.write import profile_toml

GEN3 = {
    **{"mc-m2020": 9, "ip-s1610": 25, "dp-s1813-elite": 31, "dp-s1813-core": 51, "dp-s2015": 52, "ip-m2324": 68},
    **{"cp-m3025": 77, "dp-s3013": 96, "dp-s2716": 116, "dp-m2826": 127, "dp-l3530": 135, "cp-l5325": 239},
}
HAS_COORDINATES = importlib.util.find_spec("paxini_sdk") is not None
FLAT = [name for name in known_profiles() if "coordinates" not in shipped_entry(name)["layout"]]
LOADABLE = list(known_profiles()) if HAS_COORDINATES else FLAT
AXES = [
    tuple(s + a for s, a in zip(signs, axes, strict=True))
    for signs in ("+++", "-++", "+-+", "--+", "++-", "---")
    for axes in ("xyz", "yxz")
]


def grid(rows=3, cols=2, order=None, **fields) -> Profile:
    layout = TaxelLayout(rows, cols, (2e-3, 3e-3), vendor_order=order)
    return Profile("test", "control-box", layout, (Slot("left", 2), Slot("right", 5)), **fields)


# ---- shipped profiles ---------------------------------------------------------------------------------------------


def test_every_shipped_profile_loads_says_what_it_knows_and_reads_back_from_a_file(tmp_path):
    known = ("vendor document", "hardware", "code", "inference", "paxisim's sensor catalogue")
    path = tmp_path / "mine.toml"
    for name in LOADABLE:
        profile, entry = load_profile(name), shipped_entry(name)
        assert profile.family in FAMILIES, name
        assert profile.layout.taxels == profile.wire_layout.taxels == entry["taxels"], name
        assert profile.name == name or name in ("gen3-serial", "gen3-highspeed"), name
        assert profile.name == profile.name.lower()
        assert profile.verified == "", name
        assert profile.notes, name
        figures = {"taxels", "layout", "resolution", "baud", "axes", "slots"} | ({"rate"} if profile.rate else set())
        assert set(profile.sources) - {"settings"} == figures, name
        assert ("settings" in profile.sources) == bool(profile.settings), name
        assert all(text.startswith(known) and "\n" not in text for text in profile.sources.values()), name
        mine = replace(profile, name="mine", axes=("-y", "+x", "+z"), verified='by "me"\n\x7f\\ é')
        path.write_text(profile_toml(mine), encoding="utf-8")
        assert load_profile(str(path)) == mine, name
        assert hash(load_profile(path)) == hash(mine), name


def test_every_part_that_was_asked_for_is_there():
    for part, taxels in GEN3.items():
        for board in ("serial", "highspeed"):
            assert shipped_entry(f"gen3-{board}-{part}")["taxels"] == taxels, part
    named = {"gen3-serial-dp-s2015", "gen3-highspeed-dp-s2015", "gen2-box-120", "gen1-stream", "gen1-pap-l4629"}
    assert named <= set(known_profiles())
    assert len(set(known_profiles())) == len(known_profiles())


@pytest.mark.skipif(not HAS_COORDINATES, reason="needs paxini-sdk")
def test_an_alias_is_the_same_profile():
    assert load_profile("gen3-highspeed") == load_profile("GEN3-HighSpeed-DP-S2015")


@pytest.mark.skipif(HAS_COORDINATES, reason="paxini-sdk is installed")
def test_without_coordinates_a_curved_part_says_what_to_install():
    with pytest.raises(MissingExtraError, match="paxini-sdk"):
        load_profile("gen3-serial")


@pytest.mark.skipif(not HAS_COORDINATES, reason="needs paxini-sdk")
def test_the_planar_part_sits_where_its_table_says():
    from paxini_sdk.sensor_registry import load_points

    table = np.array(load_points("PXSR-STDMC03A"))
    profile = load_profile("gen3-serial-mc-m2020")
    mine = 1e3 * profile.wire_layout.positions[np.array(profile.wire_layout.vendor_order)]
    theirs = (table - table.mean(axis=0)) * [1, -1, 1]
    assert mine == pytest.approx(theirs, abs=1e-6)


def test_the_published_order_of_120_points_begins_at_the_root():
    layout = load_profile("gen2-box-120").wire_layout
    at = layout.positions[np.array(layout.vendor_order)]
    assert at[0, 1] == layout.positions[:, 1].max()  # the bottom row
    assert np.all(np.diff(at[:12, 1]) < 0)  # 12 points towards the tip
    assert np.ptp(at[:12, 0]) == 0
    assert at[12, 0] > at[0, 0]


def test_an_unknown_name_offers_the_near_ones():
    with pytest.raises(UnknownNameError, match=r"did you mean .*'gen2-box-120'"):
        load_profile("gen2-box-12")


def test_an_unverified_profile_warns_and_a_verified_one_does_not():
    with pytest.warns(UnverifiedProfileWarning, match="device check"):
        grid().warn_unverified()
    grid(verified="on my desk").warn_unverified()


# ---- counts and newtons -------------------------------------------------------------------------------------------


def test_order_axes_and_signs_worked_by_hand():
    profile = grid(rows=1, cols=2, order=(1, 0), axes=("-y", "+x", "+z"))
    counts = np.array([[[1, 2, 3], [4, 5, 6]]], dtype=np.int16)  # the second taxel is sent first
    force = profile.to_force(counts)
    assert force.dtype == np.float32
    assert force[0] == pytest.approx(np.array([[[-0.5, -0.2]], [[0.4, 0.1]], [[0.6, 0.3]]]))
    assert np.array_equal(profile.to_counts(force), counts)
    total = profile.resultant_force(np.array([[1, 2, 3]], dtype=np.int16))
    assert total == pytest.approx(np.array([[-0.2, 0.1, 0.3]]))


def test_newtons_are_the_nearest_float32_to_whole_steps():
    counts = np.zeros((256, 6, 3), dtype=np.int16)
    counts[:, 0, 2] = np.arange(256)
    felt = grid().to_force(counts)[:, 2, 0, 0]
    assert felt.tolist() == [float(np.float32(k * 0.1)) for k in range(256)]


@given(st.data())
@settings(max_examples=40, deadline=None)
def test_force_and_counts_undo_each_other(data):
    rows, cols = data.draw(st.integers(1, 4)), data.draw(st.integers(1, 4))
    order = data.draw(st.none() | st.permutations(range(rows * cols)))
    axes = data.draw(st.sampled_from(AXES))
    profile = grid(rows, cols, order, axes=axes)
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    counts = rng.integers([-128, -128, 0], [128, 128, 256], (2, 5, rows * cols, 3)).astype(np.int16)
    force = profile.to_force(counts)
    assert force.shape == (2, 5, 3, rows, cols)
    again = profile.to_counts(force)
    assert again.dtype == np.int16
    assert np.array_equal(again, counts)
    # the layout's own conversion of a flat reading gives the same order
    if axes == ("+x", "+y", "+z"):
        flat = profile.wire_layout.from_flat(counts.reshape(2, 5, -1).astype(np.float64))
        assert force == pytest.approx(0.1 * flat, rel=1e-6)


def test_firmware_clips_rounds_and_gates():
    profile = grid(rows=1, cols=1)
    force = np.array([-20.0, 20.0, 30.0]).reshape(1, 3, 1, 1)
    assert profile.to_counts(force).tolist() == [[[-128, 127, 255]]]
    assert profile.to_counts(-force).tolist() == [[[127, -128, 0]]]
    small = np.array([0.14, -0.16, 0.24]).reshape(1, 3, 1, 1)
    assert profile.to_counts(small).tolist() == [[[1, -2, 2]]]
    assert profile.to_counts(small, gate=2).tolist() == [[[0, -2, 2]]]
    assert profile.to_counts(small, gate=2, shear_floor=3).tolist() == [[[3, -3, 2]]]
    assert profile.to_counts(small * [[[1]], [[1]], [[0]]], gate=2, shear_floor=3).tolist() == [[[0, 0, 0]]]


def test_pooling_conserves_force_and_gives_the_pooled_layout():
    profile = grid(rows=4, cols=2, pool=(2, 1))
    rng = np.random.default_rng(0)
    counts = rng.integers(0, 128, (7, 8, 3)).astype(np.int16)
    force = profile.to_force(counts)
    assert force.shape[1:] == profile.layout.shape == (3, 2, 2)
    assert profile.layout == profile.wire_layout.pool(2, 1)
    assert force.sum(axis=(-2, -1)) == pytest.approx(0.1 * counts.sum(axis=1), rel=1e-5)


def test_forces_lie_in_memory_row_by_row_and_counts_of_another_shape_are_refused():
    for pool in ((1, 1), (3, 1)):
        assert grid(pool=pool).to_force(np.zeros((2, 6, 3), dtype=np.int16)).flags.c_contiguous
    assert grid().resultant_force(np.zeros((2, 3), dtype=np.int16)).flags.c_contiguous
    for shape in ((3, 6), (5, 3), (6, 2), ()):
        with pytest.raises(InvalidValueError, match=r"\(\.\.\., 6, 3\)"):
            grid().to_force(np.zeros(shape, dtype=np.int16))


# ---- invalid profiles ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"family": "controll-box"}, "did you mean 'control-box'"),
        ({"axes": ("+x", "+x", "+z")}, "axes must be x, y and z"),
        ({"axes": ("x", "y", "z")}, "each with its sign"),
        ({"axes": ("+x", "+y")}, "axes must be"),
        ({"slots": ()}, "at least one pad"),
        ({"slots": (Slot("a", 1), Slot("a", 2))}, "same name"),
        ({"slots": (Slot("a", 1), Slot("b", 1))}, "same index"),
        ({"slots": (Slot("a", -1),)}, "not be negative"),
        ({"resolution": 0.0}, "resolution must be a positive"),
        ({"baud": -1}, "baud must be a positive"),
        ({"baud": 99999999999999999999}, "baud must be a positive number below"),
        ({"resolution": float("inf")}, "resolution must be a positive"),
        ({"rate": float("nan")}, "rate must be a positive"),
        ({"pool": (2, 2)}, "cannot pool 3x2"),
        ({"settings": {"modus": 5}}, "did you mean 'mode'"),
        ({"settings": {"mode": "5"}}, "must be of type int"),
    ],
)
def test_a_profile_that_cannot_be_is_refused(fields, message):
    with pytest.raises(InvalidValueError, match=message):
        replace(grid(), **fields)


# ---- a user's own file --------------------------------------------------------------------------------------------


@given(st.integers(1, 3), st.integers(1, 3), st.text(), st.floats(1e-6, 0.3), st.floats(0.1, 1e4))
@settings(max_examples=20, deadline=None)
def test_any_profile_survives_its_file(tmp_path_factory, rows, cols, text, pitch, rate):
    layout = TaxelLayout(rows, cols, (pitch, pitch / 3), vendor_order=tuple(reversed(range(rows * cols))))
    text = text.encode("utf-8", "replace").decode()
    profile = Profile("p", "hand-board", layout, (Slot(text or "a", 0),), rate=rate, notes=text, pool=(rows, 1))
    profile = replace(profile, settings={"signed_normal": True}, sources={text: text})
    path = tmp_path_factory.mktemp("profile") / "p.toml"
    path.write_text(profile_toml(profile), encoding="utf-8", newline="")
    assert load_profile(path) == profile


def test_a_short_file_takes_the_rest_from_a_known_profile(tmp_path):
    path = tmp_path / "gripper.toml"
    path.write_text(
        'like = "gen2-box-120"\npool = [2, 2]\nslots = [{ name = "left", index = 2 }, { name = "right", index = 5 }]\n'
    )
    profile = load_profile(path)
    known = load_profile("gen2-box-120")
    assert (profile.name, profile.slots) == ("gripper", (Slot("left", 2), Slot("right", 5)))
    assert profile.layout.shape == (3, 6, 5)
    assert (profile.wire_layout, profile.settings) == (known.wire_layout, known.settings)


FILE = """
family = "control-box"
axes = ["+x", "+y", "+z"]
slots = [{ name = "left", index = 2 }]
layout = { rows = 3, cols = 2, pitch = [0.002, 0.002], vendor_order = [5, 4, 3, 2, 1, 0] }
settings = { mode = 5 }
"""


# what is changed in the file, into what, and the salient words
BAD_FILES = [
    ("axes =", "axis =", "unknown key 'axis'; did you mean 'axes'"),
    ("control-box", "high-sped", "did you mean 'high-speed'"),
    ('"+z"]', '"+y"]', "axes must be x, y and z"),
    ('["+x", "+y", "+z"]', "[1, 2, 3]", "axes must be a list of three strings"),
    ('["+x", "+y", "+z"]', '"+x"', "axes must be a list"),
    ("[5, 4, 3, 2, 1, 0]", "[5, 4, 3, 2, 1]", r"permutation of 0\.\.5"),
    ("[5, 4, 3, 2, 1, 0]", "[5, 4, 3, 2, 1, 1]", r"permutation of 0\.\.5"),
    ("[5, 4, 3, 2, 1, 0]", "[5.0, 4, 3, 2, 1, 0]", "whole numbers"),
    ("[5, 4, 3, 2, 1, 0]", '"lines"', "whole numbers"),
    ("rows = 3, ", "", "layout lacks rows"),
    ("rows = 3", "rows = 0", "rows must be a whole number"),
    ("rows = 3", "rows = 4", r"permutation of 0\.\.7"),
    ("rows = 3, cols = 2", "rows = 100000, cols = 100000", "at most 21845 taxels, got rows 100000"),
    ("rows = 3", "row = 3", "did you mean 'rows'"),
    ("pitch = [0.002, 0.002]", "pitch = 'a'", "pitch must be"),
    ("layout = {", "layout = { coordinates = 'a', ", "must not have"),
    ("index = 2", "index = '2'", "whole number as index"),
    ("index = 2", "port = 2", "unknown key of a slot 'port'"),
    ("mode = 5", "address = '1'", "must be of type int"),
    ("mode = 5", "mod = 5", "did you mean 'mode'"),
    ("family =", "resolution = true\nfamily =", "resolution must be a number"),
    ("family =", "pool = [1, 1, 1]\nfamily =", "pool must be"),
    ("family =", "sources = { rate = 5 }\nfamily =", "sources.rate must be a string"),
    ("family =", "like = 'gen2-box-121'\nfamily =", "did you mean 'gen2-box-120'"),
    ("family = ", "# ", "neither family"),
    ("family = ", "family: ", "not TOML"),
]


def test_a_bad_file_is_refused_and_the_mistake_named(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(FILE)
    assert load_profile(path).wire_layout.vendor_order == (5, 4, 3, 2, 1, 0)
    for old, new, message in BAD_FILES:
        assert old in FILE
        path.write_text(FILE.replace(old, new, 1))
        with pytest.raises(InvalidValueError, match=message) as caught:
            load_profile(path)
        assert str(path) in str(caught.value), new


def test_a_file_that_is_no_text_is_not_there_or_names_unknown_coordinates(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InvalidValueError, match="UTF-8"):
        load_profile(path)
    with pytest.raises(FileNotFoundError):
        load_profile(tmp_path / "none.toml")
    path.write_text(FILE.split("layout")[0] + 'layout = { coordinates = "paxini-sdk:PXSR-STDDP03X" }\n')
    with pytest.raises(InvalidValueError, match="did you mean 'paxini-sdk:PXSR-STDDP03"):
        load_profile(path)
