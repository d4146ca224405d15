"""Magnetic skins: fields of magpylib, symmetry, decay, and the tensor of the driver from a gripper's contacts."""

from dataclasses import replace
from functools import cache
from importlib.resources import files

import mujoco
import numpy as np
import pytest

import paxisim
from paxisim.cli import main
from paxisim.layer.response import layer_response

NAMES = ("anyskin", "reskin", "eflesh")
ORDER = {"anyskin": "CLRUD", "reskin": "CURDL", "eflesh": "CLRUD"}


@cache
def skin_of(name: str) -> paxisim.MagneticSkin:
    return paxisim.MagneticSkin(name)


def press(newtons: float, rows=slice(4, 6), cols=slice(4, 6), shear: float = 0.0) -> np.ndarray:
    """Return an even press on some cells, with a share of shear along x."""
    force = np.zeros((3, 10, 10))
    force[2, rows, cols] = 1
    force[2] *= newtons / force[2].sum()
    force[0] = shear * force[2]
    return force


PRESSES = np.stack(
    [press(1.0), press(2.0, slice(1, 4), slice(6, 9), 0.4), press(5.0, slice(0, 10), slice(0, 10), -0.3)]
)


@cache
def unturned(name: str) -> paxisim.MagneticSkin:
    """Return a skin whose chips all have the axes of the pad."""
    design = skin_of(name).design
    return paxisim.MagneticSkin(replace(design, turns=(0.0,) * len(design.turns)))


@pytest.mark.parametrize("name", NAMES)
def test_a_design_has_a_source_for_each_figure_and_the_shape_of_its_driver(name):
    skin = skin_of(name)
    design = skin.design
    assert skin.layout == paxisim.sensor(name).layout
    assert skin.read(PRESSES).shape[1:] == paxisim.load_profile(name).layout.shape
    assert paxisim.load_profile(name).unit == "uT"
    assert all(text.split(":")[0] in ("assumption", "code", "hardware", "vendors") for text in design.sources.values())
    assert {"chips_mm", "turns_deg", "gap_mm", "remanence_mt", "noise_ut"} <= set(design.sources)
    x, y = np.array(design.chips).T
    places = {"C": (0, 0), "L": (-1, 0), "R": (1, 0), "U": (0, -1), "D": (0, 1)}
    assert [*zip(np.sign(x), np.sign(y), strict=True)] == [places[letter] for letter in ORDER[name]]
    assert paxisim.SkinDesign.named(name.upper()) == design


def test_an_evenly_magnetised_skin_at_rest_is_magpylibs_block():
    magpylib = pytest.importorskip("magpylib", reason="needs magpylib; install the test extra")
    skin, design = unturned("anyskin"), skin_of("anyskin").design
    height, width = design.cells.size
    block = magpylib.magnet.Cuboid(polarization=(0, 0, design.remanence), dimension=(width, height, 2e-3))
    at = [(x, y, design.layer.thickness / 2 + design.gap) for x, y in design.chips]
    np.testing.assert_allclose(skin.rest[:, 0].T, 1e6 * block.getB(at), atol=5.0)  # of 6000 uT


def test_a_press_is_magpylibs_field_of_the_moved_and_turned_magnets():
    magpylib = pytest.importorskip("magpylib", reason="needs magpylib; install the test extra")
    skin = skin_of("eflesh")
    design = skin.design
    moved, rotation = skin.motion(PRESSES)
    assert np.abs(moved).max() > 2e-4
    assert np.abs(rotation).max() > 1e-3
    moment = design.remanence * design.magnet_volume / (4e-7 * np.pi)
    for index in range(len(PRESSES)):
        magnets = []
        for place, by, turn in zip(design.magnets, moved[index].T, rotation[index].T, strict=True):
            axis = np.array([0, 0, 1.0]) + np.cross(turn, [0, 0, 1.0])
            axis *= moment / np.linalg.norm(axis)
            magnets.append(magpylib.misc.Dipole(moment=axis, position=np.array(place) + by))
        sensors = []
        for (x, y), turn in zip(design.chips, design.turns, strict=True):
            chip = magpylib.Sensor(position=(x, y, design.layer.thickness + design.gap))
            sensors.append(chip.rotate_from_angax(turn, "z", anchor=None, degrees=False))
        field = 1e6 * magpylib.getB(magnets, sensors, sumup=True).T
        np.testing.assert_allclose((skin.read(PRESSES[index]) + skin.rest)[:, 0], field, rtol=1e-7, atol=1e-6)


def test_the_displacement_is_reciprocal_on_the_face():
    """A force along i on A moves B along j as far as the same force along j on B moves A along i."""
    near, far = (24, 57), 1e-6
    design = skin_of("eflesh").design
    places = tuple((*design.cells.positions[cell, :2], far) for cell in near)
    skin = paxisim.MagneticSkin(replace(design, layer=paxisim.Layer(0.3e6, 0.3, 8e-3), magnets=places))
    moved = np.empty((2, 2, 3, 3))  # [cell with the force, cell that moves, force, displacement]
    for loaded, cell in enumerate(near):
        for axis in range(3):
            force = np.zeros((3, 100))
            force[axis, cell] = 1e-6
            moved[loaded, :, axis] = skin.motion(force.reshape(3, 10, 10))[0].T
    np.testing.assert_allclose(moved[0, 1], moved[1, 0].T, atol=1e-3 * np.abs(moved[0, 1]).max())
    assert np.abs(moved[0, 1] - moved[0, 1].T).max() > 0.05 * np.abs(moved[0, 1]).max(), (
        "a symmetric case shows nothing"
    )


def test_a_magnet_moves_as_the_layer_does_at_its_place():
    design = skin_of("eflesh").design
    cell, force = 37, np.zeros((3, 100))
    force[:, cell] = 1e-4, -2e-4, 3e-4
    displaced, turned = skin_of("eflesh").motion(force.reshape(3, 10, 10))
    layer, places = design.layer, np.array(design.magnets)
    beside = places[:, :2] - design.cells.positions[cell, :2]
    expected = layer_response(beside, 6e-3, layer.thickness, layer.modulus, layer.poisson, design.cells.pitch)
    for got, per_newton in zip((displaced, turned), expected, strict=True):
        np.testing.assert_allclose(got.T, per_newton @ force[:, cell], atol=1e-4 * np.abs(got).max())


@pytest.mark.parametrize("name", NAMES)
def test_a_small_press_is_linear_and_the_linear_field_adds_up(name):
    skin = skin_of(name)
    small = 2e-3 * PRESSES
    exact, linear = skin.read(small), skin.read(small, linear=True)
    np.testing.assert_allclose(linear, exact, atol=0.01 * np.abs(exact).max())
    both = skin.read(PRESSES[0] + PRESSES[1], linear=True)
    np.testing.assert_allclose(both, skin.read(PRESSES[:2], linear=True).sum(0), atol=1e-9 * np.abs(both).max())
    assert skin.motion(1000 * PRESSES)[0][:, 2].max() < skin.design.layer.thickness, "no magnet moves through the base"


@pytest.mark.parametrize(
    ("name", "newtons", "error"),
    [("anyskin", 0.1, 0.06), ("anyskin", 0.25, 0.14), ("anyskin", 1, 0.49), ("anyskin", 5, 1.3)]
    + [("eflesh", 0.1, 0.015), ("eflesh", 0.25, 0.037), ("eflesh", 1, 0.13), ("eflesh", 5, 0.43)],
)
def test_the_linear_field_is_as_wrong_as_the_guide_says(name, newtons, error):
    rows, cols = range(0, 9, 2), (0, 4, 7)
    force = np.stack([press(newtons, slice(r, r + 2), slice(c, c + 2), 0.3) for r in rows for c in cols])
    exact, linear = skin_of(name).read(force), skin_of(name).read(force, linear=True)
    worst = np.abs(linear - exact).max(axis=(1, 2, 3)) / np.abs(exact).max(axis=(1, 2, 3))
    assert worst.max() == pytest.approx(error, rel=0.08)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("linear", [False, True])
def test_a_press_in_the_middle_is_mirrored_at_the_outer_chips(name, linear):
    chip = dict(zip(ORDER[name], unturned(name).read(press(3.0), linear=linear)[:, 0].T, strict=True))
    x, z = chip["R"][0], chip["R"][2]
    assert abs(x) > 10
    assert abs(chip["C"][2]) > 10
    atol = 1e-6 * np.abs([*chip.values()]).max()
    np.testing.assert_allclose(chip["C"][:2], 0, atol=atol)
    for letter, expected in (("R", (x, 0, z)), ("L", (-x, 0, z)), ("D", (0, x, z)), ("U", (0, -x, z))):
        np.testing.assert_allclose(chip[letter], expected, atol=atol)
    size = np.linalg.norm(skin_of(name).read(press(3.0), linear=linear)[:, 0, 1:], axis=0)
    np.testing.assert_allclose(size, size[0], rtol=1e-6, err_msg="turns keep the size")


def test_a_chip_reads_in_its_own_axes():
    """A field along the pad's x is along -y of a chip whose x points along the pad's y."""
    skin = paxisim.MagneticSkin(replace(skin_of("eflesh").design, turns=(0, np.pi / 2, np.pi, -np.pi / 2, 0)))
    seen = skin.read(np.zeros((3, 10, 10)), outside=(20, 0, 3))[:, 0]
    np.testing.assert_allclose(seen, [[20, 0, -20, 0, 20], [0, -20, 0, 20, 0], [3, 3, 3, 3, 3]], atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_far_away_a_skin_is_one_dipole(name):
    design = skin_of(name).design
    volume = 4 * design.magnet_volume if design.magnets else 20e-3 * 20e-3 * design.layer.thickness
    moment = design.remanence * volume / (4e-7 * np.pi)
    rest, change = [], []
    for distance in (0.3, 0.6):
        skin = paxisim.MagneticSkin(replace(design, gap=distance, chips=((0.0, 0.0),), turns=(0.0,)))
        rest.append(skin.rest[2, 0, 0])
        change.append(skin.read(press(1.0), linear=True)[2, 0, 0])
        middle = distance + design.layer.thickness - design.dipoles()[0][:, 2].mean()
        assert rest[-1] == pytest.approx(1e6 * 2e-7 * moment / middle**3, rel=0.01)
    assert rest[0] / rest[1] == pytest.approx(8, rel=0.15)
    assert change[0] / change[1] == pytest.approx(16, rel=0.25), "a dipole that moves falls off with the fourth power"


@pytest.mark.parametrize("name", NAMES)
def test_many_frames_and_pads_are_read_as_one_by_one(name):
    skin = skin_of(name)
    force = np.random.default_rng(0).uniform(0, 0.05, (12, 2, 3, 10, 10))
    outside = np.random.default_rng(1).uniform(-50, 50, (12, 1, 3))
    read = skin.read(force, outside=outside)
    assert read.shape == (12, 2, 3, 1, 5)
    for frame, pad in ((0, 0), (7, 1), (11, 1)):
        one = skin.read(force[frame, pad], outside=outside[frame, 0])
        np.testing.assert_allclose(read[frame, pad], one, atol=1e-9 * np.abs(read).max())
    assert skin.read(force[:0]).shape == (0, 2, 3, 1, 5)
    np.testing.assert_allclose(skin.read(0 * force), 0, atol=1e-6)


def test_a_measurement_has_the_noise_and_the_counts_of_the_chips():
    skin = skin_of("eflesh")
    force = np.zeros((4000, 3, 10, 10))
    flux = skin.measure(force, np.random.default_rng(0))
    step = np.array([2.4, 2.4, 3.872])[:, None, None]
    np.testing.assert_allclose(flux / step, np.rint(flux / step), atol=1e-9)
    expected = np.hypot(skin.design.noise, step[:, 0, 0] / 12**0.5)
    np.testing.assert_allclose(flux.std(axis=(0, 2, 3)), expected, rtol=0.03)
    np.testing.assert_allclose(flux.mean(axis=(0, 2, 3)), 0, atol=0.2)
    np.testing.assert_array_equal(skin.measure(force, np.random.default_rng(0)), flux)
    free = paxisim.MagneticSkin(replace(skin.design, noise=(0, 0, 0), step=(0, 0, 0)))
    np.testing.assert_array_equal(free.measure(PRESSES, np.random.default_rng(0)), free.read(PRESSES))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gap": 0.0}, "gap must be a positive"),
        ({"remanence": np.nan}, "remanence must be finite"),
        ({"chips": ((0.0, 0.0, 0.0),)}, "chips must be points of 2"),
        ({"turns": (0.0,)}, "5 chips and turns"),
        ({"magnets": ((0.0, 0.0, 0.03),)}, "inside the skin, 0 to 0.02"),
        ({"magnet_volume": 0.0}, "magnet_volume must be positive"),
        ({"noise": (1.0, -1.0, 1.0)}, "noise must be three numbers"),
        ({"layer": 0.3e6}, "a paxisim.Layer as layer, got TaxelLayout and float"),
        ({"cells": paxisim.TaxelLayout(21, 20, 1e-3)}, "at most 400 cells, got 21x20"),
        ({"layer": paxisim.Layer(bonded=False)}, "needs a bonded layer"),
        ({"cells": paxisim.TaxelLayout(1, 2, 2e-3, [[0, 0, 0], [2e-3, 0, 1e-3]])}, "needs a flat grid"),
    ],
)
def test_a_design_that_cannot_be_is_refused(change, message):
    with pytest.raises(paxisim.InvalidValueError, match=message):
        replace(skin_of("eflesh").design, **change)


def test_wrong_input_is_refused():
    skin, good = skin_of("eflesh"), np.zeros((4, 2, 3, 10, 10))
    for force, outside, message in [
        (good[..., :9], 0 * np.ones(3), r"shape \(\.\.\., 3, 10, 10\)"),
        (np.full((3, 10, 10), np.inf), np.zeros(3), "force must be finite"),
        ("hard", np.zeros(3), "force must be an array of numbers"),
        (good, np.zeros(2), r"outside as \(\.\.\., 3\)"),
        (good, np.zeros((4, 3)), r"does not fit forces of shape"),
    ]:
        with pytest.raises(paxisim.InvalidValueError, match=message):
            skin.read(force, outside=outside)
    with pytest.raises(paxisim.UnknownNameError, match=r"did you mean .*'anyskin'"):
        paxisim.MagneticSkin("anyskn")
    with pytest.raises(paxisim.InvalidValueError, match="a SkinDesign or the name of one"):
        paxisim.MagneticSkin(5)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", NAMES)
def test_a_box_on_an_attached_skin_is_felt_where_it_stands(name):
    scene = """
    <mujoco><worldbody>
      <body name="table" euler="180 0 0"/>
      <body name="box" pos="-.006 0 .006"><freejoint/><geom type="box" size=".004 .004 .004" mass=".1"/></body>
    </worldbody></mujoco>"""
    gripper = paxisim.attach(scene, name, [paxisim.Mount("table")])
    model = gripper.compile()
    pads = gripper.bind(model)
    readout, data = paxisim.TactileReadout(model, pads), mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    force = readout.read(data)
    assert force[0, 2].sum() == pytest.approx(0.981, rel=0.05)
    flux = unturned(name).read(force)
    assert flux.shape == (1, 3, 1, 5)
    chip = dict(zip(ORDER[name], np.linalg.norm(flux[0, :, 0], axis=0), strict=True))
    assert chip["L"] > 1.5 * chip["R"]
    assert chip["U"] == pytest.approx(chip["D"], rel=0.1)


def test_the_skins_are_listed_and_attached_in_the_shell(tmp_path, capsys):
    assert main(["sensors"]) == 0
    listed = capsys.readouterr().out
    assert all(f"\n{name} " in listed for name in NAMES)
    gripper = tmp_path / "gripper.xml"
    gripper.write_text(files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(encoding="utf-8"))
    assert main(["attach", str(gripper), "--sensor", "anyskin", "-o", str(tmp_path / "tactile.xml")]) == 0
    assert "2 pads of 10x10 taxels" in capsys.readouterr().out
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "tactile.xml"))
    assert paxisim.find_pads(model).layout == skin_of("anyskin").layout
