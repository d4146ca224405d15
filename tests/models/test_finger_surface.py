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
GRID = paxisim.TaxelLayout(5, 4, 0.004)


def test_taxels_lie_on_the_capsule_and_look_out_of_it():
    surface = paxisim.finger_surface(ROUND_FINGER, MOUNT)
    layout = paxisim.conform(GRID, surface)
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.array(MOUNT.quat))
    in_finger = layout.positions @ rotation.reshape(3, 3).T + MOUNT.pos
    outward = layout.normals @ rotation.reshape(3, 3).T
    assert np.hypot(in_finger[:, 0], in_finger[:, 1]) == pytest.approx(0.012, abs=5e-5)
    radial = in_finger * [1, 1, 0]
    radial /= np.linalg.norm(radial, axis=1, keepdims=True)
    assert np.sum(radial * outward, axis=1).min() > 0.998


def test_geoms_without_names_count_as_in_the_file():
    text = ROUND_FINGER.replace('name="link"', 'name="link" contype="0" conaffinity="0"')
    mount = paxisim.Mount("finger", replaces=(1,))
    expected = paxisim.finger_surface(text, mount)
    found = paxisim.finger_surface(text.replace("<worldbody>", '<compiler discardvisual="true"/><worldbody>'), mount)
    np.testing.assert_array_equal(found.vertices, expected.vertices)


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


def test_geoms_by_index_and_what_is_not_there():
    by_index = paxisim.finger_surface(ROUND_FINGER, paxisim.Mount("finger", replaces=(2,)))
    assert by_index.extents == pytest.approx([0.008] * 3, rel=0.01)
    by_body = paxisim.finger_surface(ROUND_FINGER, paxisim.Mount("finger", replaces=("finger/2",)))
    np.testing.assert_array_equal(by_body.vertices, by_index.vertices)
    with pytest.raises(paxisim.UnknownNameError, match="did you mean 'finger'"):
        paxisim.finger_surface(ROUND_FINGER, paxisim.Mount("fingr", replaces=("tip",)))
    with pytest.raises(paxisim.UnknownNameError, match="did you mean 'tip'"):
        paxisim.finger_surface(ROUND_FINGER, paxisim.Mount("finger", replaces=("tipp",)))
    with pytest.raises(paxisim.InvalidValueError, match="no geom 7"):
        paxisim.finger_surface(ROUND_FINGER, paxisim.Mount("finger", replaces=(7,)))
    with pytest.raises(paxisim.InvalidValueError, match="has 3 geoms, there is no geom 3: the last is 2"):
        paxisim.finger_surface(ROUND_FINGER, paxisim.Mount("finger", replaces=("finger/3",)))
    with pytest.raises(paxisim.InvalidValueError, match="replaces no geom"):
        paxisim.finger_surface(ROUND_FINGER, paxisim.Mount("finger"))
