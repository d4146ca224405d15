"""Where a robot stands and how its hand is mounted: the numbers of a scene that move them."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from lxml import etree
from models.fingers import on_arm, robot, two_fingers
from scene.rigs import path
from scipy.spatial.transform import Rotation

import paxisim
from paxisim import Drive, Scene
from paxisim.scene import ready

BENT = {"j1": 0.4, "j2": -0.3}


def arm(*hands):
    """Return the scene of arms with hands that have pads; a stream closes a finger."""
    made = paxisim.attach(robot(*hands), paxisim.Pad(paxisim.TaxelLayout(3, 3, (5e-3, 5e-3))))
    return Scene(made.to_xml(), [Drive("left", joint="left", unit="m")])


def framed(scene):
    """Return the scene with its arm and its hand inside two frames that cancel each other."""
    tree = etree.fromstring(str(scene.mjcf))
    for name in ("link0", "palm"):
        (body,) = tree.xpath(f"//body[@name='{name}']")
        outer = etree.Element("frame", pos="0.1 0 0", quat="0.5 0.5 0.5 0.5")
        inner = etree.SubElement(outer, "frame", pos="0 0 -0.1", quat="-0.5 0.5 0.5 0.5")
        body.getparent().replace(body, outer)
        inner.append(body)
    return replace(scene, mjcf=etree.tostring(tree, encoding="unicode"))


def poses(scene):
    """Return positions and rotations of all bodies, with the arm bent."""
    model = mujoco.MjModel.from_xml_string(str(scene.mjcf))
    data = mujoco.MjData(model)
    for joint, angle in BENT.items():
        data.joint(joint).qpos = angle
    mujoco.mj_kinematics(model, data)
    return {
        model.body(i).name: (data.xpos[i].copy(), Rotation.from_quat(data.xquat[i], scalar_first=True))
        for i in range(1, model.nbody)
    }


def at_rest(scene):
    """Return the positions of the pads ``(pads, 3)`` at the start."""
    model = mujoco.MjModel.from_xml_string(str(scene.mjcf))
    data, pads = mujoco.MjData(model), paxisim.find_pads(model)
    mujoco.mj_kinematics(model, data)
    return data.xpos[pads.bodies]


@pytest.mark.parametrize("frames", [False, True])
def test_the_base_moves_the_whole_robot_and_the_hand_only_itself(frames):
    plain = arm(on_arm(two_fingers()))
    scene = framed(plain) if frames else plain
    before, after = poses(plain), poses(scene.with_parameters(base_pose_x=1e-3, base_pose_z=-2e-3))
    for name, (place, turn) in before.items():
        np.testing.assert_allclose(after[name][0] - place, [1e-3, 0, -2e-3], atol=1e-9)
        assert (after[name][1] * turn.inv()).magnitude() < 1e-6

    after = poses(scene.with_parameters(hand_pose_y=1e-3, hand_turn_x=0.02))
    parent = before["flange"][1]
    for name, (place, turn) in before.items():
        if name.startswith("link") or name == "flange":
            np.testing.assert_allclose(after[name][0], place, atol=1e-9)
        else:
            np.testing.assert_allclose((after[name][1] * turn.inv()).as_rotvec(), parent.apply([0.02, 0, 0]), atol=1e-6)
    pads = paxisim.find_pads(mujoco.MjModel.from_xml_string(str(plain.mjcf))).names
    shift = np.mean([after[name][0] - before[name][0] for name in pads], axis=0)
    np.testing.assert_allclose(shift, parent.apply([0, 1e-3, 0]), atol=1e-6)


def test_a_turn_of_the_base_is_about_the_middle_of_the_pads():
    scene = arm(on_arm(two_fingers(), at="0.3 0 0"))
    before, after = (at_rest(s) for s in (scene, scene.with_parameters(base_turn_z=0.02)))
    np.testing.assert_allclose(after.mean(axis=0), before.mean(axis=0), atol=1e-9)
    assert np.linalg.norm(after - before, axis=1) == pytest.approx([0.02 * 0.04] * 2, rel=0.05)


def test_scenes_without_an_arm_have_no_such_numbers_and_two_arms_have_their_own():
    for scene in (arm(two_fingers()), ready.gripper(paxisim.TaxelLayout(3, 3, 5e-3), peg=True)):
        assert not [name for name in scene.parameters() if name.startswith(("base_", "hand_"))]
    two = arm(on_arm(two_fingers()), on_arm(two_fingers("b_"), "b_", at="0.5 0 0")).parameters()
    assert {two[f"{kind}_{body}"].target for kind, body in (("base_pose_x", "b_link0"), ("hand_turn_z", "b_palm"))} == {
        "b_link0", "b_palm"
    }  # fmt: skip


@pytest.mark.slow
def test_a_robot_that_stands_elsewhere_is_found_and_no_sensor_cause_is_named_for_it():
    post = '<geom type="sphere" size="0.015" pos="0 0 0.53"/>'
    layout = paxisim.TaxelLayout(3, 3, 4e-3)
    model = paxisim.attach(robot(on_arm(two_fingers()), world=post), layout).to_xml()
    fingers = [Drive("width", joint=s, scale=k, offset=-0.08 * k) for s, k in {"left": -0.5, "right": 0.5}.items()]
    scene = Scene(model, [*(Drive(f"j{i}", joint=f"j{i}") for i in range(4)), *fingers], closing="width")
    rng, time, parts = np.random.default_rng(0), np.arange(120) / 40, []
    for _ in range(6):
        shares = path(time, [0, 0.4, 1.2, 1.8, 2.6, 3], [0, 0, 1, 1, 0, 0])
        bent = np.full(len(time), rng.uniform(-0.01, 0.01))
        streams = {"j0": 0.01 * np.sin(5 * time), "j1": bent, "j2": -bent, "j3": 0 * bent}
        streams["width"] = 0.06 - (0.0315 + 4e-4 * rng.random()) * shares
        silent = np.zeros((len(time), 2, *layout.shape), np.float32)
        parts.append(paxisim.Recording(time, silent, covariates=streams, layout=layout))
    motion = paxisim.Recording.concatenate(parts)
    felt = scene.simulate(motion, base_pose_y=1e-3).simulated
    measured = replace(motion, measured=(felt + rng.normal(0, 0.01, felt.shape)).astype(np.float32))
    names = ("base_pose", "hand_pose", "mount_offset", "friction", "axis_gain", "latency", "offset")
    found = paxisim.diagnose(measured, names, scene=scene)
    (cause,) = found.causes  # both pads lie 1 mm further along, whatever carries them
    assert {cause.name, *cause.rivals} == {"base_pose", "hand_pose", "mount_offset"}
    moved = [abs(value) for value in found.scene_values.values()]
    assert max(moved) == pytest.approx(1e-3, abs=1e-4)
