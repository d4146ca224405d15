"""The TactileSensor of mjlab: it reads what MuJoCo reads, keeps its gel, redraws surfaces, and the example learns."""

import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

import paxisim
from paxisim.errors import InvalidValueError, UnsupportedError

pytest.importorskip("mjlab.envs")  # this also ignores the warnings of its imports
pytestmark = [
    pytest.mark.timeout(900),  # Warp compiles its kernels for a minute or two, once
    # of mjlab and of what it imports
    pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning"),
]

import torch  # noqa: E402
from mjlab.entity import EntityCfg  # noqa: E402
from mjlab.envs import ManagerBasedRlEnv, ManagerBasedRlEnvCfg, mdp  # noqa: E402
from mjlab.managers.event_manager import EventTermCfg  # noqa: E402
from mjlab.managers.scene_entity_config import SceneEntityCfg  # noqa: E402
from mjlab.scene import SceneCfg  # noqa: E402
from mjlab.sim import MujocoCfg, SimulationCfg  # noqa: E402

from paxisim.warp import RenewPads, TactileSensorCfg, fit_simulation, sizes  # noqa: E402

ROOT = Path(__file__).parents[2]
LAYOUT = paxisim.TaxelLayout(4, 3, 5e-3)
GEL = paxisim.Gel(modulus=80e3)
SENSORS = (TactileSensorCfg("tactile", "table", gel=GEL),)
TABLE = """<mujoco><worldbody><body name="table"/></worldbody></mujoco>"""
# its slides keep it from turning, which makes contacts jump
SLIDES = "".join(
    f'<joint name="{n}" type="slide" axis="{a}"/>' for n, a in {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}.items()
)
BLOCK = f"""<mujoco><worldbody><body name="block">{SLIDES}
  <geom type="box" size="0.008 0.012 0.01" mass="0.1"/></body></worldbody></mujoco>"""
START = (0, 0, 0.0099)  # of the block, which reaches 0.1 mm into the pad
HEAVIER = EventTermCfg(
    func=mdp.dr.pseudo_inertia,
    mode="reset",
    # not the massless body on which mjlab puts an entity without a free joint
    params={"asset_cfg": SceneEntityCfg("block", body_names=("block",)), "alpha_range": (0.1, 0.5)},
)


def table():
    return paxisim.attach(TABLE, LAYOUT, [paxisim.Mount("table", quat=(0, 1, 0, 0))]).spec


def configuration(worlds=3, *, fit=True, sensors=SENSORS, **events):
    """Return an environment in which a block of 100 g lies on a pad with box taxels."""
    start = EntityCfg.InitialStateCfg(pos=START)
    cfg = ManagerBasedRlEnvCfg(
        decimation=1,
        scene=SceneCfg(
            num_envs=worlds,
            entities={
                "table": EntityCfg(spec_fn=table),
                "block": EntityCfg(spec_fn=lambda: mujoco.MjSpec.from_string(BLOCK), init_state=start),
            },
            sensors=sensors,
        ),
        sim=SimulationCfg(mujoco=MujocoCfg(timestep=0.002, cone="elliptic", impratio=10)),
        events={"start": EventTermCfg(func=mdp.reset_scene_to_default, mode="reset"), **events},
        seed=0,
    )
    if fit:
        fit_simulation(cfg)
    return cfg


def environment(*args, **kwargs):
    env = ManagerBasedRlEnv(configuration(*args, **kwargs), "cpu")
    env.reset()
    return env


def stepped(env, steps):
    for _ in range(steps):
        env.step(torch.zeros(env.num_envs, 0))
    return env.scene["tactile"].data.numpy()


def pads_event(**params):
    return EventTermCfg(func=RenewPads, mode="reset", params={"sensor": "tactile", **params})


def test_every_world_reads_what_mujoco_reads():
    env = environment(pads=pads_event())
    sensor, model = env.scene["tactile"], env.sim.mj_model
    rng = np.random.default_rng(0)
    heights = sensor.pads.thickness[0] + rng.uniform(0, 0.1e-3, (3, 1, 4, 3))
    sensor.set_surface(heights[:1], torch.tensor([0]))
    sensor.set_surface(torch.tensor(heights[1:]), torch.tensor([1, 2]))
    force = stepped(env, 30)
    assert force.shape == (3, 1, 3, 4, 3)
    for world in range(3):
        own = env.scene.compile()
        env.cfg.sim.mujoco.apply(own)
        GEL.apply(own, sensor.pads)
        paxisim.set_surface(own, sensor.pads, heights[world])
        data = mujoco.MjData(own)
        data.mocap_pos[:] = [(0, 0, 0), START]
        for _ in range(30):
            mujoco.mj_step(own, data)
        mujoco.mj_forward(own, data)
        np.testing.assert_allclose(force[world], paxisim.TactileReadout(own, sensor.pads).read(data), atol=1e-4)
    assert np.ptp(force[:, 0, 2], axis=0).max() > 0.01
    np.testing.assert_array_equal(model.body_invweight0[sensor.pads.bodies], own.body_invweight0[sensor.pads.bodies])


def test_the_gel_survives_a_change_of_masses():
    """RenewPads comes first in the order of the events, and mjlab recomputes after all of them."""
    env = environment(pads=pads_event(), heavier=HEAVIER)
    force = stepped(env, 60)
    weight = 9.81 * env.sim.model.body_mass[:, -1].numpy()
    assert np.all(weight > 1.1 * 0.981)
    np.testing.assert_allclose(force[:, 0, 2].sum(axis=(1, 2)), weight, rtol=5e-3)
    env.scene["tactile"].check()


def test_a_gel_that_a_change_of_masses_undid_is_an_error():
    env = environment(heavier=HEAVIER)
    with pytest.raises(UnsupportedError, match=r"undone in 3 of 3 worlds.*in mjlab add the event paxisim.warp.RenewPa"):
        _ = env.scene["tactile"].data


def test_a_reset_redraws_the_surface_of_its_worlds():
    env = environment(pads=pads_event(surface=paxisim.GCS()))
    taxels = env.scene["tactile"].pads.geoms[0]
    before = env.sim.model.geom_size[:, taxels, 2].clone()
    assert len(np.unique(before.numpy().max(axis=1))) == 3
    env.reset(env_ids=torch.tensor([1]))
    after = env.sim.model.geom_size[:, taxels, 2]
    assert torch.equal(after[[0, 2]], before[[0, 2]])
    assert not torch.isclose(after[1], before[1]).all()
    assert np.isfinite(stepped(env, 2)).all()


def test_the_simulation_has_room_for_all_taxels():
    env = environment()
    model = env.sim.mj_model
    assert (env.cfg.sim.nconmax, env.cfg.sim.njmax) == sizes(model, env.scene["tactile"].pads)
    assert env.cfg.sim.mujoco.disableflags == ("nativeccd",)
    fit_simulation(env.cfg)
    assert env.cfg.sim.mujoco.disableflags == ("nativeccd",)


def test_too_little_room_is_an_error():
    cfg = configuration()
    cfg.sim.njmax = 100
    cfg.scene.entities["block"].init_state.pos = (0, 0, 0.011)  # the block falls onto the pad
    env = ManagerBasedRlEnv(cfg, "cpu")
    env.reset()
    with pytest.raises(UnsupportedError, match=r"larger njmax \(now 100; .*in mjlab set it in SimulationCfg"):
        stepped(env, 20)


def test_a_sensor_reads_the_pads_that_it_names():
    sensors = (TactileSensorCfg("tactile", "table", pads=("table_pad",)),)
    assert environment(sensors=sensors).scene["tactile"].pads.names == ("table/table_pad",)
    with pytest.raises(InvalidValueError, match="no pad 'table/thumb' in the model; its pads: table/table_pad"):
        configuration(sensors=(TactileSensorCfg("tactile", "table", pads=("thumb",)),))


def test_what_does_not_fit_is_said():
    for sensors, says in (
        ((TactileSensorCfg("tactile", "hand"),), "of entity 'hand', but the scene has 'table', 'block'"),
        ((TactileSensorCfg("tactile", "block"),), "no pads whose name begins with 'block/'"),
        ((), r"add a TactileSensorCfg to SceneCfg.sensors"),
    ):
        with pytest.raises(InvalidValueError, match=says):
            configuration(sensors=sensors)
    with pytest.raises(UnsupportedError, match=r"call paxisim.warp.fit_simulation\(cfg\) before"):
        ManagerBasedRlEnv(configuration(fit=False), "cpu")
    with pytest.raises(InvalidValueError, match="a tactile sensor, got 'touch'; the scene has 'tactile'"):
        environment(pads=EventTermCfg(func=RenewPads, mode="reset", params={"sensor": "touch"}))
    with pytest.raises(UnsupportedError, match=r"all worlds share one surface: add the event paxisim.warp.RenewPads"):
        environment().scene["tactile"].set_surface(np.full((3, 1, 4, 3), 1e-3))
    with pytest.raises(InvalidValueError, match=r"heights must have shape \(2, 1, 4, 3\), got \(3, 1, 4, 3\)"):
        environment(pads=pads_event()).scene["tactile"].set_surface(np.full((3, 1, 4, 3), 1e-3), torch.tensor([0, 2]))


def test_the_page_runs_as_printed():
    page = (ROOT / "docs" / "guides" / "warp.md").read_text(encoding="utf-8")
    block = re.search(r"^## mjlab\n.*?^```py\n(.*?)^```", page, re.MULTILINE | re.DOTALL)[1]
    scope = {}
    exec(compile(block, "warp.md", "exec"), scope)
    env = ManagerBasedRlEnv(scope["cfg"], "cpu")
    env.reset()
    for _ in range(60):
        observations, *_ = env.step(torch.zeros(4, 0))
    force = observations["actor"].reshape(4, 1, 3, 6, 5)
    np.testing.assert_allclose(force[:, 0, 2].sum(dim=(1, 2)), 0.981, rtol=0.02)


def test_the_hand_of_the_example_lifts_with_the_force_that_is_commanded():
    example = runpy.run_path(str(ROOT / "examples" / "mjlab_lift.py"))
    env = ManagerBasedRlEnv(example["environment"](3), "cpu")
    env.reset()
    for step in range(70):
        up = min(2.0, max(0, step - 20) / 20)
        env.step(torch.tensor([[1.5, up]] * 3))
    force = env.scene["tactile"].data
    np.testing.assert_allclose(force[:, :, 2].sum(dim=(-2, -1)), 6.0, rtol=0.01)
    np.testing.assert_allclose(example["lift"](env), 1.0)
    weight = 9.81 * env.sim.model.body_mass[:, -1]
    np.testing.assert_allclose(force[:, :, 1].sum(dim=(1, 2, 3)), weight, rtol=0.05)


def test_a_lost_or_diverged_peg_of_the_example_ends_its_episode_and_no_other():
    example = runpy.run_path(str(ROOT / "examples" / "mjlab_lift.py"))
    env = ManagerBasedRlEnv(example["environment"](3), "cpu")
    env.reset()
    env.sim.data.qpos[1, -4:] = torch.tensor([0.5**0.5, 0.5**0.5, 0.0, 0.0])  # on its side
    env.sim.data.qvel[2, -1] = float("nan")
    observations, _, ended, _, _ = env.step(torch.zeros(3, 2))
    assert ended.tolist() == [False, True, True]
    assert torch.isfinite(observations["actor"]).all()
    assert env.step(torch.zeros(3, 2))[2].tolist() == [False] * 3


def test_the_example_trains(tmp_path):
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    words = ["--worlds", "8", "--iterations", "2", "--device", "cpu"]
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples" / "mjlab_lift.py"), *words],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=800, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    losses = re.findall(r"Mean (?:value|surrogate) loss: +(\S+)", done.stdout)
    assert len(losses) == 4
    assert np.isfinite([float(loss) for loss in losses]).all()
    assert "tensor (8, 2, 3, 6, 5) on cpu" in done.stdout
    assert re.search(r"the peg rose by -?[\d.]+ mm on average", done.stdout)
    assert (tmp_path / "runs" / "mjlab_lift" / "model_1.pt").exists()
