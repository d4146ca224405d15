"""Grasp and lift with two pads in mjlab: PPO learns it from the tactile tensor, without seeing the object.

A two-finger hand on a vertical slide stands around a peg whose mass, place and angle change. The policy reads the
taxels and the hand's joints, and commands the squeeze and the height. Meant for a GPU; some worlds run on the CPU too,
where MuJoCo Warp first compiles for a minute or two. Needs the extra mjlab, in an environment without robosuite:

    python examples/mjlab_lift.py --worlds 4096 --iterations 200 --device cuda:0
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from importlib.resources import files
from typing import Any

import mujoco
import torch
import warp
from mjlab.actuator import BuiltinPositionActuatorCfg
from mjlab.actuator.actuator import TransmissionType
from mjlab.actuator.xml_actuator import XmlActuatorCfg
from mjlab.entity import EntityArticulationInfoCfg, EntityCfg
from mjlab.envs import ManagerBasedRlEnv, ManagerBasedRlEnvCfg, mdp
from mjlab.managers.event_manager import EventTermCfg
from mjlab.managers.observation_manager import ObservationGroupCfg, ObservationTermCfg
from mjlab.managers.reward_manager import RewardTermCfg
from mjlab.managers.scene_entity_config import SceneEntityCfg
from mjlab.managers.termination_manager import TerminationTermCfg
from mjlab.rl import (
    MjlabOnPolicyRunner,
    RslRlModelCfg,
    RslRlOnPolicyRunnerCfg,
    RslRlPpoAlgorithmCfg,
    RslRlVecEnvWrapper,
)
from mjlab.scene import SceneCfg
from mjlab.sim import MujocoCfg, SimulationCfg

import paxisim
from paxisim.warp import RenewPads, TactileSensorCfg, fit_simulation

REST = 0.03  # height of the peg's centre on the floor (m)
GOAL = 0.08  # height by which it should rise (m)
FIRM, HARD = 2.0, 10.0  # normal force of each pad (N): enough to count as a grasp, and too much
HAND, PEG = SceneEntityCfg("hand"), SceneEntityCfg("peg")


def hand() -> mujoco.MjSpec:
    """Return the two-finger gripper on a vertical slide, with 6x5 taxels a finger, one contact each."""
    spec = mujoco.MjSpec.from_string(files("paxisim").joinpath("data/two_finger_gripper.xml").read_text())
    spec.body("hand").add_joint(name="lift", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1], range=[-0.01, 0.2])
    layout = paxisim.sensor("paxini-gen1-l4629").layout.pool(2, 2)
    return paxisim.attach(spec, paxisim.Pad(layout, taxels="spheres")).spec


def peg() -> mujoco.MjSpec:
    """Return a box of 100 g."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="peg")
    body.add_freejoint()
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.012, 0.009, REST], mass=0.1)
    return spec


def add_floor(spec: mujoco.MjSpec) -> None:
    """Add a floor to the scene."""
    spec.worldbody.add_geom(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.5, 0.5, 0.1])


def tactile(env: ManagerBasedRlEnv) -> torch.Tensor:
    """Return the tensor of both pads (N), flat; positive and negative forces up to some newtons."""
    return env.scene["tactile"].data.flatten(1)


def weaker_grip(env: ManagerBasedRlEnv) -> torch.Tensor:
    """Return the normal force of the pad that is pressed less (N)."""
    return env.scene["tactile"].data[:, :, 2].sum(dim=(-2, -1)).amin(dim=1)


def grasp(env: ManagerBasedRlEnv) -> torch.Tensor:
    """Reward both pads for touching, up to a firm grasp."""
    return (weaker_grip(env) / FIRM).clamp(0, 1)


def crush(env: ManagerBasedRlEnv) -> torch.Tensor:
    """Return how far the grasp is beyond a hard one."""
    return (weaker_grip(env) / HARD - 1).clamp(0, 2)


def rise(env: ManagerBasedRlEnv) -> torch.Tensor:
    """Return how far the peg has risen, as a share of the goal."""
    return (env.scene["peg"].data.root_link_pos_w[:, 2:3] - REST) / GOAL


def lift(env: ManagerBasedRlEnv) -> torch.Tensor:
    """Reward the peg's rise, up to the goal."""
    return rise(env)[:, 0].clamp(0, 1)


def environment(worlds: int) -> ManagerBasedRlEnvCfg:
    """Return the task: scene, observations, actions, rewards and what changes from episode to episode."""
    lift_motor = BuiltinPositionActuatorCfg(target_names_expr=("lift",), stiffness=1000, damping=80, effort_limit=60)
    squeeze_motor = XmlActuatorCfg(target_names_expr=("squeeze",), transmission_type=TransmissionType.TENDON)
    slides = {"lift": 0.0, ".*_slide": 0.03}
    entities = {
        "hand": EntityCfg(
            spec_fn=hand,
            init_state=EntityCfg.InitialStateCfg(pos=(0, 0, 0.1), joint_pos=slides),
            articulation=EntityArticulationInfoCfg(actuators=(lift_motor, squeeze_motor)),
        ),
        "peg": EntityCfg(spec_fn=peg, init_state=EntityCfg.InitialStateCfg(pos=(0, 0, REST))),
    }
    terms: dict[str, Any] = {
        "tactile": ObservationTermCfg(func=tactile),
        "joint_pos": ObservationTermCfg(func=mdp.joint_pos_rel, params={"asset_cfg": HAND}),
        "joint_vel": ObservationTermCfg(func=mdp.joint_vel_rel, params={"asset_cfg": HAND}),
        "action": ObservationTermCfg(func=mdp.last_action),
    }
    around = {"x": (-0.002, 0.002), "y": (-0.004, 0.004), "yaw": (-0.05, 0.05)}
    cfg = ManagerBasedRlEnvCfg(
        # no terrain: all worlds lie at the origin, where float32 is finest
        scene=SceneCfg(
            num_envs=worlds, entities=entities, sensors=(TactileSensorCfg("tactile", "hand"),), spec_fn=add_floor
        ),
        sim=SimulationCfg(mujoco=MujocoCfg(timestep=0.004, cone="elliptic", impratio=10, iterations=20)),
        decimation=5,
        episode_length_s=2.0,
        observations={
            "actor": ObservationGroupCfg(terms),
            "critic": ObservationGroupCfg(terms | {"rise": ObservationTermCfg(func=rise)}),
        },
        actions={
            "squeeze": mdp.TendonEffortActionCfg(entity_name="hand", actuator_names=("squeeze",), scale=4.0),
            "height": mdp.JointPositionActionCfg(entity_name="hand", actuator_names=("lift",), scale=0.05),
        },
        rewards={
            "grasp": RewardTermCfg(func=grasp, weight=1.0),
            "lift": RewardTermCfg(func=lift, weight=5.0),
            "crush": RewardTermCfg(func=crush, weight=-1.0),
            "smooth": RewardTermCfg(func=mdp.action_rate_l2, weight=-0.01),
        },
        terminations={
            "time_out": TerminationTermCfg(func=mdp.time_out, time_out=True),
            # a lost peg ends the episode: in MuJoCo Warp 3.11 a body that spins freely gains energy until it is NaN
            "toppled": TerminationTermCfg(func=mdp.bad_orientation, params={"limit_angle": 1.0, "asset_cfg": PEG}),
            "diverged": TerminationTermCfg(func=mdp.nan_detection),
        },
        events={
            # half to twice the mass; mjlab then recomputes what the gel rests on, and RenewPads restores it
            "mass": EventTermCfg(
                func=mdp.dr.pseudo_inertia, mode="startup", params={"asset_cfg": PEG, "alpha_range": (-0.35, 0.35)}
            ),
            "start": EventTermCfg(func=mdp.reset_scene_to_default, mode="reset"),
            "peg": EventTermCfg(
                func=mdp.reset_root_state_uniform, mode="reset", params={"asset_cfg": PEG, "pose_range": around}
            ),
            "pads": EventTermCfg(func=RenewPads, mode="reset", params={"sensor": "tactile", "surface": paxisim.GCS()}),
        },
        seed=0,
    )
    fit_simulation(cfg)
    return cfg


def ppo(iterations: int) -> RslRlOnPolicyRunnerCfg:
    """Return rsl_rl's PPO with networks and rates for this task."""
    gaussian = {"class_name": "GaussianDistribution", "init_std": 1.0, "std_type": "scalar"}
    return RslRlOnPolicyRunnerCfg(
        actor=RslRlModelCfg(hidden_dims=(128, 64), obs_normalization=True, distribution_cfg=gaussian),
        critic=RslRlModelCfg(hidden_dims=(128, 64), obs_normalization=True),
        algorithm=RslRlPpoAlgorithmCfg(),
        num_steps_per_env=25,
        max_iterations=iterations,
        experiment_name="mjlab_lift",
        logger="tensorboard",
        upload_model=False,
    )


def evaluate(env: RslRlVecEnvWrapper, policy: Any) -> None:
    """Run one episode without exploration, and print what the pads read before its end and how far the pegs rose."""
    observations, _ = env.reset()
    held = torch.ones(env.num_envs, dtype=torch.bool, device=env.device)
    with torch.inference_mode():
        for _ in range(env.max_episode_length - 1):
            observations, _, ended, _ = env.step(policy(observations))
            held &= ~ended.bool()  # before the time is over, an episode ends with a lost peg
    env.unwrapped.scene["tactile"].check()  # waits for the device, so not in every step
    force = env.unwrapped.scene["tactile"].data
    total = force[:, :, 2].sum(dim=(-2, -1)).mean(dim=0)
    print(f"tensor {tuple(force.shape)} on {force.device}")
    print(f"the pads read {total[0]:.2f} N and {total[1]:.2f} N on average")
    risen = lift(env.unwrapped) * held
    there = risen.ge(0.9).float().mean()
    print(f"the peg rose by {1e3 * GOAL * risen.mean():.1f} mm on average, to the goal in {there:.0%} of the worlds")


def main() -> None:
    """Train and evaluate."""
    parser = argparse.ArgumentParser(description="Grasp and lift with two pads in mjlab.")
    parser.add_argument("--worlds", type=int, default=4096)
    parser.add_argument("--iterations", type=int, default=200)
    parser.add_argument("--device", default="cuda:0" if torch.cuda.is_available() else "cpu")
    parser.add_argument("--output", default="runs/mjlab_lift", help="folder for checkpoints and curves (TensorBoard)")
    arguments = parser.parse_args()
    warp.config.log_level = warp.LOG_WARNING  # otherwise it names every kernel that it loads
    env = RslRlVecEnvWrapper(ManagerBasedRlEnv(environment(arguments.worlds), arguments.device))
    agent = asdict(ppo(arguments.iterations))
    runner = MjlabOnPolicyRunner(env, agent, arguments.output, arguments.device)
    runner.learn(arguments.iterations, init_at_random_ep_len=True)
    evaluate(env, runner.get_inference_policy(arguments.device))
    env.close()


if __name__ == "__main__":
    main()
