"""The tasks as gymnasium environments: spaces, episodes, observations, seeds and solvability."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from paxisim_insertion import METHODS, TASKS, InsertionEnv, Parameters
from paxisim_insertion.expert import expert_action
from paxisim_insertion.observations import PRIVILEGED
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import paxisim


@pytest.fixture(scope="module")
def groove():
    made = InsertionEnv("SX-2mm", "GCS")
    yield made
    made.close()


@pytest.mark.parametrize("engine", ["native", "robosuite"])
@pytest.mark.parametrize("task", TASKS)
def test_an_expert_that_sees_the_poses_solves_the_task(task, engine):
    env = InsertionEnv(task, "GCS", engine=engine, terminate_on_success=True)
    low, high = np.array(env.parameters.start)
    for seed in (0, 1, 2):
        observation, info = env.reset(seed=seed)
        assert observation in env.observation_space
        assert not info["is_success"]
        peg, tip = observation[PRIVILEGED][:6], observation[PRIVILEGED][6:]
        bottom = peg[:3] - [0, 0, env.parameters.hole_depth]
        assert np.all((bottom > low - 1e-3) & (bottom < high + 1e-3)), f"seed {seed} begins at {bottom}"
        assert np.abs(tip[3:]).max() < 0.02, "pointing straight down"
        assert abs(peg[4]) < env.parameters.grasp_lean + 0.02
        assert np.abs(peg[[3, 5]]).max() < 0.02, "it leans only about the closing direction"
        assert np.all(env.raw.sum(axis=(-2, -1))[:, 2] > 10), "both pads are pressed"
        seen = np.zeros(6) if task in ("SX-2mm", "SY-2mm") else tip
        np.testing.assert_array_equal(observation["p"], seen, err_msg="the hole is hidden where it should be")
        terminated = truncated = False
        while not (terminated or truncated):
            observation, reward, terminated, truncated, info = env.step(expert_action(env))
        assert terminated, f"seed {seed}: peg at {observation[PRIVILEGED][:3]}"
        assert info["is_success"]
        assert info["reward_terms"]["success"] == 1
        assert reward > 200
    env.close()


@pytest.mark.parametrize("task", ["SX-2mm", "SY-2mm"])
def test_a_frozen_axis_and_the_rotation_stay(task):
    env = InsertionEnv(task, "NT")
    env.reset(seed=2)
    start = env.scene.fingertip[0]
    for _ in range(10):
        observation, *_ = env.step(np.array([1.0, 0.5]))
    moved = env.scene.fingertip[0] - start
    for axis in range(3):
        if axis in env.task.axes:
            assert moved[axis] > 0.3 * env.task.action_scale
        else:
            assert abs(moved[axis]) < 1e-3
    assert np.abs(observation[PRIVILEGED][9:]).max() < 0.03
    env.close()


@pytest.mark.filterwarnings(
    "ignore:.*observation.* image", "ignore:The minimal resolution"
)  # a tactile tensor is not an image
@pytest.mark.parametrize(("task", "method"), [("SX-2mm", "GCS"), ("RY-2mm", "NT"), ("SQ-1mm", "TF")])
def test_the_checkers_of_gymnasium_and_stable_baselines(task, method):
    made = gymnasium.make(f"paxisim/{task}-v0", method=method, engine="native")
    check_env(made.unwrapped, skip_render_check=True)
    check_env_sb3(made.unwrapped)
    assert made.spec.kwargs["task"] == task
    made.close()


def test_an_episode_is_truncated_and_the_same_seed_gives_the_same_one(groove):
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, (groove.task.max_steps, 2)).astype(np.float32)
    first, _ = groove.reset(seed=5)
    seen = [groove.step(action) for action in actions]
    assert [step[3] for step in seen] == [False] * 119 + [True]
    assert not any(step[2] for step in seen)
    other, _ = InsertionEnv("SX-2mm", "GCS").reset(seed=5)
    different, _ = groove.reset(seed=6)
    again, _ = groove.reset(seed=5)
    for name in first:
        np.testing.assert_array_equal(again[name], first[name])
        np.testing.assert_array_equal(other[name], first[name])
    assert np.abs(different["tactile"] - first["tactile"]).max() > 0.01
    for action, expected in zip(actions[:3], seen[:3], strict=True):
        np.testing.assert_array_equal(groove.step(action)[0]["tactile"], expected[0]["tactile"])


def test_what_the_history_holds(groove):
    observation, _ = groove.reset(seed=3)
    frames = observation["tactile"].reshape(20, 2, 3, 6, 5)
    np.testing.assert_array_equal(frames, np.broadcast_to(groove.reading, frames.shape))
    older = groove.reading
    observation, *_ = groove.step(np.array([0.0, -1.0]))
    frames = observation["tactile"].reshape(20, 2, 3, 6, 5)
    np.testing.assert_array_equal(frames[-1], groove.reading)
    np.testing.assert_array_equal(frames[-2], older)
    # GCS: some taxels are dropped for the whole episode, and Poisson shear appears even without contact at the base
    dropped = ~frames.any(axis=(0, 2))
    assert 2 <= dropped.sum() <= 30
    raw = groove.scene.tactile.read()
    np.testing.assert_array_equal(observation["raw"], raw)
    assert np.abs(frames[-1, :, :2]).sum() > 1.5 * np.abs(raw[:, :2]).sum()


def test_what_each_method_sees():
    shapes = {"NT": None, "TF": (6,), "TB": (20, 6, 5), "TD": (60, 6, 5), "DT": (60, 6, 5), "CoP": (120,)}
    for method in METHODS:
        made = InsertionEnv("SQ-2mm", method, engine="native")
        observation, _ = made.reset(seed=0)
        shape = shapes.get(method, (120, 6, 5))
        assert (observation["tactile"].shape if "tactile" in observation else None) == shape, method
        heights = made.scene.model_and_data[0].geom_size[made.scene.tactile.pads.geoms, 0]
        randomises = method.startswith("GCS")
        assert (np.ptp(heights) > 1e-9) == (randomises and method != "GCS w/o G"), method
        assert np.array_equal(made.reading, made.raw) != randomises, method
    assert InsertionEnv("SY-2mm", "GCS", engine="native").observation_space["tactile"].shape == (60, 6, 5)


def test_a_surrogate_sensor_takes_the_place_of_what_the_method_draws():
    chain = paxisim.Chain([paxisim.augment.AxisGain((0.5, 0.5, 0.5)), paxisim.augment.LowPass(0.1)])
    made = InsertionEnv("SX-2mm", "GCS", engine="native", sensor=chain)
    made.reset(seed=0)
    np.testing.assert_allclose(made.reading, 0.5 * made.raw, rtol=1e-5)
    before = made.reading
    for _ in range(30):
        made.step(np.array([0.0, -0.3]))
    assert np.abs(0.5 * made.raw - before).max() > 0.01, "the peg stands on the base"
    assert np.abs(made.reading - 0.5 * made.raw).max() > 1e-3, "the low-pass filter has memory"


def test_bad_input():
    for options, error, told in (
        ({"task": "SX-3mm"}, paxisim.UnknownNameError, "did you mean 'SX-2mm'"),
        ({"method": "gcs"}, paxisim.UnknownNameError, "unknown method 'gcs'; did you mean 'GCS'"),
        ({"engine": "mujoco"}, paxisim.UnknownNameError, "unknown engine 'mujoco'"),
        ({"render_mode": "human"}, paxisim.InvalidValueError, "render_mode"),
    ):
        with pytest.raises(error, match=told):
            InsertionEnv(**options)


def test_other_parameters_make_another_task():
    start = ((0, 0.01, 0.01), (0, 0.01, 0.01))
    made = InsertionEnv("SX-2mm", parameters=Parameters(start=start, grasp_offset=(0, 0, 0), grasp_lean=0))
    observation, _ = made.reset(seed=0)
    np.testing.assert_allclose(observation[PRIVILEGED][:3], [0, 0.01, 0.03], atol=3e-4)
    np.testing.assert_allclose(observation[PRIVILEGED][6:8], [0, 0.01], atol=3e-4)
    made.close()
