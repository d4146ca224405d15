"""The tasks on MuJoCo Warp: against the native engine on the same seeds, and as a vector environment."""

from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import torch
from paxisim_insertion import TASKS, InsertionEnv, Parameters
from paxisim_insertion.evaluate import evaluate
from paxisim_insertion.results import Result
from paxisim_insertion.reward import insertion, reward_terms, weighted
from paxisim_insertion.shell import command
from paxisim_insertion.warp_env import InsertionWarpEnv
from paxisim_lab.engines import engines
from scipy.spatial.transform import Rotation

import paxisim

warp = pytest.importorskip("warp")  # a file that is named is collected in any environment
warp.config.log_level = warp.LOG_WARNING
POLICIES = Path(__file__).parents[1] / "policies"
WORLDS = 3
pytestmark = pytest.mark.timeout(600)  # kernels are compiled once


@pytest.fixture(scope="module")
def env():
    """Three worlds of SX-2mm with GCS."""
    return InsertionWarpEnv(WORLDS, task="SX-2mm", method="GCS", device="cpu")


def centring_and_pushing(observation):
    """Actions of an expert for SX-2mm that sees the poses: to the groove, and down once above it."""
    peg = observation["privileged"].numpy()
    across = -peg[:, 1] / 7e-3
    low = (np.abs(peg[:, 1]) < 0.5e-3) | (peg[:, 2] < 20e-3)
    down = np.where(low, -0.35, np.where(peg[:, 2] < 23e-3, 0.3, 0.0))
    return np.stack([across, down], axis=-1).clip(-1, 1).astype(np.float32)


def test_worlds_agree_with_the_native_engine_until_the_peg_touches_the_base(env):
    seeds = [11, 12, 13]
    singles = [InsertionEnv("SX-2mm", "GCS", engine="native") for _ in seeds]
    for single in singles:  # with its usual 1e-8, the solver stops up to 1.4e-4 rad from where it ends with this
        single.scene.model_and_data[0].opt.tolerance = 1e-10
    observation, infos = env.reset(seed=seeds)
    expected = [single.reset(seed=seed)[0] for single, seed in zip(singles, seeds, strict=True)]
    assert not infos["is_success"].any()
    for action in np.random.default_rng(0).uniform(-0.5, 0.5, (3, WORLDS, 2)).astype(np.float32):
        for name, found in observation.items():
            them = np.stack([single[name] for single in expected])
            assert (found.numpy().dtype, found.shape) == (them.dtype, them.shape)
            tolerance = 2e-6 if name in ("p", "privileged") else 2e-4  # m and rad; N
            np.testing.assert_allclose(found, them, atol=tolerance, err_msg=name)
        observation, reward, *_ = env.step(action)
        told = [single.step(own) for single, own in zip(singles, action, strict=True)]
        expected = [one[0] for one in told]
        np.testing.assert_allclose(reward, [one[1] for one in told], atol=1e-3)
    heights = [paxisim.GCS().sample_surface(np.random.default_rng(seed), layout=env.layout) for seed in seeds]
    assert not np.allclose(heights[0], heights[1]), "each world has a surface of its own"


def test_an_expert_solves_the_task_and_rewards_are_the_papers(env):
    observation, _ = env.reset(seed=[1, 2, 3])
    for _ in range(env.task.max_steps - 1):
        action = centring_and_pushing(observation)
        observation, reward, terminated, truncated, infos = env.step(action)
        if infos["is_success"].all():
            break
    assert infos["is_success"].all()
    assert not terminated.any()
    assert not truncated.any()
    assert not infos["is_wrong"].any()
    peg = observation["privileged"].double().numpy()
    rotation = Rotation.from_rotvec(peg[:, 3:6]).as_matrix()
    state = insertion(env.task, Parameters(), peg[:, :3], rotation)
    terms = reward_terms(state, action, Parameters().epsilon)
    np.testing.assert_allclose(reward, weighted(terms), rtol=1e-4)
    assert terms["success"].any()


def test_episodes_end_together_and_begin_at_once(env, monkeypatch):
    monkeypatch.setattr(env, "task", replace(env.task, max_steps=2))
    first, _ = env.reset(seed=5)
    env.step(np.zeros((WORLDS, 2)))
    observation, _, _, truncated, infos = env.step(np.zeros((WORLDS, 2)))
    assert truncated.all()
    assert infos["final_info"]["is_success"].shape == infos["is_success"].shape == (WORLDS,)
    assert infos["_final_obs"].all()
    raw, last = observation["raw"], infos["final_obs"]["raw"]
    assert (raw - last).abs().max() > 0.1, "another grasp and surface"
    again, _ = env.reset(seed=5)
    torch.testing.assert_close(again["raw"], first["raw"])
    torch.testing.assert_close(again["tactile"], first["tactile"])
    assert not torch.allclose(first["raw"][0], first["raw"][1])


def test_staggered_worlds_end_one_by_one_and_disturb_no_other(monkeypatch):
    many = InsertionWarpEnv(WORLDS, task="SX-2mm", method="GCS", staggered=True, device="cpu")
    length = 5
    monkeypatch.setattr(many, "task", replace(many.task, max_steps=length))
    many.reset(seed=2)
    ended, k = [], many._history.k
    for _ in range(3 * length):
        observation, reward, _, truncated, infos = many.step(np.zeros((WORLDS, 2)))
        assert (reward > 0.1).all()
        assert not infos["is_wrong"].any()
        torch.testing.assert_close(infos["_final_obs"], truncated)
        ended.append(truncated.numpy())
        for name, values in observation.items():
            same = [torch.equal(one, other) for one, other in zip(values, infos["final_obs"][name], strict=True)]
            own = truncated | (values == 0).flatten(1).all(dim=1)  # "p" is 0 on this task
            assert all(same[world] for world in np.flatnonzero(~own)), f"{name} of a world that goes on"
        frames = observation["tactile"].reshape(WORLDS, k, -1)
        constant = (frames == frames[:, :1]).all(dim=(1, 2))
        torch.testing.assert_close(constant, truncated, msg="an episode begins with its first frame alone")
        raw = observation["raw"]
        assert (raw[:, :, 2].sum(dim=(-2, -1)) > 20).all(), "each pad is held with 27 N"
    ended = np.array(ended)
    assert len(set(ended.argmax(axis=0))) > 1, "at different steps"
    np.testing.assert_array_equal(ended[length:], ended[:-length], "episodes of one length")
    assert (ended.sum(axis=0) == 3).all()


def test_settling_the_next_grasps_leaves_the_worlds_as_they_are(env):
    ways = []
    for settles in (False, True):
        observation, _ = env.reset(seed=9)
        for _ in range(3):
            if settles:
                env.scene.settle(env._draw())
            observation, *_ = env.step(0.3 * torch.ones(WORLDS, 2))
        ways.append(observation)
    for name, values in ways[0].items():
        torch.testing.assert_close(ways[1][name], values, rtol=0, atol=1e-6, msg=name)


def test_a_world_that_diverges_is_told_and_recovers(env):
    env.reset(seed=7)
    env.scene._qpos[1, 0] = float("nan")
    observation, reward, _, _, infos = env.step(torch.zeros(WORLDS, 2))
    assert infos["is_wrong"].tolist() == [False, True, False]
    assert reward[1] == 0
    assert (reward[[0, 2]] > 0.1).all()
    for value in observation.values():
        assert torch.isfinite(value).all()
        assert (value[1] == 0).all()
    _, infos = env.reset(seed=7)
    assert not infos["is_wrong"].any()


def test_spaces_seeds_and_registration(env):
    observation, _ = env.reset(seed=0)
    for name, space in env.observation_space.spaces.items():
        assert space.contains(observation[name].numpy()), name
    with pytest.raises(paxisim.InvalidValueError, match="expected 3 seeds, got 2"):
        env.reset(seed=[1, 2])
    with pytest.raises(paxisim.InvalidValueError, match=r"expected actions of shape \(3, 2\), got \(2,\)"):
        env.step(np.zeros(2))
    assert gymnasium.spec("paxisim/SX-2mm-warp-v0").vector_entry_point is not None
    many = gymnasium.make_vec("paxisim/SQ-2mm-warp-v0", num_envs=2, method="NT", device="cpu")
    with pytest.raises(paxisim.InvalidValueError, match="call reset"):
        many.step(np.zeros((2, 3)))
    observation, _ = many.reset(seed=0)
    assert set(observation) == {"p", "privileged"}
    assert (observation["p"].abs().amax(dim=1) > 1e-3).all()


def test_other_parameters_need_robosuite_only_if_they_move_the_arm():
    InsertionEnv("SX-2mm", "DT", engine="native", parameters=Parameters(kp=100, grip_force=20))
    with pytest.raises(paxisim.MissingExtraError, match="robosuite"):
        InsertionEnv("SX-2mm", "DT", engine="native", parameters=Parameters(hole_depth=0.015))
    with pytest.raises(paxisim.MissingExtraError, match="robosuite"):
        InsertionEnv("SX-2mm", "DT")


def test_a_policy_is_evaluated(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(TASKS, "SX-2mm", replace(TASKS["SX-2mm"], max_steps=60))
    words = ["--run", str(POLICIES / "SX-2mm_DT_0"), "--out", str(tmp_path), "--engine", "warp"]
    assert command(evaluate, [*words, "--trials", "2"]) == 0
    assert "SX-2mm DT sim, warp: " in capsys.readouterr().out
    (path,) = tmp_path.glob("*.json")
    found = Result.load(path)
    assert (found.sensor, found.trials) == ("sim, warp", 2)
    assert found.success_rate > 0
    assert "mujoco-warp" in found.versions


def test_the_table_of_the_engines(monkeypatch, capsys):
    monkeypatch.setitem(TASKS, "SX-2mm", replace(TASKS["SX-2mm"], max_steps=10))
    assert command(engines, ["--other", "warp", "--tasks", "SX-2mm", "--episodes", "1"]) == 0
    cells = [float(cell) for cell in capsys.readouterr().out.splitlines()[-1].split(" | ")[1:3]]
    assert 0 < cells[0] <= cells[1] < 0.1
