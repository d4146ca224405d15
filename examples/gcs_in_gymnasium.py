"""A tactile gymnasium environment with the paper's GCS: uneven pads, and a random sensor in every episode.

The environment squeezes a peg in MuJoCo with the force that the agent sets. G, the uneven surface, is part of the
environment: each episode sets new heights of the taxels. C and S, the sensor, are a wrapper. Needs the extra train:

    python examples/gcs_in_gymnasium.py
"""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium import spaces

import paxisim
from paxisim.augment.gym import TactileTransform

LAYOUT = paxisim.TaxelLayout(3, 3, (8.7e-3, 7.5e-3))
WANTED = 7.0  # N per finger
LONGEST = 20  # steps per episode
SUBSTEPS = 25  # physics steps of 2 ms per step


class Squeeze(gymnasium.Env):
    """Hold a peg with 7 N: the action sets the grip force from 0 to 10 N, the observation is the tensor."""

    observation_space = spaces.Dict({"tactile": spaces.Box(-100, 100, (2, *LAYOUT.shape), np.float32)})
    action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self) -> None:
        """Build the scene; episodes change it in place."""
        gripper = paxisim.attach(files("paxisim").joinpath("data/two_finger_gripper.xml").read_text(), LAYOUT)
        scene = gripper.spec
        scene.option.cone, scene.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10
        peg = scene.worldbody.add_body(name="peg", pos=[0, 0, -0.07])
        peg.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.012, 0.012, 0.03])
        self.model = gripper.compile()
        self.pads = gripper.bind(self.model)
        self.readout = paxisim.TactileReadout(self.model, self.pads)
        self.data = mujoco.MjData(self.model)
        self.gcs = paxisim.GCS()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Begin an episode on a new surface."""
        super().reset(seed=seed)
        heights = self.gcs.sample_surface(self.np_random, layout=LAYOUT)
        paxisim.set_surface(self.model, self.pads, heights)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = 0.03  # start with the fingers near the peg
        self.steps = 0
        self.grip(1.0)
        return {"tactile": self.readout.read(self.data)}, {}

    def step(self, action):
        """Squeeze for 50 ms."""
        self.grip(5.0 * (1.0 + float(np.clip(action[0], -1, 1))))
        self.steps += 1
        force = self.readout.read(self.data)
        pressed = float(force[:, 2].sum()) / 2
        return {"tactile": force}, -abs(pressed - WANTED) / WANTED, False, self.steps >= LONGEST, {"pressed": pressed}

    def grip(self, newtons: float) -> None:
        """Set the motor force (N) and simulate 50 ms."""
        self.data.ctrl[0] = newtons
        mujoco.mj_step(self.model, self.data, SUBSTEPS)


def make_env() -> gymnasium.Env:
    """Return the environment with a random sensor; its tensor is the input of a policy."""
    return TactileTransform(Squeeze(), paxisim.GCS(), key="tactile", layout=LAYOUT)


def main() -> None:
    """Run two episodes with the same grip: the sensor differs, the force does not."""
    env = make_env()
    for seed in range(2):
        env.reset(seed=seed)
        for _ in range(LONGEST):
            observation, reward, _, truncated, info = env.step(np.zeros(1, np.float32))
        assert truncated
        print(
            f"episode {seed}: pressed with {info['pressed']:.2f} N, reward {reward:.2f}; the left pad's normal force:"
        )
        print(observation["tactile"][0, 2].round(2))


if __name__ == "__main__":
    main()
