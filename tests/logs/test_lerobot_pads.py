"""How public LeRobotDatasets hold tactile data: columns of a state, and arrays with their axes in any order."""

import os

import numpy as np
import pytest
from log_files import refused

from paxisim.cli import main
from paxisim.errors import UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.recording import Recording

pytest.importorskip("pyarrow.parquet", exc_type=ImportError)

from lerobot_files import SAMPLES, dataset, values

JOINTS = ["shoulder_pan.pos", "gripper.pos"]
TIP = "paxini_fingertip"
TOUCH = "observation.touch"
TACTILE = "observation.tactile"


def columns(points, prefix=TIP):
    """Return the names of the columns of fingers; `points` is the number of points of each finger."""
    return [f"{prefix}f{k}.p{i:02d}.f{axis}" for k, n in points.items() for i in range(n) for axis in "xyz"]


def state_of(names):
    """Return a state as `dataset` takes it."""
    return values(len(names)), {"names": {"motors": names}}


def test_points_in_the_state(tmp_path):
    """The pads come in the order of the numbers, whatever the order of the columns."""
    names = JOINTS + columns({0: 12, 10: 12, 2: 12}, f"{TIP}.") + columns({0: 12}, "")
    np.random.default_rng(0).shuffle(names)
    state, description = state_of(names)
    counts = (values(2), {"names": ["f0.p00.fx", "f0.p00.fy"], "dtype": "int64"})  # whole numbers are not forces
    path = dataset(tmp_path / "set", {"observation.state": (state, description), "action": values(2), "raw": counts})
    found = Recording.load(path)
    assert found.pads == ("f0", f"{TIP}.f0", f"{TIP}.f2", f"{TIP}.f10")
    assert found.measured.shape == (SAMPLES, 4, 3, 1, 12)
    for pad, axis, point in ((0, 2, 11), (1, 0, 0), (2, 1, 10), (3, 2, 3)):
        column = names.index(f"{found.pads[pad]}.p{point:02d}.f{'xyz'[axis]}")
        np.testing.assert_array_equal(found.measured[:, pad, axis, 0, point], state[:, column])
    joints, raw = [f"observation.state.{name}" for name in JOINTS], [f"raw.{name}" for name in counts[1]["names"]]
    assert set(found.covariates) == {"action", *joints, *raw}
    np.testing.assert_array_equal(
        found.covariates["observation.state.gripper.pos"], state[:, names.index("gripper.pos")]
    )
    assert Recording.load(path, pads=[f"{TIP}.f2"]).pads == (f"{TIP}.f2",)


def test_points_on_a_grid(tmp_path):
    """The layout of a sensor places the points, which come in the vendor's order."""
    layout = TaxelLayout(4, 3, (2e-3, 2e-3), vendor_order=tuple(reversed(range(12))))
    path = dataset(
        tmp_path / "set",
        {"observation.state": state_of(columns({0: 12}, "")), f"{TACTILE}.palm": values(12, 3)},
    )
    flat = Recording.load(path).measured
    found = Recording.load(path, layout=layout)
    assert (found.pads, found.layout) == (("palm", "f0"), layout)
    np.testing.assert_array_equal(found.measured[:, :, :, 3, 2], flat[:, :, :, 0, 0])
    np.testing.assert_array_equal(found.measured[:, :, :, 0, 1], flat[:, :, :, 0, 10])
    refused(path, "layout has 4x4 taxels, the tensors have 1x12", layout=TaxelLayout(4, 4, (1e-3, 1e-3)))


@pytest.mark.parametrize(("letter", "unit", "other"), [("f", "N", "b"), ("b", "uT", "c"), ("c", "counts", "f")])
def test_the_unit_of_points(tmp_path, letter, unit, other):
    """Names as the plugin for LeRobot gives them to sensors that do not measure force."""
    names, others = ([f"skin.{pad}.p00.{of}{axis}" for axis in "xyz"] for pad, of in (("f0", letter), ("f1", other)))
    state, description = state_of(names)
    found = Recording.load(dataset(tmp_path / "set", {"observation.state": (state, description)}))
    assert (found.pads, found.unit) == (("skin.f0",), unit)
    np.testing.assert_array_equal(found.measured[:, 0, :, 0, 0], state)
    path = dataset(tmp_path / "gap", {"observation.state": state_of(names[:-1])})
    refused(path, f"no component skin.f0.p00.{letter}z: expected {letter}x, {letter}y and {letter}z of every point")
    refused(dataset(tmp_path / "units", {"observation.state": state_of(names + others)}), "have different units")
    both = [*names, *(name.replace("f1", "f0") for name in others)]
    refused(dataset(tmp_path / "both", {"observation.state": state_of(both)}), "skin.f0")


def test_points_with_gaps(tmp_path):
    whole = columns({0: 3, 1: 3}, "a.")
    for i, (names, word) in enumerate(
        (
            ([name for name in whole if name != "a.f1.p02.fy"], r"no component a.f1.p02.fy.*p00 to p02"),
            ([name for name in whole if "f0.p01" not in name], r"no component a.f0.p01.fx.*p00 to p02"),
            ([*whole, "a.f1.p999999999.fx"], r"no component a.f1.p03.fx.*p00 to p999999999"),
            ([*whole, "a.f0.p1.fz"], "two components of its features are named a.f0.p1.fz"),
            (columns({0: 3, 1: 2}, "a."), r"a.f0 and a.f1 have different grids \(1x3 and 1x2\).*select some with pads"),
        )
    ):
        path = dataset(tmp_path / f"{i}", {"observation.state": state_of([*JOINTS, *names])})
        refused(path, word)
        # the points are not read if the dataset only adds its joints to another recording
        Recording(np.arange(3) * 0.1, np.zeros((3, 1, 3, 1, 1))).save(tmp_path / "press.npz")
        joints = Recording.load(tmp_path / "press.npz", streams=path).covariates
        assert set(joints) == {f"observation.state.{name}" for name in JOINTS}
    assert Recording.load(path, pads="a.f1").measured.shape == (SAMPLES, 1, 3, 1, 2)


# shape, names of the axes, the axes asked for or None, and the axes in which the values must be read
READ = {
    "points": ((5, 3), None, None, "taxels,xyz"),
    "points, components first": ((3, 5), None, None, "xyz,taxels"),
    "grid": ((6, 5, 3), None, None, "rows,cols,xyz"),
    "grid, components first": ((3, 6, 5), None, None, "xyz,rows,cols"),
    "pads": ((2, 3, 6, 5), None, None, "pads,xyz,rows,cols"),
    "named": ((3, 6, 3), ["height", "width", "channel"], None, "rows,cols,xyz"),
    "named otherwise": ((3, 6, 3), ["axis", "row", "column"], None, "xyz,rows,cols"),
    "named columns first": ((5, 6, 3), {"axes": ["cols", "rows", "xyz"]}, None, "cols,rows,xyz"),
    "named points of pads": ((2, 5, 3), ["pad", "taxel", "xyz"], None, "pads,taxels,xyz"),
    "a name of the maker's": ((6, 5, 3), ["y", "x", "force"], None, "rows,cols,xyz"),
    "asked for": ((3, 3, 3), None, "cols,xyz,rows", "cols,xyz,rows"),
    "asked for against the names": ((3, 6, 3), ["axis", "row", "column"], "rows,cols,xyz", "rows,cols,xyz"),
    "vector of magnetometers": ((15,), None, "taxels,xyz", "taxels,xyz"),
    "vector, components first": ((15,), None, "xyz,taxels", "xyz,taxels"),
    "vector of channels": ((44,), None, "taxels", "taxels"),
    "grid of channels": ((4, 6), None, "rows,cols", "rows,cols"),
}


@pytest.mark.parametrize(("shape", "names", "asked", "axes"), READ.values(), ids=READ)
@pytest.mark.parametrize("feature", [TACTILE, TOUCH])
def test_the_axes_of_an_array(tmp_path, feature, shape, names, asked, axes):
    array, words = values(*shape), axes.split(",")
    path = dataset(tmp_path / "set", {feature: (array, {"names": names})})
    if feature == TOUCH:  # nothing but the caller says that it is tactile
        refused(path, "no tactile feature")
        asked = axes
    elif asked is not None and names is None:
        refused(path, r"tell the axes of observation.tactile \[.*--axes observation.tactile=")
    found = Recording.load(path, axes=None if asked is None else {feature: asked})
    split = array.reshape(SAMPLES, 3, 5) if words == ["xyz", "taxels"] else array
    split = array.reshape(SAMPLES, 5, 3) if words == ["taxels", "xyz"] else split
    size = dict(zip(words, split.shape[1:], strict=True))
    rows, cols = size.get("rows", 1), size.get("cols", size.get("taxels"))
    assert found.measured.shape == (SAMPLES, size.get("pads", 1), 3, rows, cols)
    name = "pad" if feature == TACTILE else "touch"
    assert found.pads == ((f"{name}0", f"{name}1") if "pads" in words else (name,))
    for pad, xyz, row, col in np.ndindex(found.measured.shape[1:]):
        at = {"pads": pad, "xyz": xyz, "rows": row, "cols": col, "taxels": col}
        expected = split[(slice(None), *(at[word] for word in words))]
        expected = expected if "xyz" in words or xyz == 2 else np.nan
        np.testing.assert_array_equal(found.measured[:, pad, xyz, row, col], expected)


REFUSED = {
    "cube": ((3, 3, 3), None, r"\(rows,cols,xyz or xyz,rows,cols or pads,t.*--axes observation.tactile=rows,cols,xyz"),
    "square": ((3, 3), None, r"\(taxels,xyz or xyz,taxels\)"),
    "pads": ((2, 3, 5, 3), None, r"\(pads,xyz,rows,cols or pads,rows,cols,xyz\)"),
    "vector": ((15,), None, r"\(taxels,xyz or xyz,taxels or taxels\)"),
    "channels": ((44,), None, r"\[44\] \(taxels\)"),
    "grid of channels": ((4, 6), None, r"\(rows,cols or pads,taxels\)"),
    "names against the shape": ((3, 6, 5), ["row", "column", "axis"], r"\(xyz,rows,cols\)"),
    "names without components": ((5, 3), ["row", "column"], r"\(taxels,xyz\)"),
    "names that are known in part": ((2, 5, 3), ["hand", "taxel", "axis"], r"\(rows,cols,xyz or pads,taxels,xyz\)"),
}


@pytest.mark.parametrize(("shape", "names", "word"), REFUSED.values(), ids=REFUSED)
def test_axes_that_cannot_be_told(tmp_path, shape, names, word):
    features = {TACTILE: (values(*shape), {"names": names}), f"{TACTILE}.left": values(6, 5, 3)}
    path = dataset(tmp_path / "set", features)
    refused(path, rf"names and shape do not tell the axes of observation.tactile.*{word}")
    found = Recording.load(path, pads="left")
    assert (found.measured.shape, list(found.covariates)) == ((SAMPLES, 1, 3, 6, 5), [TACTILE])


def test_a_covariate_with_a_tactile_name_comes_back(tmp_path):
    original = Recording(np.arange(4) / 10, np.ones((4, 1, 3, 2, 2)), covariates={"tactile": np.ones((4, 3, 3, 3))})
    original.save(tmp_path / "a.npz")
    assert main(["convert", str(tmp_path / "a.npz"), "--lerobot", str(tmp_path / "set")]) == 0
    found = Recording.load(tmp_path / "set")
    assert (found.pads, found.covariates["tactile"].shape) == (original.pads, (4, 3, 3, 3))


def test_axes_in_the_shell(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    dataset(tmp_path / "set", {TOUCH: values(15), "observation.state": (values(2), {"names": JOINTS})})
    convert = ["convert", "set", "a.npz"]
    for words, said in (
        ([], "got observation.touch [15], observation.state [2]; choose one with axes (paxisim convert --axes"),
        (
            ["--axes", "rows,cols,xyz"],
            "--axes must be FEATURE=AXES, e.g. observation.touch=rows,cols,xyz, with",
        ),
        (["--axes", f"{TOUCH}=taxels", f"{TOUCH}=taxels,xyz"], "with different names"),
        (["--axes", "observation.tuch=taxels"], "unknown feature 'observation.tuch'; did you mean 'observation.touch'"),
        (["--axes", f"{TOUCH}=row,col"], "must be rows,cols or taxels, with xyz and pads"),
        (["--axes", f"{TOUCH}=rows,xyz"], "must be rows,cols or taxels, with xyz and pads"),
        (["--axes", f"{TOUCH}=taxels,taxels"], "must be rows,cols or taxels, with xyz and pads"),
        (["--axes", f"{TOUCH}=rows,cols,xyz"], "do not fit observation.touch of shape [15]"),
        (["--axes", "observation.state=taxels,xyz"], "do not fit observation.state of shape [2]"),
    ):
        assert main([*convert, *words]) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 1
    assert os.listdir() == ["set"]
    assert main([*convert, "--axes", f"{TOUCH}=taxels,xyz"]) == 0
    assert "1 pad of 1x5 taxels" in capsys.readouterr().out
    assert Recording.load("a.npz").pads == ("touch",)
    assert main(["convert", "a.npz", "b.npz", "--axes", f"{TOUCH}=taxels,xyz"]) == 2
    assert "unknown array 'observation.touch'" in capsys.readouterr().err
    for axes in ({TOUCH: ("taxels", "xyz")}, "taxels,xyz"):
        refused(tmp_path / "set", "axes", axes=axes)
    with pytest.raises(UnknownNameError, match="unknown feature"):
        Recording.load("set", axes={"touch": "taxels"})
