"""The gymnasium wrapper, which transforms the tactile part of an observation."""

import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from paxisim import GCS, Chain, InvalidValueError, TaxelLayout, UnknownNameError
from paxisim.augment import AxisGain, Creep, LowPass, TemperatureDrift, Transform

gymnasium = pytest.importorskip("gymnasium")
TactileTransform = pytest.importorskip("paxisim.augment.gym").TactileTransform
SHAPE = (2, 3, 6, 5)


class Touch(gymnasium.Env):
    """Environment that reads i + 1 N in frame i, counted from 0; a Dict also holds the finger opening."""

    def __init__(self, as_dict=True, dtype=np.float32, shape=SHAPE, gives=None, opening=()):
        box = gymnasium.spaces.Box(0, 10, shape, dtype)
        self.gives = gives or dtype
        self.as_dict = as_dict
        self.observation_space = box
        if as_dict:
            opening = gymnasium.spaces.Box(0, 1, opening, np.float32)
            self.observation_space = gymnasium.spaces.Dict({"touch": box, "opening": opening})
        self.action_space = gymnasium.spaces.Discrete(2)

    def observe(self):
        force = np.full(self.observation_space["touch"].shape if self.as_dict else SHAPE, self.i + 1, self.gives)
        if not self.as_dict:
            return force
        return {"touch": force, "opening": np.full(self.observation_space["opening"].shape, 0.1 * self.i, np.float32)}

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.i = 0
        return self.observe(), {"temperature": 20.0}

    def step(self, action):
        self.i += 1
        return self.observe(), 0.5, self.i == 5, False, {"temperature": 20.0 + self.i}


def touch(result):
    return result[0]["touch"]


def test_a_box():
    env = TactileTransform(Touch(as_dict=False), AxisGain((2.0, 1.0, 0.5)))
    observation, info = env.reset(seed=0)
    assert info == {"temperature": 20.0}
    np.testing.assert_array_equal(observation, np.broadcast_to(np.array([2, 1, 0.5])[:, None, None], SHAPE))
    assert env.observation_space == gymnasium.spaces.Box(-np.inf, np.inf, SHAPE, np.float32)
    observation, reward, terminated, truncated, _ = env.step(0)
    np.testing.assert_array_equal(observation[0, :, 0, 0], [4, 2, 1])
    assert (reward, terminated, truncated) == (0.5, False, False)


def test_an_entry_of_a_dict_leaves_the_others():
    inner = Touch(gives=np.float64)
    env = TactileTransform(inner, GCS(), key="touch")
    observation, _ = env.reset(seed=0)
    assert observation in env.observation_space
    assert env.observation_space["opening"] == inner.observation_space["opening"]
    assert inner.observation_space["touch"].high.max() == 10, "the inner space is unchanged"
    assert observation["opening"] == 0
    assert observation["touch"].dtype == np.float32, "that of the space, whatever the environment gives"


@pytest.mark.filterwarnings(
    "ignore:.*is different from the unwrapped version", "ignore:.*infinity. This is probably too"
)
def test_gymnasium_finds_nothing_to_complain_of():
    from gymnasium.utils.env_checker import check_env

    by_opening = TemperatureDrift(gain=-1e-3, covariate="opening")
    for env, transform in ((Touch(), GCS()), (Touch(opening=(1,)), by_opening)):
        check_env(TactileTransform(env, transform, key="touch"), skip_render_check=True)


FITTED = GCS.around(Chain([Creep((0.1,), (0.5,))]), {"creep": {"amplitude": ([0.1], [0.3])}})


@pytest.mark.parametrize("source", [GCS(), FITTED, lambda rng: AxisGain(rng.uniform(0.5, 1.5, 3))])
def test_parameters_are_drawn_at_each_reset_and_kept_for_the_episode(source):
    """The seed of a reset reproduces all that follows."""

    def run(env, seed):
        return [touch(env.reset(seed=seed)), touch(env.step(0)), touch(env.reset()), touch(env.step(0))]

    a, b = (TactileTransform(Touch(), source, key="touch", dt=0.05, seed=i) for i in range(2))
    first = run(a, 7)
    np.testing.assert_array_equal(first, run(b, 7))
    assert not np.allclose(first[0], first[2])
    assert not np.allclose(run(a, 8), first)
    c, d = (TactileTransform(Touch(), source, key="touch", dt=0.05, seed=3) for _ in range(2))
    np.testing.assert_array_equal(run(c, None), run(d, None))
    drawn = c.transform
    assert isinstance(drawn, Transform)
    c.step(0)
    assert c.transform is drawn


def test_memory_is_stepped_with_the_environment():
    env = TactileTransform(Touch(), Chain([AxisGain(), LowPass(0.1)]), key="touch", dt=0.05)
    felt = [touch(env.reset()), *(touch(env.step(0)) for _ in range(4))]
    raw = np.stack([np.full(SHAPE, i + 1, np.float32) for i in range(5)])
    np.testing.assert_allclose(np.stack(felt), LowPass(0.1).run(raw, 0.05 * np.arange(5)), rtol=1e-6)
    np.testing.assert_allclose(touch(env.reset()), 1, err_msg="a new episode must not remember the previous one")


@dataclass(frozen=True, eq=False)
class Warm(Transform):
    """Adds the temperature to the reading."""

    covariate: str = "temperature"

    def apply(self, x, covariates):
        return x + np.asarray(covariates[self.covariate], dtype=x.dtype)


def test_covariates_come_from_the_observation_or_info():
    env = TactileTransform(Touch(), Warm(), key="touch")
    np.testing.assert_allclose(touch(env.reset()), 21)
    np.testing.assert_allclose(touch(env.step(0)), 23)
    env = TactileTransform(Touch(), Warm(), key="touch", covariates={"temperature": "opening"})
    env.reset()
    np.testing.assert_allclose(touch(env.step(0)), 2.1)
    with pytest.raises(UnknownNameError, match="'heat'"):
        TactileTransform(Touch(), Warm("heat"), key="touch").reset()


def test_what_is_of_several_environments_is_refused():
    several = TemperatureDrift(gain=-1e-3, covariate="opening")
    for env, transform in ((Touch(), AxisGain(np.ones((4, 3)))), (Touch(opening=(2,)), several)):
        with pytest.raises(InvalidValueError, match=r"of an observation of shape \(2, 3, 6, 5\): its parameters and"):
            TactileTransform(env, transform, key="touch").reset()


@pytest.mark.parametrize(
    ("env", "options", "words"),
    [
        (Touch(), {}, "name its entry with key="),
        (Touch(as_dict=False), {"key": "touch"}, "needs a Dict"),
        (Touch(), {"key": "tuch"}, "did you mean 'touch'"),
        (Touch(), {"key": "opening"}, r"float Box of shape \(pads, 3, rows, cols\)"),
        (Touch(dtype=np.uint8), {"key": "touch"}, "float Box"),
        (Touch(shape=(3, 6, 5)), {"key": "touch"}, r"\(pads, 3, rows, cols\)"),
        (Touch(), {"key": "touch", "dt": 0.0}, "dt must be positive"),
        (Touch(), {"key": "touch", "layout": TaxelLayout(2, 2, 1e-3)}, "layout has 2x2 taxels, the observation 6x5"),
        (Touch(), {"key": "touch", "transform": LowPass(0.1)}, "LowPass has memory and needs dt"),
    ],
)
def test_bad_arguments(env, options, words):
    with pytest.raises((InvalidValueError, UnknownNameError), match=words):
        TactileTransform(env, **{"transform": GCS()} | options)


@pytest.mark.parametrize(("module", "extra", "imports"), [("gymnasium", "train", "gym"), ("torch", "torch", "torch")])
def test_without_the_module_the_error_names_the_extra(module, extra, imports):
    code = f"""
import sys
sys.modules["{module}"] = None
import paxisim.augment.gcs, paxisim.augment.history
from paxisim.errors import MissingExtraError
try:
    import paxisim.augment.{imports}
except MissingExtraError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert f"pip install 'paxisim[{extra}]'" in done.stdout
