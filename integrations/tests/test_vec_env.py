"""Vector environments: each member matches a single environment, with episodes as in stable-baselines3."""

import gymnasium
import numpy as np
import pytest
from paxisim_insertion import InsertionEnv
from paxisim_insertion.chains import stack_chains
from paxisim_insertion.vec_env import InsertionVecEnv
from paxisim_insertion.vector import InsertionVectorEnv

import paxisim
from paxisim import augment

FITTED = paxisim.GCS.around(
    paxisim.Chain([augment.Creep((0.1, 0.05), (0.3, 2.0)), augment.AxisGain((1.0, 1.0, 1.0))]),
    {"creep": {"amplitude": ([0.05, 0.0], [0.2, 0.1])}, "axis_gain": {"gain": ([0.5] * 3, [1.5] * 3)}},
)


def made(task, method, count, *, threads=1, **options):
    envs = [InsertionEnv(task, method, engine="native", **options) for _ in range(count)]
    return InsertionVecEnv(envs, reward_scale=0.05, threads=threads)


@pytest.mark.parametrize(
    ("task", "method", "options"), [("SX-2mm", "GCS", {}), ("SQ-1mm", "TF", {}), ("SX-2mm", "GCS", {"gcs": FITTED})]
)
def test_each_is_what_it_is_by_itself(task, method, options):
    many = made(task, method, 3, threads=2, **options)
    many.seed(11)
    observation = many.reset()
    alone = [InsertionEnv(task, method, engine="native", **options) for _ in range(3)]
    for index, env in enumerate(alone):
        expected, _ = env.reset(seed=11 + index)
        assert set(expected) == set(observation)
        for name, value in expected.items():
            np.testing.assert_allclose(observation[name][index], value, atol=1e-5, err_msg=name)
    rng = np.random.default_rng(0)
    for step in range(many.envs[0].task.max_steps + 5):
        actions = rng.normal(0, 0.3, (3, *many.action_space.shape)) - 0.1
        observation, reward, done, infos = many.step(actions)
        for index, env in enumerate(alone):
            expected, own, _, truncated, info = env.step(actions[index])
            assert reward[index] == pytest.approx(0.05 * own, rel=1e-4)
            assert infos[index]["is_success"] == info["is_success"]
            assert done[index] == truncated == (step == env.task.max_steps - 1)
            if truncated:
                for name, value in expected.items():
                    last = infos[index]["terminal_observation"][name]
                    np.testing.assert_allclose(last, value, atol=1e-5, err_msg=name)
                expected, _ = env.reset()
            for name, value in expected.items():
                np.testing.assert_allclose(observation[name][index], value, atol=1e-5, err_msg=name)
    many.close()


def test_what_is_told_of_an_episode():
    many = made("SX-2mm", "DT", 2)
    many.reset()
    total = np.zeros(2)
    for _ in range(120):
        _, reward, done, infos = many.step(np.full((2, 2), [0.0, -0.2]))
        total += reward
    assert done.all()
    for info, own in zip(infos, total, strict=True):
        assert info["TimeLimit.truncated"]
        assert info["episode"]["l"] == 120
        assert info["episode"]["r"] == pytest.approx(own / 0.05, rel=1e-4)
    assert many.get_attr("task")[1].name == "SX-2mm"
    many.set_attr("render_mode", "rgb_array", indices=1)
    assert many.get_attr("render_mode") == [None, "rgb_array"]
    assert many.env_method("begin", indices=[0])[0].members == ()
    many.close()


def test_chains_of_a_batch():
    rng = np.random.default_rng(5)
    chains = [paxisim.GCS().sample(rng) for _ in range(4)]
    force = rng.standard_normal((4, 2, 3, 6, 5)).astype(np.float32)
    together = stack_chains(chains)(force)
    for index, chain in enumerate(chains):
        np.testing.assert_allclose(together[index], chain(force[index]), atol=1e-6)
    same = stack_chains(chains[:1] * 3)
    assert same["taxel_gain"].gain.shape == chains[0]["taxel_gain"].gain.shape
    nested = stack_chains([paxisim.Chain([chain], ["inner"]) for chain in chains])
    np.testing.assert_array_equal(nested(force), together)


def test_environments_of_another_engine():
    with pytest.raises(paxisim.InvalidValueError, match="engine='native'"):
        InsertionVecEnv([])
    with pytest.raises(paxisim.InvalidValueError, match="engine='native'"):
        InsertionVecEnv([InsertionEnv("SX-2mm", "DT")])
    with pytest.raises(paxisim.InvalidValueError, match="without sensor="):
        made("SX-2mm", "DT", 1, terminate_on_success=True)


def test_the_same_as_gymnasium_takes_them():
    """Compare with gymnasium's vector of single environments, across the end of an episode."""
    many = gymnasium.make_vec("paxisim/SX-2mm-v0", num_envs=2, method="GCS", threads=2)
    assert isinstance(many, InsertionVectorEnv)
    own = gymnasium.make_vec(
        "paxisim/SX-2mm-v0",
        num_envs=2,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": gymnasium.vector.AutoresetMode.SAME_STEP},
        method="GCS",
        engine="native",
    )
    assert many.observation_space == own.observation_space
    assert many.action_space == own.action_space
    (found, told), (expected, _) = many.reset(seed=[3, 8]), own.reset(seed=[3, 8])
    assert not told["is_success"].any()
    rng = np.random.default_rng(1)
    for _ in range(122):
        for name, value in expected.items():
            np.testing.assert_allclose(found[name], value, atol=1e-5, err_msg=name)
        actions = rng.normal(0, 0.3, (2, 2)).astype(np.float32)
        found, *rest, infos = many.step(actions)
        expected, *own_rest, own_infos = own.step(actions)
        for value, other in zip(rest, own_rest, strict=True):
            np.testing.assert_allclose(value, other, rtol=1e-4)
        assert ("final_obs" in infos) == ("final_obs" in own_infos)
        if "final_obs" in infos:
            for last, own_last in zip(infos["final_obs"], own_infos["final_obs"], strict=True):
                np.testing.assert_allclose(last["tactile"], own_last["tactile"], atol=1e-5)
            np.testing.assert_array_equal(infos["final_info"]["is_success"], own_infos["final_info"]["is_success"])
        np.testing.assert_array_equal(infos["is_success"], own_infos["is_success"])
    again, _ = many.reset(seed=3)
    first, _ = own.reset(seed=[3, 4])
    np.testing.assert_allclose(again["tactile"], first["tactile"], atol=1e-5)
    many.close()
    own.close()
    with pytest.raises(paxisim.InvalidValueError, match="expected 2 seeds"):
        many.reset(seed=[1])
    with pytest.raises(paxisim.InvalidValueError, match="no render_mode"):
        gymnasium.make_vec("paxisim/SX-2mm-v0", num_envs=1, render_mode="rgb_array")
