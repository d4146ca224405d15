"""Finding pads in a compiled model, and changing their surface in place."""

import mujoco
import numpy as np
import pytest
import trimesh
from scenes import POOLED, with_pad

from paxisim import InvalidValueError, Pad, Pads, TactileReadout, TaxelLayout, conform, find_pads, flat, set_surface

SMALL = TaxelLayout(2, 3, (3e-3, 4e-3))


def bodies_with(**pads) -> mujoco.MjSpec:
    """Return free bodies in alphabetical order that each carry a pad, put on in the order given."""
    inner = "".join(f"<body name='{name}'><freejoint/></body>" for name in sorted(pads))
    spec = mujoco.MjSpec.from_string(f"<mujoco><worldbody>{inner}</worldbody></mujoco>")
    for name, pad in pads.items():
        with_pad(spec, pad, body=name, prefix=f"{name}_", pos=(0.1, 0.2, 0.3), quat=(0.1, 0.7, 0.3, 0.2))
    return spec


# find_pads


def test_pads_count_in_the_order_of_their_bodies_or_as_named():
    model = bodies_with(c=Pad(SMALL), a=Pad(SMALL), b=Pad(SMALL)).compile()
    pads = find_pads(model)
    assert pads.names == ("a_pad", "b_pad", "c_pad")
    assert len(pads) == 3
    assert pads.shape == (3, 3, 2, 3)
    for pad, name in enumerate(pads.names):
        assert model.body(int(pads.bodies[pad])).name == name
        assert [model.geom(int(geom)).name for geom in pads.geoms[pad]] == [
            f"{name}_taxel_{taxel // 3}_{taxel % 3}" for taxel in range(6)
        ]
    assert pads.layout == pads.layouts[2] == SMALL
    assert find_pads(model, names=["c_pad", "a_pad"]).names == ("c_pad", "a_pad")
    assert find_pads(model, prefix="b_").names == find_pads(model, prefix="b_", names=("b_pad",)).names == ("b_pad",)
    with pytest.raises(InvalidValueError, match="no pad 'd_pad' in the model; its pads: a_pad, b_pad, c_pad"):
        find_pads(model, names=["a_pad", "d_pad"])
    with pytest.raises(InvalidValueError, match="no pads whose name begins with 'x_'"):
        find_pads(model, prefix="x_")


def test_pads_of_different_shapes_are_found_one_shape_at_a_time():
    layouts = (TaxelLayout(2, 3, 2e-3), TaxelLayout(3, 2, 2e-3), TaxelLayout(4, 4, 2e-3))
    model = bodies_with(**{name: Pad(layout) for name, layout in zip("abc", layouts, strict=True)}).compile()
    with pytest.raises(InvalidValueError, match=r"different shapes .*a_pad 2x3, b_pad 3x2.*: name those wanted"):
        find_pads(model, names=["a_pad", "b_pad"])  # the same number of taxels
    with pytest.raises(InvalidValueError, match=r"a_pad 2x3, b_pad 3x2, c_pad 4x4"):
        find_pads(model)
    assert find_pads(model, names=["c_pad"]).shape == (1, 3, 4, 4)
    with pytest.raises(InvalidValueError, match="different shapes"):
        Pads(("a", "b"), layouts[:2], (1e-3, 1e-3), np.arange(2), np.zeros((2, 6), dtype=int))


def test_models_without_whole_pads():
    look_alikes = "<mujoco><worldbody><geom name='my_taxel_0_0' size='1'/><geom size='1'/></worldbody></mujoco>"
    with pytest.raises(InvalidValueError, match="the model has no pads; make one with"):
        find_pads(mujoco.MjModel.from_xml_string(look_alikes))
    spec = mujoco.MjSpec.from_string(Pad(SMALL).to_xml())
    spec.delete(spec.geom("pad_taxel_0_2"))
    with pytest.raises(InvalidValueError, match="pad 'pad' has no taxel at row 0, column 2 of 2x3"):
        find_pads(spec.compile())


def test_pads_are_found_again_in_a_saved_model_each_with_its_own_layout(tmp_path):
    layout = TaxelLayout(2, 3, (3e-3, 4e-3), vendor_order=(3, 0, 5, 1, 2, 4))
    curved = TaxelLayout(2, 3, (3e-3, 4e-3), layout.positions + [0, 0, 1e-4], layout.normals, layout.vendor_order)
    heights = np.linspace(0.5e-3, 2e-3, 6).reshape(2, 3)
    spec = bodies_with(a=Pad(layout, heights=heights, thickness=2e-3), b=Pad(curved), c=Pad(TaxelLayout(2, 3, 5e-3)))
    before = find_pads(spec.compile())
    assert before.layouts[0] == layout
    assert [own.vendor_order for own in before.layouts] == [layout.vendor_order] * 2 + [None]
    assert before.layouts[2] == TaxelLayout(2, 3, 5e-3)
    assert before.thickness == pytest.approx((2e-3, 1e-3, 1e-3))
    mujoco.mj_saveModel(spec.compile(), str(tmp_path / "saved.mjb"), None)
    for model in (
        mujoco.MjModel.from_xml_string(spec.to_xml()),
        mujoco.MjModel.from_binary_path(str(tmp_path / "saved.mjb")),
    ):
        after = find_pads(model)
        assert after.names == before.names
        np.testing.assert_array_equal(after.geoms, before.geoms)
        assert after.layouts == before.layouts
        assert after.thickness == pytest.approx(before.thickness)


# set_surface gives the same model as a fresh compile

QUATS = [(0.3, -0.7, 0.5, 0.4), (0.9, 0.1, 0.4, -0.1)]
GRID = TaxelLayout(4, 3, (4e-3, 5e-3))


def dome_layout():
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=12e-3)
    sphere.apply_translation([0, 0, 12e-3])
    return conform(GRID, sphere)


DOME = dome_layout()
both = pytest.mark.parametrize("layout", [GRID, DOME], ids=["grid", "curved"])


def scene(layout, heights=(None, None), *, options="", thickness=4e-3, turned=False):
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
        pad = Pad(layout, thickness=thickness, heights=height)
        with_pad(spec, pad, body=body, prefix=f"{body}_", pos=(0.004, -0.003, 0.001), quat=QUATS[0])
        if turned:
            spec.body(f"{body}_pad").iquat = QUATS[1]
    return spec.compile()


def turned_data(model, gap=0.0):
    """Return data with the bodies turned and the plates moved with them, `gap` metres away from the pads."""
    data = mujoco.MjData(model)
    for body, plate in (("a", "plate_a"), ("b", "plate_b")):
        joint = model.body(body).jntadr[0]
        address = model.jnt_qposadr[joint] + (3 if body == "b" else 0)
        data.qpos[address : address + 4] = QUATS[1]
        mujoco.mj_kinematics(model, data)
        pad = model.body(f"{body}_pad").id
        address = model.jnt_qposadr[model.body(plate).jntadr[0]]
        data.qpos[address : address + 3] = data.xpos[pad] - gap * data.xmat[pad].reshape(3, 3)[:, 2]
        data.qpos[address + 3 : address + 7] = data.xquat[pad]
    mujoco.mj_forward(model, data)
    return data


def assert_as_fresh(changed, fresh):
    """Check that the models and the forces of their pads are the same."""
    for name in ("geom_pos", "geom_size", "geom_aabb", "geom_rbound", "geom_quat", "body_pos"):
        np.testing.assert_allclose(getattr(changed, name), getattr(fresh, name), atol=1e-9, err_msg=name)
    for name in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
        np.testing.assert_allclose(getattr(changed, name), getattr(fresh, name), atol=1e-9, err_msg=name)
    # the root box of each body's bounding-volume tree
    roots = ([m.bvh_aabb[m.body_bvhadr[b]] for b in range(m.nbody) if m.body_bvhnum[b]] for m in (changed, fresh))
    np.testing.assert_allclose(*map(np.array, roots), atol=1e-8)
    one, two = turned_data(changed), turned_data(fresh)
    assert one.ncon == two.ncon > 0
    np.testing.assert_array_equal(one.contact.geom, two.contact.geom)
    np.testing.assert_allclose(one.contact.dist, two.contact.dist, atol=1e-8)
    forces = [TactileReadout(m, find_pads(m)).read_exact(d) for m, d in ((changed, one), (fresh, two))]
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-4, atol=1e-5)
    assert np.abs(forces[0]).sum() > 0.01


def check_leaves(model):
    """Check that every box of the bounding-volume trees contains the boxes below it."""
    for body in range(model.nbody):
        start, count = model.body_bvhadr[body], model.body_bvhnum[body]
        for node in range(start, start + count):
            for child in model.bvh_child[node]:
                if child >= 0:
                    parent, below = model.bvh_aabb[node], model.bvh_aabb[start + child]
                    assert np.all(np.abs(below[:3] - parent[:3]) + below[3:] <= parent[3:] + 1e-9)


def random_heights(layout, seed):
    return np.random.default_rng(seed).uniform(1e-3, 7e-3, (2, layout.rows, layout.cols))


@pytest.mark.parametrize("layout", [GRID, DOME, TaxelLayout(1, 1, (4e-3, 4e-3))], ids=["grid", "curved", "single"])
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"options": "<option cone='pyramidal'/>"},
        {"turned": True},  # the boxes of a bounding-volume tree lie in the frame of the inertia
        {"options": "<compiler inertiafromgeom='true'/>"},
    ],
    ids=["elliptic", "pyramidal", "turned inertia", "inertia of geoms"],
)
def test_raised_and_lowered_by_3_mm_it_is_as_freshly_compiled(layout, options):
    heights = random_heights(layout, seed=5)
    changed = scene(layout, **options)
    pads = find_pads(changed)
    set_surface(changed, pads, heights)
    assert_as_fresh(changed, scene(layout, heights, **options))
    check_leaves(changed)
    after = find_pads(changed)
    np.testing.assert_array_equal(after.geoms, pads.geoms)
    np.testing.assert_allclose(after.layout.positions, pads.layout.positions, atol=1e-9)
    assert after.layout.is_grid == layout.is_grid
    assert after.thickness == pytest.approx(pads.thickness)
    # one surface for all pads, then another for one of them
    set_surface(changed, after, heights[0])
    assert_as_fresh(changed, scene(layout, [heights[0], heights[0]], **options))
    set_surface(changed, find_pads(changed, names=["b_pad"]), heights[1:])
    assert_as_fresh(changed, scene(layout, heights, **options))


def test_moving_the_geoms_alone_loses_contacts():
    """`set_surface` exists to avoid this trap; this test fails if MuJoCo ever fixes it."""
    heights = np.full((2, 4, 3), 7e-3)
    naive, changed, fresh = scene(GRID), scene(GRID), scene(GRID, heights)
    pads = find_pads(naive)
    naive.geom_pos[pads.geoms.reshape(-1), 2] -= 1.5e-3
    naive.geom_size[pads.geoms.reshape(-1), 2] += 1.5e-3
    np.testing.assert_allclose(naive.geom_pos, fresh.geom_pos, atol=1e-9)
    set_surface(changed, find_pads(changed), heights)
    # plates 0.3 mm deep in the raised surface, out of reach of the compiled one
    contacts = [turned_data(model, gap=3.2e-3).ncon for model in (naive, changed, fresh)]
    assert contacts[0] < 2 * 12 * 4
    assert contacts[1:] == [2 * 12 * 4] * 2


CHANGED = ("geom_pos", "geom_size", "geom_aabb", "geom_rbound", "bvh_aabb")


@both
def test_many_episodes_do_not_drift_and_nothing_else_changes(layout):
    model, again = scene(layout), scene(layout)
    pads = find_pads(model)
    rng = np.random.default_rng(0)
    for _ in range(100):
        set_surface(model, pads, rng.uniform(0.5e-3, 8e-3, (2, layout.rows, layout.cols)))
    others = np.setdiff1d(np.arange(model.ngeom), pads.geoms)
    for name in CHANGED[:4]:
        np.testing.assert_array_equal(getattr(model, name)[others], getattr(again, name)[others], err_msg=name)
    set_surface(model, pads, flat(layout, 4e-3))
    set_surface(again, pads, flat(layout, 4e-3))
    for name in dir(model):
        value = getattr(model, name)
        if isinstance(value, np.ndarray):
            tolerance = 1e-12 if name in CHANGED else 0
            np.testing.assert_allclose(value, getattr(again, name), rtol=0, atol=tolerance, err_msg=name)


def test_bad_heights_change_nothing():
    model = scene(POOLED)
    before = {name: getattr(model, name).copy() for name in CHANGED}
    cases = [
        (np.full((5, 6), 1e-3), r"heights must have shape \(\.\.\., 6, 5\), got \(5, 6\)"),
        (np.full((3, 6, 5), 1e-3), r"heights must have shape \(2, 6, 5\) or \(6, 5\), got \(3, 6, 5\)"),
        (np.full((1, 6, 5), 1e-3), r"got \(1, 6, 5\)"),
        (np.full((1, 2, 6, 5), 1e-3), r"got \(1, 2, 6, 5\)"),
        (1e-3, r"got \(\)"),
        *((np.full((6, 5), value), "positive and finite") for value in (np.nan, 0, -1e-3)),
    ]
    for heights, message in cases:
        with pytest.raises(InvalidValueError, match=message):
            set_surface(model, find_pads(model), heights)
    for name, value in before.items():
        np.testing.assert_array_equal(getattr(model, name), value)
