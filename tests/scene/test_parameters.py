"""Parameters of a scene: which ones exist, and that each has its stated effect."""

import re
from dataclasses import replace

import numpy as np
import pytest
from rigs import LAYOUT, recording, total

import paxisim
from paxisim.scene import ready

DEPTH = 1.2e-3


def held(depth=DEPTH, slide=0.0, seconds=1.5):
    """Return a recording of a press that is held and meanwhile slides along x."""
    time = np.arange(round(seconds * 100)) / 100
    down = np.clip(time / 0.4, 0, 1)
    along = slide * np.clip((time - 0.6) / 0.6, 0, 1)
    return recording(time, {"x": along, "y": np.zeros_like(time), "depth": -2e-4 + (depth + 2e-4) * down})


def bench(layout=LAYOUT, radius=0.02):
    """Return a scene with a ball as indenter on spherical taxels, which it presses smoothly."""
    text = f"""<mujoco><option timestep="0.002" cone="elliptic" impratio="10"/><worldbody><body name="bench"/>
    <body name="ball" pos="0 0 {radius}"><joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide"
    axis="0 -1 0"/><joint name="depth" type="slide" axis="0 0 -1"/><geom name="ball" type="sphere" size="{radius}"
    mass="0.1"/></body></worldbody></mujoco>"""
    pad = paxisim.Pad(layout, thickness=4e-3, taxels="spheres")
    made = paxisim.attach(text, pad, [paxisim.Mount("bench", quat=(0, 1, 0, 0), name="pad")])
    drives = tuple(paxisim.Drive(name, joint=name, unit="m") for name in ("x", "y", "depth"))
    return paxisim.Scene(made.to_xml(), drives, closing="depth", gel=paxisim.Gel(modulus=300e3))


def force(scene, motion, **values):
    """Return the forces at the end of a motion, ``(pads, 3, rows, cols)``."""
    return scene.simulate(motion, **values).simulated[-5:].mean(axis=0)


def place(normal):
    """Return where the normal force acts on a pad (m, along its x and y)."""
    normal = normal.ravel()
    return LAYOUT.positions[:, :2].T @ normal / normal.sum()


@pytest.fixture(scope="module")
def pressed():
    """The bench, a press that is held, and its forces with the scene's own values."""
    scene, motion = bench(), held()
    return scene, motion, force(scene, motion)


def test_a_scene_has_these_numbers():
    found = bench().parameters()
    assert {item.group for item in found.values()} == {
        "friction", "gel_stiffness", "mount_offset", "mount_tilt", "surface", "object_size", "object_pose",
        "joint_offset", "impratio",
    }  # fmt: skip
    assert all(item.low < item.nominal < item.high for item in found.values())
    assert found["friction"].nominal == bench().gel.friction
    assert "joint_offset_depth" in found
    assert "joint_offset_x" not in found  # equivalent to the mount's offset along x
    gripper = ready.gripper(LAYOUT, peg=True).parameters()
    for side in ("left", "right"):  # each pad has its own
        assert any(name.startswith("mount_tilt_x_") and side in name for name in gripper)
    assert gripper["object_size"].target == "peg"
    for name, value, error in (("frction", 1.0, LookupError), ("mount_tilt_x", 1.0, ValueError)):
        with pytest.raises(error, match=name):
            bench().with_parameters(**{name: value})


@pytest.mark.parametrize("radius", [5e-3, 20e-3])
def test_a_step_of_an_object_s_size_moves_its_surface_as_far_as_a_step_of_a_joint_s_zero(radius):
    found = bench(radius=radius).parameters()
    assert found["object_size"].step * radius == pytest.approx(found["joint_offset_depth"].step)
    assert found["object_size"].material * radius == pytest.approx(found["joint_offset_depth"].material)


def test_forces_change_as_the_numbers_say(pressed):
    scene, motion, plain = pressed
    stiff = force(scene, motion, gel_stiffness=1.3)
    assert total(stiff[None])[0] == pytest.approx(1.3 * total(plain[None])[0], rel=0.02)
    deeper = force(scene, held(depth=DEPTH + 1e-4))
    np.testing.assert_allclose(force(scene, motion, joint_offset_depth=1e-4), deeper, atol=2e-3)
    np.testing.assert_allclose(force(scene, motion, object_pose_z=-1e-4), deeper, atol=2e-3)
    # the ball grows about its centre, so it also reaches deeper
    assert total(force(scene, motion, object_size=1.02)[None])[0] > 1.2 * total(plain[None])[0]
    bowl = force(scene, motion, surface_20=2e-4, surface_02=2e-4)  # is pressed at its rim
    assert bowl[0, 2, 2:4, 2].sum() < 0.8 * plain[0, 2, 2:4, 2].sum()
    finer = bench(paxisim.TaxelLayout(12, 10, (26.1e-3 / 12, 22.6e-3 / 10))).simulate(motion).simulated
    assert finer.shape[1:] == (1, 3, 6, 5)  # adds up to the sensor's taxels
    assert total(finer)[-1] == pytest.approx(total(plain[None])[0], rel=0.05)


def test_a_pad_off_its_place_reads_the_press_elsewhere(pressed):
    scene, motion, plain = pressed

    def shift(**values):
        return place(force(scene, motion, **values)[0, 2]) - place(plain[0, 2])

    np.testing.assert_allclose(shift(mount_offset_x=1e-3, mount_offset_y=-5e-4), [-1e-3, 5e-4], atol=3e-4)
    np.testing.assert_allclose(shift(object_pose_x=1e-3), [1e-3, 0], atol=3e-4)
    tilted, back = shift(mount_tilt_y=np.radians(2)), shift(mount_tilt_y=-np.radians(2))
    assert abs(tilted[0]) > 2e-4  # it is pressed on its raised side
    assert np.sign(tilted[0]) == -np.sign(back[0])
    assert abs(tilted[1]) < 1e-4


def test_objects_and_pads_in_frames_move_like_others(pressed):
    plain, motion, _ = pressed
    text = str(plain.mjcf)
    ball = re.search(r"<geom name=.ball.[^>]*/>", text)[0]
    turned = f'<frame pos="1e-3 0 0" quat="0 0 0 1"><frame pos="1e-3 0 0">{ball}</frame></frame>'  # ends where it was
    framed = replace(plain, mjcf=text.replace(ball, turned))
    for values in ({}, {"object_pose_y": 1e-3}, {"object_size": 1.01}):
        own = force(framed, motion, **values)
        np.testing.assert_allclose(own, force(plain, motion, **values), atol=5e-3)
        assert own.any()


def test_a_slide_tells_the_friction():
    scene, motion = bench(), held(slide=4e-3, seconds=1.2)
    for friction in (0.4, 0.8):
        x, _, normal = force(scene, motion, friction=friction)[0].sum(axis=(1, 2))
        assert abs(x) == pytest.approx(friction * normal, rel=0.1)


def test_a_motor_exerts_what_it_is_told_times_the_grip_force():
    text = """<mujoco><option timestep="0.002" cone="elliptic" impratio="10"/><worldbody><body name="bench"/>
    <body name="tip" pos="0 0 0.02" gravcomp="1"><joint name="z" type="slide" axis="0 0 -1" damping="60"/>
    <geom type="sphere" size="0.02" mass="0.2"/></body></worldbody>
    <actuator><motor name="push" joint="z"/></actuator></mujoco>"""
    pad = paxisim.Pad(LAYOUT, thickness=4e-3, taxels="spheres")
    made = paxisim.attach(text, pad, [paxisim.Mount("bench", quat=(0, 1, 0, 0), name="pad")])
    scene = paxisim.Scene(made.to_xml(), (paxisim.Drive("push", actuator="push", unit="N"),), "force")
    time = np.arange(200) / 100
    motion = recording(time, {"push": 5.0 * np.clip(2 * time, 0, 1)})
    assert total(force(scene, motion)[None])[0] == pytest.approx(5, rel=0.02)
    assert total(force(scene, motion, grip_force=0.7)[None])[0] == pytest.approx(3.5, rel=0.02)
    assert "grip_force" not in bench().parameters()


def test_the_changed_scene_and_its_bounds_are_saved(tmp_path):
    scene, motion = replace(bench(), bounds={"friction": (0.5, 1.5)}), held(seconds=0.8)
    changed = scene.with_parameters(mount_offset_x=1e-3, friction=0.7, joint_offset_depth=1e-4)
    changed.save(tmp_path / "scene.toml")
    again = paxisim.Scene.load(tmp_path / "scene.toml")
    np.testing.assert_allclose(again.simulate(motion).simulated, changed.simulate(motion).simulated, atol=2e-3)
    assert again.gel.friction == 0.7
    scene.save(tmp_path / "scene.toml")
    friction = paxisim.Scene.load(tmp_path / "scene.toml").parameters()["friction"]
    assert (friction.low, friction.high) == (0.5, 1.5)
    with pytest.raises(ValueError, match="exclude its value in the scene, 1"):
        replace(scene, bounds={"friction": (0.1, 0.9)}).parameters()
    with pytest.raises(LookupError, match="gel_stiffness"):
        replace(scene, bounds={"gel_stifness": (0.5, 2)}).parameters()
