"""The tasks as gymnasium environments: spaces, episodes, observations, seeds and solvability."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from paxisim_insertion import METHODS, TASKS, InsertionEnv, Parameters
from paxisim_insertion.env import PRIVILEGED
from paxisim_insertion.evaluate import surrogate_of
from paxisim_insertion.expert import expert_action
from paxisim_insertion.shell import command
from paxisim_insertion.surrogate import draw, surrogate
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import paxisim


@pytest.fixture(scope="module", params=TASKS)
def env(request):
    made = InsertionEnv(request.param, "GCS", terminate_on_success=True)
    yield made
    made.close()


@pytest.fixture(scope="module")
def groove():
    made = InsertionEnv("SX-2mm", "GCS")
    yield made
    made.close()


def test_an_expert_that_sees_the_poses_solves_the_task(env):
    for seed in range(3):
        _, info = env.reset(seed=seed)
        assert not info["is_success"]
        terminated = truncated = False
        while not (terminated or truncated):
            observation, reward, terminated, truncated, info = env.step(expert_action(env))
        assert terminated, f"seed {seed}: peg at {observation[PRIVILEGED][:3]}"
        assert info["is_success"]
        assert info["reward_terms"]["success"] == 1
        assert reward > 200


def test_episodes_begin_where_the_paper_says(env):
    low, high = np.array(env.parameters.start)
    for seed in (7, 8, 9):
        observation, _ = env.reset(seed=seed)
        peg, tip = observation[PRIVILEGED][:6], observation[PRIVILEGED][6:]
        bottom = peg[:3] - [0, 0, env.parameters.hole_depth]
        assert np.all((bottom > low - 1e-3) & (bottom < high + 1e-3)), f"seed {seed}: {bottom}"
        assert np.abs(tip[3:]).max() < 0.02, "pointing straight down"
        assert abs(peg[4]) < env.parameters.grasp_lean + 0.02
        assert np.abs(peg[[3, 5]]).max() < 0.02, "it leans only about the closing direction"
        total = env.scene.tactile.read().sum(axis=(-2, -1))
        assert np.all(total[:, 2] > 10), "both pads are pressed"
        assert observation in env.observation_space


def test_the_hole_is_hidden_where_it_should_be(env):
    observation, _ = env.reset(seed=1)
    if env.task.name in ("SX-2mm", "SY-2mm"):
        assert not observation["p"].any()
    else:
        np.testing.assert_array_equal(observation["p"], observation[PRIVILEGED][6:])


def test_a_frozen_axis_and_the_rotation_stay(env):
    env.reset(seed=2)
    start = env.scene.fingertip[0]
    for _ in range(10):
        observation, *_ = env.step(np.array([1.0] * (len(env.task.axes) - 1) + [0.5]))
    moved = env.scene.fingertip[0] - start
    for axis in range(3):
        if axis not in env.task.axes:
            assert abs(moved[axis]) < 1e-3
        else:
            assert moved[axis] > 0.3 * env.task.action_scale
    assert np.abs(observation[PRIVILEGED][9:]).max() < 0.03


@pytest.mark.filterwarnings(
    "ignore:.*observation.* image", "ignore:The minimal resolution"
)  # a tactile tensor is not an image
@pytest.mark.parametrize(("task", "method"), [("SX-2mm", "GCS"), ("RY-2mm", "NT"), ("SQ-1mm", "TF")])
def test_the_checkers_of_gymnasium_and_stable_baselines(task, method):
    made = gymnasium.make(f"paxisim/{task}-v0", method=method)
    check_env(made.unwrapped, skip_render_check=True)
    check_env_sb3(made.unwrapped)
    assert made.spec.kwargs["task"] == task
    made.close()


def test_an_episode_is_truncated_and_the_same_seed_gives_the_same_one(groove):
    rng = np.random.default_rng(0)
    actions = rng.uniform(-0.5, 0.5, (groove.task.max_steps, 2)).astype(np.float32)
    first, _ = groove.reset(seed=5)
    seen = [groove.step(action) for action in actions]
    assert [step[3] for step in seen] == [False] * 119 + [True]
    assert not any(step[2] for step in seen)
    again, _ = groove.reset(seed=5)
    other, _ = InsertionEnv("SX-2mm", "GCS").reset(seed=5)
    different, _ = groove.reset(seed=6)
    for name in first:
        np.testing.assert_array_equal(again[name], first[name])
        np.testing.assert_array_equal(other[name], first[name])
    assert np.abs(different["tactile"] - first["tactile"]).max() > 0.01
    groove.reset(seed=5)
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
    assert np.abs(frames[-1, :, :2]).sum() > 1.5 * np.abs(raw[:, :2]).sum()


@pytest.mark.parametrize("method", METHODS)
def test_what_each_method_sees(method):
    shapes = {"NT": None, "TF": (6,), "TB": (20, 6, 5), "TD": (60, 6, 5), "DT": (60, 6, 5), "CoP": (120,)}
    made = InsertionEnv("SQ-2mm", method)
    observation, _ = made.reset(seed=0)
    shape = shapes.get(method, (120, 6, 5))
    assert observation["tactile"].shape == shape if shape else "tactile" not in observation
    heights = made.scene.model_and_data[0].geom_size[made.scene.tactile.pads.geoms, 0]
    flat = np.ptp(heights) < 1e-9
    assert flat == (not method.startswith("GCS") or method == "GCS w/o G")
    raw = made.scene.tactile.read()
    assert np.array_equal(made.reading, raw) == (not method.startswith("GCS"))
    made.close()


def test_sy_has_a_shorter_history():
    made = InsertionEnv("SY-2mm", "GCS")
    assert made.observation_space["tactile"].shape == (60, 6, 5)
    made.close()


def test_a_surrogate_sensor_takes_the_place_of_what_the_method_draws(tmp_path):
    chain = paxisim.Chain([paxisim.augment.AxisGain((0.5, 0.5, 0.5)), paxisim.augment.LowPass(0.1)])
    chain.save(tmp_path / "sensor.json")
    made = InsertionEnv("SX-2mm", "GCS", sensor=paxisim.Chain.load(tmp_path / "sensor.json"))
    made.reset(seed=0)
    np.testing.assert_allclose(made.reading, 0.5 * made.scene.tactile.read(), rtol=1e-5)
    before = made.reading
    for _ in range(30):
        made.step(np.array([0.0, -0.3]))
    raw = 0.5 * made.scene.tactile.read()
    assert np.abs(raw - before).max() > 0.01, "the peg stands on the base"
    assert np.abs(made.reading - raw).max() > 1e-3, "the low-pass filter has memory"
    assert np.ptp(made.scene.model_and_data[0].geom_size[made.scene.tactile.pads.geoms, 0]) < 1e-9
    made.close()


def test_drawn_surrogates(tmp_path, capsys):
    assert command(surrogate, ["--seed", "3", "--out", str(tmp_path / "3.json")]) == 0
    assert "interference" in capsys.readouterr().out
    assert command(surrogate, ["--seed", "4", "--out", str(tmp_path / "3.json")]) == 2
    assert "--force overwrites it" in capsys.readouterr().err
    drawn = paxisim.Chain.load(tmp_path / "3.json")
    assert drawn.to_json() == draw(3).to_json() != draw(4).to_json()
    without = draw(3, field=False)
    assert set(drawn.names) - set(without.names) == {"interference"}
    assert without["creep"].amplitude == pytest.approx(drawn["creep"].amplitude)
    made = InsertionEnv("SX-2mm", "DT", sensor=drawn)
    made.reset(seed=0)
    assert 0 < made.parameters.handle_size - made.scene.opening < 4e-3, "a grip of 30 N indents both gels"
    raw = made.scene.tactile.read()
    assert np.abs(made.reading - raw).max() > 0.1
    np.testing.assert_allclose(made.reading / 0.1, np.round(made.reading / 0.1), atol=1e-4)
    counts = made.reading
    made.step(np.zeros(2))
    assert np.abs(made.reading - counts).max() < 1
    made.close()


def test_a_reference_sensor_with_memory_and_its_neighbour():
    made = InsertionEnv("SX-2mm", "DT", sensor=surrogate_of("reference:unit:7+memory+neighbour"))
    made.reset(seed=0)
    model, data = made.scene.model_and_data
    left, right = (data.xmat[model.body(name).id].reshape(3, 3) for name in made.scene.tactile.pads.bodies)
    facing = left.T @ right  # the neighbour's magnets are assumed to be rotated by 180 degrees about y
    np.testing.assert_allclose(facing, np.diag([-1.0, 1.0, -1.0]), atol=0.05)
    raw, covariates = made.scene.tactile.read(), {"gripper_opening": made.scene.opening}
    alone, beside = (surrogate_of(f"reference:unit:7{with_}")(made.layout) for with_ in ("", "+neighbour"))
    assert np.abs(beside(raw, covariates) - alone(raw)).max() > 0.05
    before = made.reading
    for _ in range(3):
        made.step(np.zeros(2))
    assert np.isfinite(made.reading).all()
    assert np.abs(made.reading - before).max() < 1
    made.close()
    with pytest.raises(paxisim.InvalidValueError, match="is named unit:N"):
        surrogate_of("reference:unit:x")


def test_bad_input():
    with pytest.raises(paxisim.UnknownNameError, match="unknown task"):
        InsertionEnv("SX-3mm")
    with pytest.raises(paxisim.UnknownNameError, match="unknown method 'gcs'; did you mean 'GCS'"):
        InsertionEnv("SX-2mm", "gcs")
    with pytest.raises(paxisim.InvalidValueError, match="render_mode"):
        InsertionEnv("SX-2mm", render_mode="human")


def test_other_parameters_make_another_task():
    start = ((0, 0.01, 0.01), (0, 0.01, 0.01))
    made = InsertionEnv("SX-2mm", parameters=Parameters(start=start, grasp_offset=(0, 0, 0), grasp_lean=0))
    observation, _ = made.reset(seed=0)
    np.testing.assert_allclose(observation[PRIVILEGED][:3], [0, 0.01, 0.03], atol=3e-4)
    np.testing.assert_allclose(observation[PRIVILEGED][6:8], [0, 0.01], atol=3e-4)
    made.close()
