"""The vector environment: each member matches a single environment, with episodes as in stable-baselines3."""

import numpy as np
import pytest
from paxisim_insertion import InsertionEnv
from paxisim_insertion.chains import stack_chains
from paxisim_insertion.vec_env import InsertionVecEnv

import paxisim
from paxisim import augment

FITTED = paxisim.GCS.around(
    paxisim.Chain([augment.Creep((0.1, 0.05), (0.3, 2.0)), augment.AxisGain((1.0, 1.0, 1.0))]),
    {"creep": {"amplitude": ([0.05, 0.0], [0.2, 0.1])}, "axis_gain": {"gain": ([0.5] * 3, [1.5] * 3)}},
)


def singles(task, method, count, **options):
    return [InsertionEnv(task, method, engine="native", **options) for _ in range(count)]


@pytest.mark.parametrize(
    ("task", "method", "options"), [("SX-2mm", "GCS", {}), ("SQ-1mm", "TF", {}), ("SX-2mm", "GCS", {"gcs": FITTED})]
)
def test_each_is_what_it_is_by_itself(task, method, options):
    many = InsertionVecEnv(singles(task, method, 3, **options), reward_scale=0.05)
    many.seed(11)
    observation = many.reset()
    alone = singles(task, method, 3, **options)
    expected = [env.reset(seed=11 + index)[0] for index, env in enumerate(alone)]
    returns = np.zeros(3)
    rng = np.random.default_rng(0)
    steps = many.envs[0].task.max_steps
    for step in range(steps + 3):
        for index, single in enumerate(expected):
            assert set(single) == set(observation)
            for name, value in single.items():
                np.testing.assert_allclose(observation[name][index], value, atol=1e-5, err_msg=name)
        actions = rng.normal(0, 0.3, (3, *many.action_space.shape)) - 0.1
        observation, reward, done, infos = many.step(actions)
        for index, env in enumerate(alone):
            expected[index], own, _, truncated, info = env.step(actions[index])
            returns[index] += own
            assert reward[index] == pytest.approx(0.05 * own, rel=1e-4)
            assert infos[index]["is_success"] == info["is_success"]
            assert done[index] == truncated == (step == steps - 1)
            if truncated:
                for name, value in expected[index].items():
                    last = infos[index]["terminal_observation"][name]
                    np.testing.assert_allclose(last, value, atol=1e-5, err_msg=name)
                assert infos[index]["TimeLimit.truncated"]
                assert infos[index]["episode"]["l"] == steps
                assert infos[index]["episode"]["r"] == pytest.approx(returns[index], rel=1e-4)
                expected[index], _ = env.reset()
    many.close()


def test_attributes_and_methods_of_the_members():
    many = InsertionVecEnv(singles("SX-2mm", "DT", 2))
    assert many.get_attr("task")[1].name == "SX-2mm"
    many.set_attr("render_mode", "rgb_array", indices=1)
    assert many.get_attr("render_mode") == [None, "rgb_array"]
    assert many.env_method("begin", indices=[0])[0].members == ()
    assert many.env_is_wrapped(object) == [False, False]


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


def test_environments_of_another_kind():
    for envs in ([], [InsertionEnv("SX-2mm", "DT")]):
        with pytest.raises(paxisim.InvalidValueError, match="engine='native'"):
            InsertionVecEnv(envs)
    for options in ({"terminate_on_success": True}, {"gap": True}, {"sensor": paxisim.Chain()}):
        with pytest.raises(paxisim.InvalidValueError, match="without sensor="):
            InsertionVecEnv(singles("SX-2mm", "DT", 1, **options))
