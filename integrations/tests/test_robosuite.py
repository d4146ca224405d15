"""Tactile versions of robosuite's grippers and their readings in robosuite's environments."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
import robosuite
from paxisim_robosuite import TactileWrapper, fast_controller, register
from paxisim_robosuite.gripper import READY_MADE
from robosuite.controllers.parts.arm import OperationalSpaceController
from robosuite.models.grippers import GRIPPER_MAPPING, gripper_factory, register_gripper
from robosuite.models.world import MujocoWorldBase
from robosuite.wrappers import GymWrapper

import paxisim

LAYOUT = paxisim.TaxelLayout(3, 2, 4e-3)
TIP = paxisim.Mount("finger_joint1_tip")
QUIET = {"has_renderer": False, "has_offscreen_renderer": False, "use_camera_obs": False, "control_freq": 20}


def made(task, robots, grippers, **options):
    return robosuite.make(
        task, **{"robots": robots, "gripper_types": grippers, "hard_reset": False, "seed": 0, **QUIET, **options}
    )


@pytest.fixture(scope="module")
def lift():
    env = made("Lift", "Panda", "PaxiPandaGripper")
    yield TactileWrapper(env, seed=0)
    env.close()


@pytest.fixture
def registered():
    """Register a gripper for one test, and return its model as robosuite compiles it, without duplicate assets."""
    before = set(GRIPPER_MAPPING)

    def compiled(gripper, *arguments):
        register("Own", gripper, LAYOUT, *arguments)
        return compiled_world(gripper_factory("Own", idn=0))

    yield compiled
    for name in set(GRIPPER_MAPPING) - before:
        del GRIPPER_MAPPING[name]


def compiled_world(gripper):
    world = MujocoWorldBase()
    world.merge(gripper)
    return world.get_model()


@pytest.mark.parametrize("gripper", READY_MADE)
def test_a_ready_made_gripper_differs_from_robosuites_by_its_pads_alone(gripper):
    plain, tactile = gripper_factory(gripper, idn=0), gripper_factory(f"Paxi{gripper}", idn=0)
    without, with_pads = compiled_world(plain), compiled_world(tactile)
    pads = paxisim.find_pads(with_pads, prefix=tactile.naming_prefix)
    assert pads.shape == (2, 3, 6, 5)
    assert with_pads.nbody == without.nbody + 2
    assert with_pads.nq == without.nq
    np.testing.assert_array_equal(with_pads.jnt_range, without.jnt_range)
    np.testing.assert_array_equal(with_pads.actuator_gainprm, without.actuator_gainprm)
    touching = {plain_name for plain_name in plain.contact_geoms if with_pads.geom(plain_name).conaffinity[0]}
    assert 0 < len(plain.contact_geoms) - len(touching) <= sum(len(mount.replaces) for mount in tactile.mounts)
    taxels = {with_pads.geom(int(geom)).name for geom in pads.geoms.reshape(-1)}
    assert taxels <= set(tactile.contact_geoms)
    # robosuite's list for this gripper names geoms that are missing in its file
    for side in () if gripper == "XArm7Gripper" else ("left", "right"):
        assert len(taxels & set(tactile.important_geoms[f"{side}_fingerpad"])) == 30


def test_mounts_and_sensor_of_ones_own(registered):
    replaces = ("finger1_pad_collision", "leftfinger/1")  # a geom by its name, and by its body and index
    mount = paxisim.Mount("finger_joint1_tip", (0, -0.009, -0.015), (0, 0, 1, 1), replaces)
    model = registered("PandaGripper", [mount])
    assert paxisim.find_pads(model).shape == (1, 3, 3, 2)
    names = ("finger1", "finger1_pad", "finger2", "finger2_pad")
    assert [model.geom(f"gripper0_{name}_collision").conaffinity[0] for name in names] == [0, 0, 1, 1]
    assert not model.geom("gripper0_finger1_pad_collision").contype[0]


def test_explicit_pairs_of_replaced_geoms_are_removed(registered):
    """In MuJoCo the geoms of an explicit pair collide whatever their contact bits."""

    class Paired(GRIPPER_MAPPING["PandaGripper"]):
        def resolve_asset_dependency(self):
            super().resolve_asset_dependency()
            for first in ("finger1_pad_collision", "finger1_collision"):
                self.contact.append(ET.Element("pair", {"geom1": first, "geom2": "hand_collision"}))

    register_gripper(Paired)
    model = registered("Paired", [paxisim.Mount("finger_joint1_tip", replaces=("finger1_pad_collision",))])
    (first,), (second,) = model.pair_geom1, model.pair_geom2
    assert {model.geom(first).name, model.geom(second).name} == {f"gripper0_{n}_collision" for n in ("finger1", "hand")}


def test_what_cannot_be_registered(registered):
    unknown, invalid = paxisim.UnknownNameError, paxisim.InvalidValueError
    for arguments, error, told in (
        (("A", "PandaGriper"), unknown, "did you mean 'PandaGripper'"),
        (("A", "PandaGripper", "paxini-gen1"), unknown, "unknown sensor"),
        (("PandaGripper", "PandaGripper"), invalid, "expected a new name"),
        (("A", "PandaGripper", "paxini-gen1-l4629", []), invalid, "at least one mount"),
        (("A", "PaxiPandaGripper"), invalid, "no mounts are known for PaxiPandaGripper"),
        (("A", "PandaGripper", paxisim.Pad(LAYOUT, sensors="touch_grid")), invalid, "drops the plugin"),
        (("A", "PandaGripper", LAYOUT, [TIP, TIP]), invalid, "two mounts are named 'finger_joint1_tip'"),
    ):
        with pytest.raises(error, match=told):
            register(*arguments)
    assert "A" not in GRIPPER_MAPPING
    with pytest.raises(invalid, match=r"body 'finger_joint1_tip' has \d geoms?, there is no geom 99"):
        registered("PandaGripper", [paxisim.Mount("finger_joint1_tip", replaces=(99,))])
    with pytest.warns(UserWarning, match="Own was registered before"):
        again = register("Own", "PandaGripper", LAYOUT, [TIP])
    assert GRIPPER_MAPPING["Own"] is again
    with pytest.raises(invalid, match=r"no gripper of the environment has pads .*PandaGripper"):
        TactileWrapper(made("Lift", "Panda", "PandaGripper"))


def gripped(wrapper, steps):
    """Tactile tensor and weight (N) of Lift's cube after the fingers have closed on it."""
    wrapper.reset()
    env = wrapper.unwrapped
    model, data = env.sim.model._model, env.sim.data._data
    pads = paxisim.find_pads(model)
    joint = model.joint(env.cube.joints[0])
    address, dof = joint.qposadr[0], joint.dofadr[0]
    action = np.zeros(env.action_dim)
    action[-1] = 1
    for step in range(steps):
        if step < 0.7 * steps:  # hold the cube between the fingers until they have closed
            data.qpos[address : address + 7] = [*data.xpos[pads.bodies].mean(axis=0), 1, 0, 0, 0]
            data.qvel[dof : dof + 6] = 0
        observation, *_ = wrapper.step(action)
    return observation["robot0_tactile"], model.body(env.cube.root_body).mass[0] * 9.81


def test_a_cube_is_felt_and_counts_as_grasped(lift):
    observation = lift.reset()
    assert observation["robot0_tactile"].shape == (2, 3, 6, 5)
    assert observation["robot0_tactile"].dtype == np.float32
    assert not observation["robot0_tactile"].any()
    force, weight = gripped(lift, 20)
    total = force.sum(axis=(-2, -1))
    # the fingers push with kp * opening, about 20 N on a cube of 4 cm, against 1 N of dry friction
    assert np.all((total[:, 2] > 15) & (total[:, 2] < 22)), total
    assert total[:, 1].sum() == pytest.approx(weight, rel=0.3)  # y points down the fingers: the cube hangs
    env = lift.unwrapped
    assert env._check_grasp(env.robots[0].gripper, env.cube)


@pytest.mark.parametrize("gripper", ["PaxiRobotiq140Gripper", "PaxiRethinkGripper"])
def test_other_grippers_feel_it_too(gripper):
    env = made("Lift", "Panda", gripper)
    total = gripped(TactileWrapper(env, seed=0), 40)[0].sum(axis=(-2, -1))
    assert np.all(total[:, 2] > 10), total
    assert total[0, 2] == pytest.approx(total[1, 2], rel=0.1)
    assert env._check_grasp(env.robots[0].gripper, env.cube)


def test_robots_with_two_arms_and_several_robots():
    for robots, grippers, names in (
        ("Baxter", "PaxiRethinkGripper", {"robot0_right_tactile", "robot0_left_tactile"}),
        (["Panda", "UR5e"], ["PaxiPandaGripper", "Robotiq140Gripper"], {"robot0_tactile"}),
    ):
        wrapper = TactileWrapper(made("TwoArmLift", robots, grippers), seed=0)
        wrapper.reset()
        observation, *_ = wrapper.step(np.zeros(wrapper.unwrapped.action_dim))
        assert names == {name for name in observation if name.endswith("tactile")}
        assert all(observation[name].shape == (2, 3, 6, 5) for name in names)


def test_the_surface_changes_with_the_episode(lift):
    def heights():
        lift.reset()
        model = lift.unwrapped.sim.model._model
        return model.geom_size[paxisim.find_pads(model).geoms, 2].copy()

    first, second = heights(), heights()
    assert np.ptp(first) > 1e-5
    assert np.all(first != second, axis=1).any()
    lift.gcs = None
    try:
        np.testing.assert_array_equal(heights(), second)
    finally:
        lift.gcs = paxisim.GCS()


@pytest.mark.filterwarnings("ignore:.*precision lowered")  # from robosuite's own action space
def test_gym_wrapper_and_hard_resets():
    env = made("Lift", "Panda", "PaxiPandaGripper", hard_reset=True)
    gym = GymWrapper(TactileWrapper(env, seed=0), keys=["robot0_proprio-state", "robot0_tactile"], flatten_obs=False)
    for _ in range(2):
        before = env.sim
        observation, _ = gym.reset()
        assert env.sim is not before
        assert observation["robot0_tactile"] in gym.observation_space["robot0_tactile"]
        pads = paxisim.find_pads(env.sim.model._model)
        assert np.all(env.sim.model._model.geom_priority[pads.geoms] == 1)
        # the gel of a compiled model, not that of the file
        assert np.all(env.sim.model._model.body_invweight0[pads.bodies, 0] > 1000)
        gym.step(np.zeros(7))
    gym.close()


@pytest.mark.parametrize("settings", [{}, {"input_type": "absolute", "input_ref_frame": "world", "kp": 100}])
def test_the_fast_controller_gives_robosuites_torques(settings):
    fast = fast_controller("Panda", **settings)
    envs = [
        made("Lift", "Panda", "default", controller_configs=own, seed=1) for own in ({**fast, "type": "BASIC"}, fast)
    ]
    for env in envs:
        env.reset()
    ours = envs[1].robots[0].composite_controller.part_controllers["right"]
    rng = np.random.default_rng(0)
    start = envs[0].sim.data.site_xpos[envs[0].robots[0].eef_site_id["right"]].copy()
    for _ in range(10):
        action = rng.uniform(-1, 1, 7)
        if settings:
            action[:3] = start + 0.05 * action[:3]
            action[3:6] = np.pi * np.array([1, 0.1, 0]) / np.linalg.norm([1, 0.1, 0])
        for env in envs:
            env.step(action)
        envs[1].sim.step1()
        torques = ours.run_controller()
        assert np.abs(torques).max() > 1
        np.testing.assert_allclose(torques, OperationalSpaceController.run_controller(ours), rtol=1e-9, atol=1e-9)
    # in the first substep after a reset robosuite's controller uses the state from before the gripper was opened
    np.testing.assert_allclose(envs[1].sim.data.qpos, envs[0].sim.data.qpos, atol=1e-4)
