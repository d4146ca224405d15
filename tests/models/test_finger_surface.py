"""A pad on a curved finger: from the gripper's geoms to a layout to forces."""

import mujoco
import numpy as np
import pytest
import trimesh

import paxisim

ROUND_FINGER = """
<mujoco>
  <worldbody>
    <body name="finger" pos="0.1 0.2 0.3" quat="0.6 0.8 0 0">
      <geom name="link" type="box" size="0.01 0.01 0.02" pos="0 0 0.05"/>
      <geom name="tip" type="capsule" size="0.012 0.02"/>
      <geom type="sphere" size="0.004" pos="0 0 0.08"/>
    </body>
  </worldbody>
</mujoco>
"""
# the pad faces along the finger's x axis, and its rows run along the capsule
MOUNT = paxisim.Mount("finger", pos=(0.012, 0, 0), quat=(0.5, -0.5, -0.5, 0.5), replaces=("tip",))
MOUNT_2 = paxisim.Mount("finger", pos=(-0.012, 0, 0), quat=(0.5, -0.5, 0.5, -0.5), replaces=("tip",), name="second")
GRID = paxisim.TaxelLayout(5, 4, 0.004)


def test_the_pad_reads_what_presses_on_it():
    layout = paxisim.conform(GRID, paxisim.finger_surface(ROUND_FINGER, MOUNT))
    finger = paxisim.attach(ROUND_FINGER, layout, [MOUNT])
    world = mujoco.MjSpec.from_string(
        "<mujoco><option gravity='0 0 0' cone='elliptic'/><worldbody><site name='here'/>"
        "<body name='plate'><joint type='slide' axis='0 0 1'/>"
        "<geom type='box' size='0.03 0.03 0.005' mass='0.2'/></body></worldbody></mujoco>"
    )
    world.attach(finger.spec, frame=world.worldbody.add_frame(), prefix="f/")
    model = world.compile()
    # point the finger's x axis up, below the plate
    model.body_pos[model.body("f/finger").id] = 0
    model.body_quat[model.body("f/finger").id] = [0.5**0.5, 0, -(0.5**0.5), 0]
    model.body_pos[model.body("plate").id] = [0, 0, 0.0175]
    pads = finger.bind(model, "f/")
    data = mujoco.MjData(model)
    data.xfrc_applied[model.body("plate").id, 2] = -3
    mujoco.mj_step(model, data, 1500)
    force = paxisim.TactileReadout(model, pads).read(data)
    assert np.abs(data.qvel).max() < 1e-6
    assert force[0].sum(axis=(1, 2)) == pytest.approx([0, 0, 3], abs=0.03)
    assert force[0, 2, :, 1:3].min() > 5 * force[0, 2, :, [0, 3]].max()
    assert (force[0, 2] > 0.05).sum() >= 5


def test_meshes_are_taken_as_they_are_not_as_hulls(tmp_path):
    saddle = trimesh.creation.torus(0.02, 0.008)
    saddle.export(tmp_path / "torus.stl")
    (tmp_path / "finger.xml").write_text(
        "<mujoco><asset><mesh name='torus' file='torus.stl'/></asset><worldbody><body name='finger'>"
        "<geom name='ring' type='mesh' mesh='torus'/></body></worldbody></mujoco>"
    )
    mount = paxisim.Mount("finger", replaces=("ring",))
    surface = paxisim.finger_surface(tmp_path / "finger.xml", mount)
    assert surface.volume == pytest.approx(saddle.volume, rel=1e-3)
    with pytest.raises(paxisim.InvalidValueError, match="miss the mesh"):
        paxisim.conform(paxisim.TaxelLayout(1, 1, 0.001), surface)  # the ring's hole


def test_geoms_by_name_or_index_and_what_is_not_there():
    by_index = paxisim.finger_surface(ROUND_FINGER, paxisim.Mount("finger", replaces=(2,)))
    assert by_index.extents == pytest.approx([0.008] * 3, rel=0.01)
    # indices count as in the file, whatever the compiler leaves out
    discarded = ROUND_FINGER.replace('name="link"', 'name="link" contype="0" conaffinity="0"')
    discarded = discarded.replace("<worldbody>", '<compiler discardvisual="true"/><worldbody>')
    for text, replaces in ((ROUND_FINGER, ("finger/2",)), (discarded, (2,))):
        found = paxisim.finger_surface(text, paxisim.Mount("finger", replaces=replaces))
        np.testing.assert_array_equal(found.vertices, by_index.vertices)
    for body, replaces, error, message in (
        ("fingr", ("tip",), paxisim.UnknownNameError, "did you mean 'finger'"),
        ("finger", ("tipp",), paxisim.UnknownNameError, "did you mean 'tip'"),
        ("finger", (7,), paxisim.InvalidValueError, "no geom 7"),
        ("finger", ("finger/3",), paxisim.InvalidValueError, "has 3 geoms, there is no geom 3: the last is 2"),
        ("finger", (), paxisim.InvalidValueError, "replaces no geom"),
    ):
        with pytest.raises(error, match=message):
            paxisim.finger_surface(ROUND_FINGER, paxisim.Mount(body, replaces=replaces))


def test_attach_lays_pads_onto_curved_fingers_alone():
    flat = paxisim.Mount("finger", pos=(0.01, 0, 0.05), quat=MOUNT.quat, replaces=("link",), name="side")
    finger = paxisim.attach(ROUND_FINGER, GRID, [MOUNT, flat], conform=True)
    round_, side = finger.bind(finger.compile()).layouts
    expected = paxisim.conform(GRID, paxisim.finger_surface(ROUND_FINGER, MOUNT))
    np.testing.assert_allclose(round_.positions, expected.positions, atol=1e-6)
    np.testing.assert_allclose(round_.normals, expected.normals, atol=1e-4)
    assert side == GRID
    assert finger.report.splitlines() == [
        "pad finger on finger: taxels within 0.0..0.0 mm of the skin, in place of geom tip",
        "pad side on finger: taxels within 0.0..0.0 mm of the skin, in place of geom link",
    ]
    assert paxisim.attach(ROUND_FINGER, GRID, [MOUNT]).report == ""


def test_pads_that_cannot_be_laid_are_named_with_the_reason():
    beside = paxisim.Mount("finger", pos=(0.01, 0.03, 0.05), quat=MOUNT.quat, replaces=("link",), name="beside")
    bare = paxisim.Mount("finger", pos=(0.01, 0, 0.05), quat=MOUNT.quat, name="bare")
    wide = paxisim.TaxelLayout(5, 4, (0.004, 0.0078))
    with pytest.raises(paxisim.InvalidValueError) as refused:
        paxisim.attach(ROUND_FINGER, [GRID, GRID, wide, GRID], [MOUNT, beside, MOUNT_2, bare], conform=True)
    message = str(refused.value)
    assert message.startswith("3 of 4 pads cannot be laid onto their fingers (beside: 20 of 20 taxels miss the mesh")
    assert "second: the surface at row" in message
    assert "bare: the mount on 'finger' replaces no geom" in message
    steps = ((-5e-3, 0, 5e-3), (5e-3, 0, 25e-3))
    stairs = [trimesh.creation.box([0.01, 0.05, 0.01]).apply_translation(at) for at in steps]
    with pytest.raises(paxisim.InvalidValueError, match=r"steps by 20.0 mm from the taxel at row 0, column 1"):
        paxisim.conform(GRID, trimesh.util.concatenate(stairs))
    curved = paxisim.conform(GRID, paxisim.finger_surface(ROUND_FINGER, MOUNT))
    with pytest.raises(paxisim.InvalidValueError, match="only a flat grid can be laid"):
        paxisim.attach(ROUND_FINGER, curved, [MOUNT], conform=True)


def test_a_pad_for_each_mount():
    pads = [paxisim.Pad(GRID, mass=0.001), paxisim.Pad(GRID, mass=0.002)]
    finger = paxisim.attach(ROUND_FINGER, pads, [MOUNT, MOUNT_2])
    model = finger.compile()
    assert [model.body(name).mass[0] for name in finger.pad_names] == pytest.approx([0.001, 0.002])
    for wrong, why in [
        ([GRID], "a pad for each of 2 mounts, got 1"),
        ([GRID, paxisim.TaxelLayout(4, 5, 0.004)], "different taxels .5x4 and 4x5"),
        ([GRID, paxisim.TaxelLayout(5, 4, 0.004, vendor_order=tuple(range(19, -1, -1)))], "different taxels"),
        ([GRID, paxisim.Pad(GRID, gel=paxisim.Gel(modulus=2e5))], "the same gel, but that on 'second' differs"),
    ]:
        with pytest.raises(paxisim.InvalidValueError, match=why):
            paxisim.attach(ROUND_FINGER, wrong, [MOUNT, MOUNT_2])


def test_the_distance_from_the_skin_has_the_sign_of_its_side():
    radius = np.hypot(GRID.positions[:, 0], 0.012)  # the flat pad touches the capsule along its middle
    np.testing.assert_allclose(paxisim.skin_distance(ROUND_FINGER, MOUNT, GRID), radius - 0.012, atol=5e-5)
    under = paxisim.Mount("finger", pos=(0.010, 0, 0), quat=MOUNT.quat, replaces=("tip",))
    narrow = paxisim.TaxelLayout(5, 1, 0.004)
    np.testing.assert_allclose(paxisim.skin_distance(ROUND_FINGER, under, narrow), -0.002, atol=5e-5)
    # a mount that replaces nothing has the geoms of its finger as skin, here the link above the capsule
    above = paxisim.Mount("finger", pos=(0.015, 0, 0.05), quat=MOUNT.quat)
    np.testing.assert_allclose(paxisim.skin_distance(ROUND_FINGER, above, narrow), 0.005, atol=1e-9)
    with pytest.raises(paxisim.InvalidValueError, match="no geom with a surface"):
        paxisim.skin_distance(
            "<mujoco><worldbody><body name='bare'/></worldbody></mujoco>", paxisim.Mount("bare"), GRID
        )
