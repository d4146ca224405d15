"""`Pad` and the model that MuJoCo compiles from it."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import PAPER, POOLED, axes_of, compiled, with_pad

import paxisim
from paxisim import InvalidValueError, Pad, TaxelLayout
from paxisim.models.pad import DENSITY

PITCH = (2e-3, 5e-3)


def geom(model, row, col):
    return model.geom(f"pad_taxel_{row}_{col}")


def around_a_cylinder():
    """Return a grid of taxels around a cylinder along y, with a radius of 12 mm; neighbours are over a pitch apart."""
    flat = TaxelLayout(3, 5, 4e-3)
    x = flat.positions[:, 0] / 12e-3
    depth = 1 - np.sqrt(1 - x**2)
    positions = flat.positions + 12e-3 * np.column_stack([0 * x, 0 * x, depth])
    return TaxelLayout(3, 5, 4e-3, positions, np.column_stack([x, 0 * x, depth - 1]))


# a pad loads on its own, whatever its grid


def check_pad(layout, thickness, heights):
    """Check that the pad is found again, and that its cubes touch each other and have their backs in one plane."""
    model, pads = compiled(Pad(layout, thickness=thickness, heights=heights))
    assert model.ngeom == layout.taxels + 1, "the taxels and the base"
    assert model.njnt == model.nsensor == model.nu == 0
    assert pads.layout.pitch == pytest.approx(layout.pitch, rel=1e-7, abs=2e-9)
    assert pads.thickness[0] == pytest.approx(thickness, rel=1e-6)
    np.testing.assert_allclose(pads.layout.positions, layout.positions, atol=1e-8)
    boxes = [[geom(model, r, c) for c in range(layout.cols)] for r in range(layout.rows)]
    low = np.array([[g.pos - g.size for g in row] for row in boxes])
    high = np.array([[g.pos + g.size for g in row] for row in boxes])
    np.testing.assert_allclose(high[:, :-1, 0], low[:, 1:, 0], atol=1e-9, err_msg="no gap along x")
    np.testing.assert_allclose(high[:-1, :, 1], low[1:, :, 1], atol=1e-9, err_msg="no gap along y")
    np.testing.assert_allclose((high - low)[..., 0], layout.pitch[1], atol=1e-9)
    np.testing.assert_allclose((high - low)[..., 1], layout.pitch[0], atol=1e-9)
    np.testing.assert_allclose((high - low)[..., 2], heights, atol=1e-9)
    np.testing.assert_allclose(high[..., 2], thickness, atol=1e-9, err_msg="the backs do not move")


@settings(derandomize=True, deadline=None, max_examples=15)
@given(
    st.integers(1, 8),
    st.integers(1, 8),
    st.floats(3e-4, 3e-2),
    st.floats(3e-4, 3e-2),
    st.floats(1e-4, 5e-3),
    st.integers(0, 99),
)
def test_every_pad_loads_is_contiguous_and_is_found_again(rows, cols, pitch_y, pitch_x, thickness, seed):
    heights = thickness * np.random.default_rng(seed).uniform(0.3, 3, (rows, cols))
    check_pad(TaxelLayout(rows, cols, (pitch_y, pitch_x)), thickness, heights)


def test_without_heights_a_pad_is_flat_and_1_mm_thick():
    model, pads = compiled(Pad(TaxelLayout(3, 2, PITCH), name="pad"))
    np.testing.assert_allclose(model.geom_size[pads.geoms[0], 2], 0.5e-3)
    assert pads.names == ("pad",)
    assert pads.layout == TaxelLayout(3, 2, PITCH)
    np.testing.assert_allclose(geom(model, 0, 0).pos, [-2.5e-3, -2e-3, 0.5e-3], err_msg="row 0 at the top")
    np.testing.assert_allclose(geom(model, 2, 1).pos, [2.5e-3, 2e-3, 0.5e-3])
    assert [model.geom(int(g)).name for g in pads.geoms[0]] == [
        f"pad_taxel_{r}_{c}" for r in range(3) for c in range(2)
    ]


def test_curved_cubes_face_along_their_normals_and_meet():
    layout = around_a_cylinder()
    pad = Pad(layout, thickness=0.5e-3)
    model, pads = compiled(pad)
    assert model.geom("pad_base").rgba[3] == 0, "no base is drawn behind a surface that is not flat"
    np.testing.assert_allclose(pads.layout.positions, layout.positions, atol=1e-9)
    np.testing.assert_allclose(pads.layout.normals, layout.normals, atol=1e-7)
    assert pads.layout.pitch == pytest.approx(layout.pitch)
    assert not pads.layout.is_grid
    for taxel, geom_id in enumerate(pads.geoms[0]):
        item = model.geom(int(geom_id))
        out = -axes_of(item.quat)[:, 2]
        np.testing.assert_allclose(out, layout.normals[taxel], atol=1e-7)
        np.testing.assert_allclose(item.pos + item.size[2] * out, layout.positions[taxel], atol=1e-9)
    at = layout.positions.reshape(3, 5, 3)
    for row, col in np.ndindex(3, 4):
        reach = geom(model, row, col).size[0] + geom(model, row, col + 1).size[0]
        assert reach >= np.linalg.norm(at[row, col + 1] - at[row, col]) * (1 - 1e-9)
    assert geom(model, 0, 2).size[1] == pytest.approx(2e-3)
    assert '"-0"' not in pad.to_xml()
    assert "-0 " not in pad.to_xml()


# geoms, contacts and mass


def test_what_touches_it():
    ball = "<mujoco><worldbody><body pos='0 0 {}'><freejoint/><geom size='0.001' {}/></body></worldbody></mujoco>"
    own, wide = {}, {"contype": 4, "conaffinity": 2}
    cases = [
        (own, -0.0009, "", True),
        (own, -0.0011, "", False),
        (own, 0.0025, "", False),  # inside the base, behind the cubes
        (own, -0.0005, "contype='0'", False),
        (own, -0.0005, "contype='2'", False),
        (wide, -0.0005, "contype='2' conaffinity='0'", True),
        (wide, -0.0005, "contype='0' conaffinity='4'", True),
        (wide, -0.0005, "", False),
    ]
    for bits, z, attributes, touches in cases:
        model = with_pad(ball.format(z, attributes), Pad(POOLED, **bits)).compile()
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert (data.ncon > 0) == touches, (bits, z, attributes)


def test_the_base_is_behind_the_cubes_and_as_large():
    base = compiled(Pad(POOLED))[0].geom("pad_base")
    assert base.contype[0] == base.conaffinity[0] == 0
    np.testing.assert_allclose(base.size, [POOLED.size[1] / 2, POOLED.size[0] / 2, 1e-3])
    np.testing.assert_allclose(base.pos, [0, 0, 2e-3], atol=1e-12)


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


@pytest.mark.parametrize("layout", [POOLED, around_a_cylinder()], ids=["grid", "curved"])
def test_mass_is_the_stated_one_whatever_the_surface_and_the_compilers_settings(layout):
    heights = np.full((layout.rows, layout.cols), 3e-3)
    plain, bumped = (Pad(layout, mass=7e-3, heights=of) for of in (None, heights))
    inertia = [compiled(pad)[0].body("pad").inertia for pad in (plain, bumped)]
    np.testing.assert_array_equal(*inertia)
    assert compiled(Pad(layout, mass=7e-3, base=5e-3))[0].body("pad").mass[0] == pytest.approx(7e-3, rel=1e-9)
    for setting in ("auto", "true", "false"):
        world = f"""<mujoco><compiler inertiafromgeom='{setting}' boundmass='1e-4' boundinertia='1e-9'/><worldbody>
            <body name='b'><freejoint/><inertial mass='1' pos='0 0 0' diaginertia='1 1 1'/>
            <geom type='sphere' size='0.1' mass='1'/></body></worldbody></mujoco>"""
        body = with_pad(world, bumped, body="b").compile().body("p_pad")
        assert body.mass[0] == pytest.approx(7e-3, rel=1e-8), setting
        if setting == "true" and not layout.is_grid:
            np.testing.assert_allclose(body.inertia, inertia[0], rtol=1e-7)


# sensors


def test_embedded_sensors_have_three_values_a_taxel():
    model, _ = compiled(Pad(PAPER, sensors="contact"))
    assert {int(kind) for kind in model.sensor_type} == {int(mujoco.mjtSensor.mjSENS_CONTACT)}
    assert model.sensor("pad_force_11_9").id == model.nsensor - 1 == 119
    model, pads = compiled(Pad(POOLED, sensors="touch_grid"))
    assert (model.nsensor, model.nsensordata) == (1, 90)
    assert pads.layout.pitch == pytest.approx(POOLED.pitch)
    assert pads.layout.is_grid


# bad input


def heights(shape=(6, 5), value=1e-3):
    values = np.full(shape, 1e-3)
    values.flat[-1:] = value
    return values


BAD = [
    *(({name: v}, f"pad's {name} must be positive") for name in ("thickness", "base", "mass") for v in (0, -1e-3)),
    *(({name: np.nan}, f"pad's {name} must be positive and finite") for name in ("thickness", "base", "mass")),
    ({"mass": np.inf}, "pad's mass must be positive and finite"),
    *(({"thickness": v}, "thickness must lie between 1e-05 and 1 m") for v in (1e-300, 5e-6, 1.5, 1e300)),
    *(({"heights": heights(s)}, r"shape \(.*6, 5\), got") for s in ((5, 6), (30,), (6,), (), (2, 6, 5), (1, 6, 5))),
    *(({"heights": heights(value=v)}, "heights must be positive and finite") for v in (0, -1e-4, np.nan, np.inf)),
    *(({"contype": a, "conaffinity": b}, "pads would meet each other") for a, b in ((1, 1), (6, 4), (3, 2))),
    ({"sensors": "touch"}, "'contact', 'touch_grid' or None, got 'touch'"),
    *(({"layout": TaxelLayout(3, 2, (1e-3, v))}, "pitch must lie between 1e-05 and 1 m") for v in (1e-300, 5e-6)),
    ({"layout": TaxelLayout(300, 200, 1e-3)}, "at most 40000 taxels, got 300x200"),
    *(({"name": name}, "pad's name must be text that XML can hold") for name in ("\udcff", "a\0b", "a\x1b")),
    ({"name": ""}, "name"),
]


def test_pads_that_cannot_be():
    for arguments, message in BAD:
        with pytest.raises(InvalidValueError, match=message):
            Pad(**{"layout": POOLED} | arguments)
    with pytest.raises(InvalidValueError, match="mount's name must be text that XML can hold"):
        paxisim.Mount("hand", name="a\0b")


def test_a_name_that_xml_must_escape():
    model, pads = compiled(Pad(TaxelLayout(1, 2, 2e-3), name='left <&"> pad/1'))
    assert pads.names == ('left <&"> pad/1',)
    assert model.body(pads.names[0]).id == pads.bodies[0]
