"""``python -m paxisim_lab.interpret --run integrations/policies/SY-2mm_GCS_0``: how a policy reacts to touch.

This reproduces the paper's "Policy Interpretation". On SY-2mm the shear rotates in opposite senses on the two pads when
the peg stands on one rim of the groove, and the senses swap on the other rim. On SX-2mm the normal force shifts down on
the pad on the side where the peg stands. The policy then moves away from that rim.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from paxisim_insertion.env import InsertionEnv
from paxisim_insertion.policy import Trained
from paxisim_insertion.results import FIRST_SEED
from paxisim_insertion.run import Run
from paxisim_insertion.shell import command

import paxisim

ON_RIM = 1.5e-3
"""Largest distance (m) from the base's upper face to the lowest corner of a peg that stands on a rim."""

PUSHED = 1.0
"""Contact threshold: change (N) of the vertical force since the start of the episode, summed over both pads."""


@dataclass(frozen=True)
class Touch:
    """A step in which the peg stands on a rim of the groove.

    Attributes:
        aside: Offset of the peg from the middle of the groove (m), along the axis that the policy controls.
        turn: ``(pads,)`` torque of the shear change about the middle of each pad (N mm), counterclockwise when facing
            the pad.
        shift: ``(pads,)`` upward displacement of the centre of the normal force on each pad (mm).
        action: The policy's action along that axis, in [-1, 1].
    """

    aside: float
    turn: NDArray[np.floating]
    shift: NDArray[np.floating]
    action: float


def interpret(run: Path, *, trials: int = 50) -> None:
    """Print what the pads measure on either rim of the groove, and how the policy reacts.

    Args:
        run: Folder of a run on SX-2mm or SY-2mm.
        trials: Number of episodes; they are those of the evaluation.
    """
    if trials < 1:
        raise paxisim.InvalidValueError(f"expected at least one trial, got {trials}")
    this = Run.open(run)
    env = this.insertion_env(terminate_on_success=True)
    if not env.task.hole_is_hidden:
        raise paxisim.InvalidValueError(f"expected a run on SX-2mm or SY-2mm, got one on {env.task.name}")
    try:
        trained = this.policy(env)
        found = [touch for trial in range(trials) for touch in touches(env, trained, FIRST_SEED + trial)]
    finally:
        env.close()
    axis = "xyz"[env.task.axes[0]]
    print(f"{this.task} {this.name}: {len(found)} steps on a rim in {trials} episodes; mean and deviation\n")
    print(
        f"| peg is off along {axis} | steps | turn of the shear (N mm), pads | rise of the normal force (mm), pads ",
        end="",
    )
    print(f"| action along {axis} | towards the groove |\n|---|---|---|---|---|---|")
    for side in (-1, 1):
        these = [touch for touch in found if np.sign(touch.aside) == side]
        if not these:
            continue
        aside = [1e3 * touch.aside for touch in these]
        back = np.mean([np.sign(touch.action) == -side for touch in these])
        pairs = (", ".join(map(_spread, np.transpose([getattr(t, name) for t in these]))) for name in ("turn", "shift"))
        action = _spread([touch.action for touch in these])
        print(f"| {_spread(aside)} mm | {len(these)} | {' | '.join(pairs)} | {action} | {back:.2f} |")


def touches(env: InsertionEnv, trained: Trained, seed: int) -> list[Touch]:
    """Return the steps of an episode in which the peg stands on a rim."""
    observation, _ = env.reset(seed=seed)
    axis, found = env.task.axes[0], []
    before = env.raw
    done = False
    while not done:
        action = trained.act(observation)
        touch = _touch(env, before, float(action[0]), axis)
        if touch is not None:
            found.append(touch)
        observation, _, terminated, truncated, _ = env.step(action)
        done = terminated or truncated
    return found


def _touch(env: InsertionEnv, before: NDArray[np.float32], action: float, axis: int) -> Touch | None:
    position, rotation = env.scene.peg
    half = env.parameters.peg_size / 2
    corners = position + [rotation @ [x, y, 0] for x in (-half, half) for y in (-half, half)]
    lowest = min(corner[2] for corner in corners) - env.scene.hole_top[2]
    _, data = env.scene.model_and_data
    ups = data.xmat[env.scene.tactile.pads.bodies].reshape(-1, 3, 3)[:, 2]  # the world's z in the frame of each pad
    now, then = (force.reshape(len(ups), 3, -1) for force in (env.raw, before))
    change = now - then
    aside = float(position[axis] - env.scene.base[axis])
    stands = abs(lowest) < ON_RIM and abs(aside) < half and not env.scene.insertion.engaged
    if not stands or abs(np.einsum("pan,pa->", change, ups)) < PUSHED:
        return None
    x, y, _ = env.layout.positions.T
    turn = 1e3 * (y * change[:, 0] - x * change[:, 1]).sum(axis=-1)  # the z axis of a pad points into the pad
    heights = ups @ env.layout.positions.T
    middles = [(force[:, 2] * heights).sum(axis=-1) / force[:, 2].sum(axis=-1) for force in (now, then)]
    return Touch(aside, turn, 1e3 * (middles[0] - middles[1]), action)


def _spread(values: NDArray[np.floating] | list[float]) -> str:
    return f"{np.mean(values):.2f} ± {np.std(values):.2f}"


if __name__ == "__main__":
    sys.exit(command(interpret))
