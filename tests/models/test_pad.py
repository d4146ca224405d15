"""`Pad` and the model that MuJoCo compiles from it."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree
from scenes import PAPER, POOLED, compiled, settle

import paxisim
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.models.gel import Gel
from paxisim.models.pad import DENSITY, Pad
from paxisim.models.pads import find_pads
from paxisim.models.readout import TactileReadout

GRIDS = [(1, 1), (1, 7), (5, 1), (6, 5), (12, 10), (3, 2)]
PITCH = (2e-3, 5e-3)


def geom(model, row, col, pad="pad"):
    return model.geom(f"{pad}_taxel_{row}_{col}")


def tilted(count=5):
    """Return a layout of explicit taxels along an arc."""
    angle = np.linspace(-0.8, 0.8, count)
    normals = np.column_stack([np.sin(angle), np.zeros(count), -np.cos(angle)])
    return TaxelLayout(1, count, 2e-3, 8e-3 * (normals + [0, 0, 1]), normals)


# a pad loads on its own, whatever its grid


@pytest.mark.parametrize(("rows", "cols"), GRIDS)
@pytest.mark.parametrize("pitch", [2e-3, PITCH])
def test_any_grid_loads(rows, cols, pitch):
    layout = TaxelLayout(rows, cols, pitch)
    model, pads = compiled(Pad(layout, name="thumb"))
    assert model.ngeom == rows * cols + 1, "the taxels and the base"
    assert model.njnt == model.nsensor == model.nu == 0
    assert pads.names == ("thumb",)
    assert pads.layout == layout
    assert pads.thickness == pytest.approx((1e-3,))


def test_explicit_positions_load():
    layout = tilted()
    model, pads = compiled(Pad(layout))
    assert model.geom("pad_base").rgba[3] == 0, "no base is drawn behind a surface that is not flat"
    found = pads.layout
    np.testing.assert_allclose(found.positions, layout.positions, atol=1e-9)
    np.testing.assert_allclose(found.normals, layout.normals, atol=1e-7)
    assert found.pitch == pytest.approx(layout.pitch)
    assert not found.is_grid


@settings(derandomize=True, deadline=None, max_examples=30)
@given(
    st.integers(1, 8),
    st.integers(1, 8),
    st.floats(3e-4, 3e-2),
    st.floats(3e-4, 3e-2),
    st.floats(1e-4, 5e-3),
    st.integers(0, 99),
)
def test_every_pad_loads_is_contiguous_and_is_found_again(rows, cols, pitch_y, pitch_x, thickness, seed):
    layout = TaxelLayout(rows, cols, (pitch_y, pitch_x))
    heights = thickness * np.random.default_rng(seed).uniform(0.3, 3, (rows, cols))
    model, pads = compiled(Pad(layout, thickness=thickness, heights=heights))
    assert pads.layout.pitch == pytest.approx(layout.pitch, rel=1e-7, abs=2e-9)
    assert pads.thickness[0] == pytest.approx(thickness, rel=1e-6)
    np.testing.assert_allclose(pads.layout.positions, layout.positions, atol=1e-8)
    check_contiguous(model, layout, thickness, heights)


def check_contiguous(model, layout, thickness, heights):
    shape = (layout.rows, layout.cols)
    boxes = [[geom(model, r, c) for c in range(layout.cols)] for r in range(layout.rows)]
    low = np.array([[g.pos - g.size for g in row] for row in boxes])
    high = np.array([[g.pos + g.size for g in row] for row in boxes])
    np.testing.assert_allclose(high[:, :-1, 0], low[:, 1:, 0], atol=1e-9, err_msg="no gap along x")
    np.testing.assert_allclose(high[:-1, :, 1], low[1:, :, 1], atol=1e-9, err_msg="no gap along y")
    np.testing.assert_allclose((high - low)[..., 0], layout.pitch[1], atol=1e-9)
    np.testing.assert_allclose((high - low)[..., 1], layout.pitch[0], atol=1e-9)
    np.testing.assert_allclose((high - low)[..., 2], heights, atol=1e-9)
    np.testing.assert_allclose(high[..., 2], np.full(shape, thickness), atol=1e-9, err_msg="the backs do not move")


@pytest.mark.parametrize(("rows", "cols"), GRIDS)
def test_flat_cubes_are_contiguous_and_1_mm_thick(rows, cols):
    layout = TaxelLayout(rows, cols, PITCH)
    model, _ = compiled(Pad(layout))
    check_contiguous(model, layout, 1e-3, np.full((rows, cols), 1e-3))


def test_row_0_is_at_the_top_and_column_0_at_the_left():
    model, pads = compiled(Pad(TaxelLayout(3, 2, PITCH)))
    np.testing.assert_allclose(geom(model, 0, 0).pos[:2], [-2.5e-3, -2e-3])
    np.testing.assert_allclose(geom(model, 2, 1).pos[:2], [2.5e-3, 2e-3])
    assert [model.geom(int(g)).name for g in pads.geoms[0]] == [
        f"pad_taxel_{r}_{c}" for r in range(3) for c in range(2)
    ]


def test_a_taller_cube_stands_out_towards_the_object():
    heights = np.full((2, 2), 1e-3)
    heights[1, 0] = 1.4e-3
    model, _ = compiled(Pad(TaxelLayout(2, 2, 2e-3), heights=heights))
    tall = geom(model, 1, 0)
    assert tall.pos[2] - tall.size[2] == pytest.approx(-0.4e-3)
    assert geom(model, 0, 0).pos[2] - geom(model, 0, 0).size[2] == pytest.approx(0)


def test_curved_cubes_face_along_their_normals_and_meet():
    layout = tilted()
    model, pads = compiled(Pad(layout, thickness=0.5e-3))
    for taxel, geom_id in enumerate(pads.geoms[0]):
        item = model.geom(int(geom_id))
        frame = np.zeros(9)
        mujoco.mju_quat2Mat(frame, item.quat)
        out = -frame.reshape(3, 3)[:, 2]
        np.testing.assert_allclose(out, layout.normals[taxel], atol=1e-7)
        np.testing.assert_allclose(item.pos + item.size[2] * out, layout.positions[taxel], atol=1e-9)


def test_a_curved_grid_has_no_gaps_between_neighbours():
    # a cylinder of radius 12 mm: along the arc, the taxels are further apart than their projected pitch
    flat = TaxelLayout(3, 5, 4e-3)
    x = flat.positions[:, 0] / 12e-3
    positions = flat.positions + np.column_stack([0 * x, 0 * x, 12e-3 * (1 - np.sqrt(1 - x**2))])
    layout = TaxelLayout(3, 5, 4e-3, positions, np.column_stack([x, 0 * x, -np.sqrt(1 - x**2)]))
    model, _ = compiled(Pad(layout))
    for row in range(3):
        for col in range(4):
            left, right = geom(model, row, col), geom(model, row, col + 1)
            distance = np.linalg.norm(positions.reshape(3, 5, 3)[row, col + 1] - positions.reshape(3, 5, 3)[row, col])
            assert left.size[0] + right.size[0] >= distance * (1 - 1e-9)
    assert geom(model, 0, 2).size[1] == pytest.approx(2e-3)


# geoms, contacts and mass


def test_the_base_cannot_be_touched():
    model, _ = compiled(Pad(POOLED))
    base = model.geom("pad_base")
    assert base.contype[0] == base.conaffinity[0] == 0
    assert base.pos[2] - base.size[2] == pytest.approx(1e-3), "behind the cubes"
    assert base.size[2] == pytest.approx(1e-3)
    assert 2 * base.size[0] == pytest.approx(POOLED.size[1])
    assert 2 * base.size[1] == pytest.approx(POOLED.size[0])


def contacts(pad, other, pos):
    """Return the number of contacts that a geom at `pos` makes with the pad."""
    spec = mujoco.MjSpec.from_string(
        f"<mujoco><worldbody><body pos='{pos}'><freejoint/>{other}</body></worldbody></mujoco>"
    )
    spec.worldbody.add_frame().attach_body(mujoco.MjSpec.from_string(pad.to_xml()).body(pad.name), "p_", "")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.ncon


def test_what_touches_it():
    pad, ball = Pad(POOLED), "<geom type='sphere' size='0.001' {}/>"
    assert contacts(pad, ball.format(""), "0 0 -0.0009") > 0
    assert contacts(pad, ball.format(""), "0 0 -0.0011") == 0
    assert contacts(pad, ball.format(""), "0 0 0.0025") == 0, "inside the base, behind the cubes"
    assert contacts(pad, ball.format("contype='0'"), "0 0 -0.0005") == 0
    assert contacts(pad, ball.format("contype='2'"), "0 0 -0.0005") == 0
    wide = Pad(POOLED, contype=4, conaffinity=2)
    assert contacts(wide, ball.format("contype='2' conaffinity='0'"), "0 0 -0.0005") > 0
    assert contacts(wide, ball.format("contype='0' conaffinity='4'"), "0 0 -0.0005") > 0
    assert contacts(wide, ball.format(""), "0 0 -0.0005") == 0


@pytest.mark.parametrize("bits", [{}, {"contype": 4, "conaffinity": 3}, {"contype": 1, "conaffinity": 0}])
def test_pads_do_not_meet_each_other(bits):
    pad = Pad(POOLED, **bits)
    spec = mujoco.MjSpec.from_string(
        "<mujoco><worldbody><body name='a'><freejoint/></body><body name='b'><freejoint/></body></worldbody></mujoco>"
    )
    for name in "ab":
        frame = spec.body(name).add_frame()
        frame.attach_body(mujoco.MjSpec.from_string(pad.to_xml()).body("pad"), f"{name}_", "")
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0, "the pads lie in the same place"
    model.geom_contype[:] = model.body_contype[:] = 7  # with other bits they would touch
    model.geom_conaffinity[:] = model.body_conaffinity[:] = 7
    mujoco.mj_forward(model, data)
    assert data.ncon > 0


@pytest.mark.parametrize("layout", [POOLED, tilted()], ids=["grid", "curved"])
def test_mass_is_the_stated_one_whatever_the_surface(layout):
    heights = np.full((layout.rows, layout.cols), 3e-3)
    for pad in (Pad(layout, mass=8.5e-3), Pad(layout, mass=8.5e-3, heights=heights, base=5e-3)):
        model, _ = compiled(pad)
        assert model.body("pad").mass[0] == pytest.approx(8.5e-3, rel=1e-9)
    plain, bumped = compiled(Pad(layout))[0], compiled(Pad(layout, heights=heights))[0]
    np.testing.assert_array_equal(plain.body_inertia, bumped.body_inertia)
    np.testing.assert_array_equal(plain.body_mass, bumped.body_mass)


def test_default_mass_and_inertia_are_those_of_a_solid_block():
    model, _ = compiled(Pad(POOLED))
    height, width = POOLED.size
    depth = 3e-3  # 1 mm of gel on 2 mm of base
    mass = DENSITY * height * width * depth
    assert model.body("pad").mass[0] == pytest.approx(mass, rel=1e-6)
    expected = mass / 12 * np.array([height**2 + depth**2, width**2 + depth**2, height**2 + width**2])
    np.testing.assert_allclose(np.sort(model.body("pad").inertia), np.sort(expected), rtol=1e-6)
    np.testing.assert_allclose(model.body("pad").ipos, [0, 0, 1.5e-3], atol=1e-9)
    assert 1e-3 < mass < 5e-3


@pytest.mark.parametrize("setting", ["auto", "true", "false"])
@pytest.mark.parametrize("layout", [POOLED, tilted()], ids=["grid", "curved"])
def test_mass_survives_the_compilers_settings(setting, layout):
    spec = mujoco.MjSpec.from_string(
        f"<mujoco><compiler inertiafromgeom='{setting}' boundmass='1e-4' boundinertia='1e-9'/><worldbody>"
        "<body name='b'><freejoint/><inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/>"
        "<geom type='sphere' size='0.1' mass='1'/></body></worldbody></mujoco>"
    )
    pad = Pad(layout, mass=7e-3, heights=np.full((layout.rows, layout.cols), 2e-3))
    spec.body("b").add_frame().attach_body(mujoco.MjSpec.from_string(pad.to_xml()).body("pad"), "p_", "")
    body = spec.compile().body("p_pad")
    assert body.mass[0] == pytest.approx(7e-3, rel=1e-8)
    if setting == "true" and not layout.is_grid:
        np.testing.assert_allclose(body.inertia, compiled(pad)[0].body("pad").inertia, rtol=1e-7)


# the same pad gives the same bytes


def some_pads():
    heights = np.linspace(0.8e-3, 1.2e-3, 30).reshape(6, 5)
    yield Pad(POOLED)
    yield Pad(POOLED, heights=heights, sensors="contact", gel=Gel(modulus=1e5), mass=1 / 3)
    yield Pad(POOLED, heights=heights, sensors="touch_grid")
    yield Pad(tilted(), name="tip", contype=2, conaffinity=4)


def digest() -> str:
    return hashlib.sha256("".join(pad.to_xml() for pad in some_pads()).encode()).hexdigest()


def test_the_same_pad_gives_the_same_bytes():
    for first, second in zip(some_pads(), some_pads(), strict=True):
        assert first.to_xml() == first.to_xml() == second.to_xml()


@pytest.mark.parametrize("seed", ["0", "1"])
def test_the_same_bytes_in_every_process(seed):
    here = Path(__file__).parent
    path = os.pathsep.join(
        [str(Path(paxisim.__file__).parents[1]), str(here), *filter(None, [os.environ.get("PYTHONPATH")])]
    )
    done = subprocess.run(
        [sys.executable, "-c", "import test_pad; print(test_pad.digest())"],
        env=os.environ | {"PYTHONPATH": path, "PYTHONHASHSEED": seed},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    assert done.stdout.strip() == digest()


def test_no_negative_zeros_in_the_text():
    assert '"-0"' not in Pad(tilted(3)).to_xml()
    assert "-0 " not in Pad(tilted(3)).to_xml()


# sensors


def test_one_contact_sensor_a_taxel():
    model, _ = compiled(Pad(PAPER, sensors="contact"))
    assert model.nsensor == 120
    assert {int(kind) for kind in model.sensor_type} == {int(mujoco.mjtSensor.mjSENS_CONTACT)}
    assert model.sensor("pad_force_11_9").id == 119


def test_contact_sensors_agree_with_the_readout():
    pad = Pad(TaxelLayout(2, 3, 4e-3), sensors="contact")
    text = etree.fromstring(pad.to_xml())
    world = text.find("worldbody")
    body = etree.SubElement(world, "body", name="plate", pos="0 0 -0.01")
    etree.SubElement(body, "joint", type="slide", axis="0 0 1")
    etree.SubElement(body, "geom", type="box", size="0.05 0.05 0.01", mass="0.5")
    model = mujoco.MjModel.from_xml_string(etree.tostring(text, encoding="unicode"))
    model.opt.gravity = 0
    pads = find_pads(model)
    pad.gel.apply(model, pads)
    data = mujoco.MjData(model)
    settle(model, data, 6.0, 0.3)
    force = TactileReadout(model, pads).read(data)
    sensors = data.sensordata.reshape(2, 3, 3)  # (rows, cols, xyz): force on the object, in the world frame
    np.testing.assert_allclose(force[0], -pads.layout.from_image(sensors), atol=1e-6)
    assert force[0, 2].sum() == pytest.approx(6.0, rel=1e-3)


def test_a_touch_grid_sensor_has_three_values_a_taxel():
    model, pads = compiled(Pad(POOLED, sensors="touch_grid"))
    assert model.nsensor == 1
    assert model.nsensordata == 90
    assert pads.layout.pitch == pytest.approx(POOLED.pitch)
    assert pads.layout.is_grid


# bad input


@pytest.mark.parametrize("value", [0, -1e-3, float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["thickness", "base", "mass"])
def test_bad_lengths_and_masses(name, value):
    with pytest.raises(InvalidValueError, match=f"a pad's {name} must be positive and finite, got"):
        Pad(POOLED, **{name: value})


@pytest.mark.parametrize("shape", [(5, 6), (30,), (6,), (), (2, 6, 5), (1, 6, 5)])
def test_heights_of_another_shape(shape):
    with pytest.raises(InvalidValueError, match=r"heights must have shape \(.*6, 5\), got"):
        Pad(POOLED, heights=np.full(shape, 1e-3))


@pytest.mark.parametrize("value", [0, -1e-4, float("nan"), float("inf")])
def test_heights_that_are_no_thickness(value):
    heights = np.full((6, 5), 1e-3)
    heights[3, 2] = value
    with pytest.raises(InvalidValueError, match="heights must be positive and finite"):
        Pad(POOLED, heights=heights)


@pytest.mark.parametrize("bits", [(1, 1), (6, 4), (3, 2)])
def test_bits_with_which_pads_would_meet(bits):
    with pytest.raises(InvalidValueError, match="share bits: pads would meet each other"):
        Pad(POOLED, contype=bits[0], conaffinity=bits[1])


def test_an_unknown_kind_of_sensor():
    with pytest.raises(InvalidValueError, match="sensors must be 'contact', 'touch_grid' or None, got 'touch'"):
        Pad(POOLED, sensors="touch")


@pytest.mark.parametrize("value", [1e-300, 5e-6])
def test_a_pitch_that_no_pad_has(value):
    """The layout itself refuses a pitch that is too large."""
    with pytest.raises(InvalidValueError, match="a pad's pitch must lie between 1e-05 and 1 m, got"):
        Pad(TaxelLayout(3, 2, (1e-3, value)))


@pytest.mark.parametrize("value", [1e-300, 5e-6, 1.5, 1e300])
def test_a_thickness_that_no_pad_has(value):
    with pytest.raises(InvalidValueError, match="a pad's thickness must lie between 1e-05 and 1 m, got"):
        Pad(POOLED, thickness=value)


def test_more_taxels_than_mujoco_can_take():
    with pytest.raises(InvalidValueError, match="a pad has at most 40000 taxels, got 300x200"):
        Pad(TaxelLayout(300, 200, 1e-3))


@pytest.mark.parametrize("name", ["\udcff", "a\0b", "a\x1b"])
def test_a_name_that_xml_cannot_hold(name):
    with pytest.raises(InvalidValueError, match="a pad's name must be text that XML can hold"):
        Pad(POOLED, name=name)
    with pytest.raises(InvalidValueError, match="a mount's name must be text that XML can hold"):
        paxisim.Mount("hand", name=name)


def test_a_pad_without_a_name():
    with pytest.raises(InvalidValueError, match="name"):
        Pad(POOLED, name="")


def test_a_name_that_xml_must_escape():
    model, pads = compiled(Pad(TaxelLayout(1, 2, 2e-3), name='left <&"> pad/1'))
    assert pads.names == ('left <&"> pad/1',)
    assert model.body(pads.names[0]).id == pads.bodies[0]
