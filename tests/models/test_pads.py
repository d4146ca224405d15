"""Finding pads in a compiled model, and changing their surface in place."""

import mujoco
import numpy as np
import pytest
import trimesh
from scenes import POOLED, compiled, set_options

from paxisim.bump import GaussianBump
from paxisim.errors import InvalidValueError
from paxisim.layout import TaxelLayout
from paxisim.models.pad import Pad
from paxisim.models.pads import Pads, find_pads, set_surface
from paxisim.models.readout import TactileReadout
from paxisim.models.surface import conform, flat

SMALL = TaxelLayout(2, 3, (3e-3, 4e-3))


def place(spec, pad, body, name, pos=(0, 0, 0), quat=(1, 0, 0, 0)):
    frame = spec.body(body).add_frame(pos=pos, quat=quat)
    frame.attach_body(mujoco.MjSpec.from_string(pad.to_xml()).body(pad.name), f"{name}_", "")


def empty(*bodies, options=""):
    inner = "".join(f"<body name='{b}' pos='{i} 0 0'><freejoint/></body>" for i, b in enumerate(bodies))
    return mujoco.MjSpec.from_string(f"<mujoco>{options}<worldbody>{inner}</worldbody></mujoco>")


# find_pads


def test_pads_count_in_the_order_of_their_bodies():
    spec = empty("first", "second", "third")
    for body, name in [("third", "a"), ("first", "z"), ("second", "m")]:
        place(spec, Pad(SMALL), body, name)
    model = spec.compile()
    pads = find_pads(model)
    assert pads.names == ("z_pad", "m_pad", "a_pad")
    assert len(pads) == 3
    assert pads.shape == (3, 3, 2, 3)
    assert pads.geoms.shape == (3, 6)
    for pad in range(3):
        assert model.body(int(pads.bodies[pad])).name == pads.names[pad]
        for taxel, geom in enumerate(pads.geoms[pad]):
            assert model.geom(int(geom)).name == f"{pads.names[pad]}_taxel_{taxel // 3}_{taxel % 3}"
    assert pads.layout == pads.layouts[2] == SMALL


def test_more_than_ten_rows_and_columns_keep_their_order():
    layout = TaxelLayout(11, 12, 2e-3)
    model, pads = compiled(Pad(layout))
    np.testing.assert_array_equal(np.diff(pads.geoms[0]), 1)
    assert model.geom(int(pads.geoms[0, 119])).name == "pad_taxel_9_11"


def test_only_the_pads_that_were_named_in_that_order():
    spec = empty("a", "b", "c")
    for name in "abc":
        place(spec, Pad(SMALL), name, name)
    model = spec.compile()
    assert find_pads(model, names=["c_pad", "a_pad"]).names == ("c_pad", "a_pad")
    assert find_pads(model, prefix="b_").names == ("b_pad",)
    assert find_pads(model, prefix="b_", names=("b_pad",)).names == ("b_pad",)
    with pytest.raises(InvalidValueError, match="no pad 'd_pad' in the model; its pads: a_pad, b_pad, c_pad"):
        find_pads(model, names=["a_pad", "d_pad"])
    with pytest.raises(InvalidValueError, match="the model has no pads whose name begins with 'x_'"):
        find_pads(model, prefix="x_")


def test_pads_of_different_shapes_are_found_one_shape_at_a_time():
    spec = empty("a", "b", "c")
    place(spec, Pad(TaxelLayout(2, 3, 2e-3)), "a", "a")
    place(spec, Pad(TaxelLayout(3, 2, 2e-3)), "b", "b")  # the same number of taxels
    place(spec, Pad(TaxelLayout(4, 4, 2e-3)), "c", "c")
    model = spec.compile()
    message = "different shapes do not fit one tensor .*a_pad 2x3, b_pad 3x2.*: name those wanted"
    with pytest.raises(InvalidValueError, match=message):
        find_pads(model, names=["a_pad", "b_pad"])
    with pytest.raises(InvalidValueError, match=r"a_pad 2x3, b_pad 3x2, c_pad 4x4"):
        find_pads(model)
    assert find_pads(model, names=["c_pad"]).shape == (1, 3, 4, 4)


def test_pads_of_one_shape_may_have_layouts_of_their_own():
    spec = empty("a", "b")
    place(spec, Pad(SMALL, thickness=2e-3), "a", "a")
    place(spec, Pad(TaxelLayout(2, 3, 5e-3)), "b", "b")
    pads = find_pads(spec.compile())
    assert pads.layouts == (SMALL, TaxelLayout(2, 3, 5e-3))
    assert pads.thickness == pytest.approx((2e-3, 1e-3))


def test_a_model_without_pads_and_one_with_look_alikes():
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom name='my_taxel_0_0' size='1'/><geom size='1'/></worldbody></mujoco>"
    )
    with pytest.raises(InvalidValueError, match="the model has no pads; make one with"):
        find_pads(model)


def test_a_pad_that_lost_a_taxel():
    spec = mujoco.MjSpec.from_string(Pad(SMALL).to_xml())
    spec.delete(spec.geom("pad_taxel_0_2"))
    with pytest.raises(InvalidValueError, match="pad 'pad' has no taxel at row 0, column 2 of 2x3"):
        find_pads(spec.compile())


def test_pads_are_found_again_in_a_saved_model(tmp_path):
    spec = empty("a", "b")
    heights = np.linspace(0.5e-3, 2e-3, 30).reshape(6, 5)
    place(spec, Pad(POOLED, heights=heights), "b", "b", (0.1, 0.2, 0.3), (0.1, 0.7, 0.3, 0.2))
    place(spec, Pad(POOLED), "a", "a")
    before = find_pads(spec.compile())
    (tmp_path / "saved.xml").write_text(spec.to_xml())
    mujoco.mj_saveModel(spec.compile(), str(tmp_path / "saved.mjb"), None)
    for model in (
        mujoco.MjModel.from_xml_path(str(tmp_path / "saved.xml")),
        mujoco.MjModel.from_binary_path(str(tmp_path / "saved.mjb")),
    ):
        after = find_pads(model)
        assert after.names == before.names == ("a_pad", "b_pad")
        np.testing.assert_array_equal(after.geoms, before.geoms)
        assert after.layouts == before.layouts
        assert after.thickness == pytest.approx(before.thickness)


def test_the_vendors_order_is_found_again(tmp_path):
    layout = TaxelLayout(2, 3, (3e-3, 4e-3), vendor_order=(3, 0, 5, 1, 2, 4))
    curved = TaxelLayout(2, 3, (3e-3, 4e-3), layout.positions + [0, 0, 1e-4], layout.normals, layout.vendor_order)
    spec = empty("first", "second")
    place(spec, Pad(layout), "first", "a")
    place(spec, Pad(curved), "second", "b")
    spec.compile()
    (tmp_path / "a.xml").write_text(spec.to_xml())
    pads = find_pads(mujoco.MjModel.from_xml_path(str(tmp_path / "a.xml")))
    assert [own.vendor_order for own in pads.layouts] == [layout.vendor_order] * 2


def test_two_handles_that_differ_in_shape_cannot_be_made():
    geoms = np.zeros((2, 6), dtype=int)
    layouts = (SMALL, TaxelLayout(3, 2, 2e-3))
    with pytest.raises(InvalidValueError, match="different shapes"):
        Pads(names=("a", "b"), layouts=layouts, thickness=(1e-3, 1e-3), bodies=np.arange(2), geoms=geoms)


# set_surface gives the same model as a fresh compile

QUATS = [(0.3, -0.7, 0.5, 0.4), (0.9, 0.1, 0.4, -0.1)]


def dome_layout(rows=4, cols=3):
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=12e-3)
    sphere.apply_translation([0, 0, 12e-3])
    return conform(TaxelLayout(rows, cols, (4e-3, 5e-3)), sphere)


def scene(layout, heights, *, options="", thickness=4e-3, turned=False):
    """Compile a model of two pads on movable bodies, each with a plate that indents it."""
    plate = "<geom type='box' size='0.03 0.03 0.005' pos='0 0 -0.0045'/>"
    spec = mujoco.MjSpec.from_string(
        f"""<mujoco>{options}<option gravity='0 0 0'/><worldbody>
        <body name='a' pos='0 0 0.2'><joint type='ball'/><geom size='0.01' pos='0 0.1 0' mass='0.1'/></body>
        <body name='b' pos='0.3 0 0'><freejoint/><inertial pos='0.01 0.02 0.03' mass='0.2'
          quat='0.5 0.1 0.7 0.1' diaginertia='1e-3 2e-3 2.5e-3'/></body>
        <body name='plate_a' pos='0 0 0.2'><freejoint/>{plate}</body>
        <body name='plate_b' pos='0.3 0 0'><freejoint/>{plate}</body>
        </worldbody></mujoco>"""
    )
    for body, height in zip("ab", heights, strict=True):
        place(spec, Pad(layout, thickness=thickness, heights=height), body, body, (0.004, -0.003, 0.001), QUATS[0])
        if turned:
            spec.body(f"{body}_pad").iquat = QUATS[1]
    return spec.compile()


def turned_data(model):
    """Return data with the bodies turned and the plates moved with them."""
    data = mujoco.MjData(model)
    for body, plate in (("a", "plate_a"), ("b", "plate_b")):
        mujoco.mj_kinematics(model, data)
        joint = model.body(body).jntadr[0]
        address = model.jnt_qposadr[joint] + (3 if body == "b" else 0)
        data.qpos[address : address + 4] = QUATS[1]
        mujoco.mj_kinematics(model, data)
        pad = model.body(f"{body}_pad").id
        address = model.jnt_qposadr[model.body(plate).jntadr[0]]
        data.qpos[address : address + 3] = data.xpos[pad]
        data.qpos[address + 3 : address + 7] = data.xquat[pad]
    mujoco.mj_forward(model, data)
    return data


def roots(model):
    """Return the root box of each body's bounding-volume tree."""
    return np.array([model.bvh_aabb[model.body_bvhadr[b]] for b in range(model.nbody) if model.body_bvhnum[b]])


def assert_as_fresh(changed, fresh):
    np.testing.assert_allclose(changed.geom_pos, fresh.geom_pos, atol=1e-9)
    np.testing.assert_allclose(changed.geom_size, fresh.geom_size, atol=1e-9)
    np.testing.assert_allclose(changed.geom_aabb, fresh.geom_aabb, atol=1e-9)
    np.testing.assert_allclose(changed.geom_rbound, fresh.geom_rbound, atol=1e-9)
    np.testing.assert_allclose(roots(changed), roots(fresh), atol=1e-8)
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "geom_quat", "body_pos"):
        np.testing.assert_allclose(getattr(changed, name), getattr(fresh, name), atol=1e-9, err_msg=name)
    one, two = turned_data(changed), turned_data(fresh)
    assert one.ncon == two.ncon
    assert one.ncon > 0 or changed.ngeom < 10, "a single taxel may have been lowered out of reach"
    np.testing.assert_array_equal(one.contact.geom, two.contact.geom)
    np.testing.assert_allclose(one.contact.dist, two.contact.dist, atol=1e-8)
    np.testing.assert_allclose(one.contact.pos, two.contact.pos, atol=1e-8)
    np.testing.assert_allclose(one.contact.frame, two.contact.frame, atol=1e-7)
    forces = [TactileReadout(m, find_pads(m)).read_exact(d) for m, d in ((changed, one), (fresh, two))]
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-4, atol=1e-5)
    assert np.abs(forces[0]).sum() > 0.01 or one.ncon == 0


def check_leaves(model):
    """Check that every box of the bounding-volume trees contains the boxes below it."""
    for body in range(model.nbody):
        start, count = model.body_bvhadr[body], model.body_bvhnum[body]
        for node in range(start, start + count):
            for child in model.bvh_child[node]:
                if child >= 0:
                    parent, below = model.bvh_aabb[node], model.bvh_aabb[start + child]
                    assert np.all(np.abs(below[:3] - parent[:3]) + below[3:] <= parent[3:] + 1e-9)


def random_heights(layout, seed, low=1e-3, high=7e-3):
    return np.random.default_rng(seed).uniform(low, high, (2, layout.rows, layout.cols))


@pytest.mark.parametrize("layout", [TaxelLayout(4, 3, (4e-3, 5e-3)), dome_layout(), TaxelLayout(1, 1, 4e-3)])
@pytest.mark.parametrize("cone", ["elliptic", "pyramidal"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_raised_and_lowered_by_3_mm_it_is_as_freshly_compiled(layout, cone, seed):
    heights = random_heights(layout, seed)
    options = f"<option cone='{cone}'/>"
    changed = scene(layout, [None, None], options=options)
    set_surface(changed, find_pads(changed), heights)
    assert_as_fresh(changed, scene(layout, heights, options=options))
    check_leaves(changed)


@pytest.mark.parametrize("layout", [TaxelLayout(4, 3, (4e-3, 5e-3)), dome_layout()], ids=["grid", "curved"])
def test_also_where_the_frame_of_the_inertia_is_turned(layout):
    """The boxes of a bounding-volume tree lie in the frame of the inertia."""
    heights = random_heights(layout, 5)
    changed = scene(layout, [None, None], turned=True)
    assert abs(changed.body("a_pad").iquat[0]) < 0.95
    set_surface(changed, find_pads(changed), heights)
    assert_as_fresh(changed, scene(layout, heights, turned=True))
    check_leaves(changed)


@pytest.mark.parametrize("layout", [TaxelLayout(4, 3, (4e-3, 5e-3)), dome_layout()], ids=["grid", "curved"])
def test_also_where_the_inertia_is_the_geoms(layout):
    options = "<compiler inertiafromgeom='true'/>"
    heights = random_heights(layout, 5)
    changed = scene(layout, [None, None], options=options)
    set_surface(changed, find_pads(changed), heights)
    assert_as_fresh(changed, scene(layout, heights, options=options))


def test_one_surface_for_all_pads_and_one_for_each():
    layout = TaxelLayout(4, 3, (4e-3, 5e-3))
    heights = random_heights(layout, 3)
    for given, expected in [(heights[0], [heights[0]] * 2), (heights, heights)]:
        model = scene(layout, [None, None])
        set_surface(model, find_pads(model), given)
        assert_as_fresh(model, scene(layout, expected))


def test_a_part_of_the_pads_can_be_changed():
    layout = TaxelLayout(4, 3, (4e-3, 5e-3))
    heights = random_heights(layout, 3)
    model = scene(layout, heights)
    set_surface(model, find_pads(model, names=["b_pad"]), heights[:1])
    assert_as_fresh(model, scene(layout, [heights[0], heights[0]]))


def test_moving_the_geoms_alone_loses_contacts():
    """`set_surface` exists to avoid this trap; this test fails if MuJoCo ever fixes it."""
    layout = TaxelLayout(4, 3, (4e-3, 5e-3))
    heights = np.full((2, 4, 3), 7e-3)
    naive = scene(layout, [None, None])
    pads = find_pads(naive)
    naive.geom_pos[pads.geoms.reshape(-1), 2] -= 1.5e-3
    naive.geom_size[pads.geoms.reshape(-1), 2] += 1.5e-3
    fresh = scene(layout, heights)
    np.testing.assert_allclose(naive.geom_pos, fresh.geom_pos, atol=1e-9)

    def in_front(model, gap):
        data = turned_data(model)
        for plate in ("plate_a", "plate_b"):
            address = model.jnt_qposadr[model.body(plate).jntadr[0]]
            frame = np.zeros(9)
            mujoco.mju_quat2Mat(frame, data.qpos[address + 3 : address + 7])
            data.qpos[address : address + 3] -= gap * frame.reshape(3, 3)[:, 2]
        mujoco.mj_forward(model, data)
        return data.ncon

    gap = 3.2e-3  # plates 0.3 mm deep in the raised surface, out of reach of the compiled one
    assert in_front(fresh, gap) == 2 * 12 * 4
    assert in_front(naive, gap) < 2 * 12 * 4
    changed = scene(layout, [None, None])
    set_surface(changed, find_pads(changed), heights)
    assert in_front(changed, gap) == 2 * 12 * 4


CHANGED = ("geom_pos", "geom_size", "geom_aabb", "geom_rbound", "bvh_aabb")


@pytest.mark.parametrize("layout", [POOLED, dome_layout()], ids=["grid", "curved"])
def test_many_episodes_do_not_drift(layout):
    model = scene(layout, [None, None])
    pads = find_pads(model)
    rng = np.random.default_rng(0)
    set_surface(model, pads, flat(layout, 4e-3))
    before = {name: getattr(model, name).copy() for name in CHANGED}
    for _ in range(300):
        set_surface(model, pads, rng.uniform(0.5e-3, 8e-3, (2, layout.rows, layout.cols)))
    set_surface(model, pads, flat(layout, 4e-3))
    for name, value in before.items():
        np.testing.assert_allclose(getattr(model, name), value, rtol=0, atol=1e-12, err_msg=name)


def test_nothing_else_changes():
    model, again = scene(POOLED, [None, None]), scene(POOLED, [None, None])
    pads = find_pads(model)
    set_surface(model, pads, GaussianBump((1, 1)).heights(POOLED))
    for name in dir(model):
        value = getattr(model, name)
        if isinstance(value, np.ndarray) and name not in CHANGED:
            np.testing.assert_array_equal(value, getattr(again, name), err_msg=name)
    others = np.setdiff1d(np.arange(model.ngeom), pads.geoms)
    for name in ("geom_pos", "geom_size", "geom_aabb", "geom_rbound"):
        np.testing.assert_array_equal(getattr(model, name)[others], getattr(again, name)[others], err_msg=name)


def test_the_handle_found_afterwards_is_the_same():
    for layout in (POOLED, dome_layout()):
        model = scene(layout, [None, None])
        before = find_pads(model)
        set_surface(model, before, random_heights(layout, 1))
        after = find_pads(model)
        np.testing.assert_array_equal(after.geoms, before.geoms)
        np.testing.assert_allclose(after.layout.positions, before.layout.positions, atol=1e-9)
        assert after.layout.is_grid == layout.is_grid
        assert after.thickness == pytest.approx(before.thickness)


def test_taxels_of_a_simulation_under_way():
    """A surface raised between two steps pushes in the next step."""
    pad = Pad(SMALL)
    spec = mujoco.MjSpec.from_string(
        "<mujoco><worldbody><body pos='0 0 -0.012'><joint type='slide' axis='0 0 1'/>"
        "<geom type='box' size='0.02 0.02 0.01' mass='0.2'/></body></worldbody></mujoco>"
    )
    place_on_world = spec.worldbody.add_frame()
    place_on_world.attach_body(mujoco.MjSpec.from_string(pad.to_xml()).body("pad"), "p_", "")
    model = spec.compile()
    set_options(model)
    pads = find_pads(model)
    pad.gel.apply(model, pads)
    data = mujoco.MjData(model)
    readout = TactileReadout(model, pads)
    mujoco.mj_step(model, data)
    assert readout.read(data).sum() == 0
    heights = flat(SMALL)
    heights[1, 2] = 3.5e-3
    set_surface(model, pads, heights)
    mujoco.mj_step(model, data)
    force = readout.read(data)[0, 2]
    assert force[1, 2] > 0
    assert np.count_nonzero(force) == 1


@pytest.mark.parametrize(
    ("heights", "message"),
    [
        (np.full((5, 6), 1e-3), r"heights must have shape \(\.\.\., 6, 5\), got \(5, 6\)"),
        (np.full((3, 6, 5), 1e-3), r"heights must have shape \(2, 6, 5\) or \(6, 5\), got \(3, 6, 5\)"),
        (np.full((1, 6, 5), 1e-3), r"heights must have shape \(2, 6, 5\) or \(6, 5\), got \(1, 6, 5\)"),
        (np.full((1, 2, 6, 5), 1e-3), r"got \(1, 2, 6, 5\)"),
        (1e-3, r"got \(\)"),
        (np.full((6, 5), np.nan), "positive and finite"),
        (np.zeros((6, 5)), "positive and finite"),
        (np.full((6, 5), -1e-3), "positive and finite"),
    ],
)
def test_bad_heights_change_nothing(heights, message):
    model = scene(POOLED, [None, None])
    before = {name: getattr(model, name).copy() for name in CHANGED}
    with pytest.raises(InvalidValueError, match=message):
        set_surface(model, find_pads(model), heights)
    for name, value in before.items():
        np.testing.assert_array_equal(getattr(model, name), value)
