"""``python -m paxisim_insertion.interpret --run integrations/policies/SY-2mm_GCS_0``: what a policy makes of a touch.

The paper's "Policy Interpretation": on SY-2mm the shear turns on both pads, in opposite senses, when the peg stands on
one rim of the groove, and the other way round on the other; on SX-2mm the normal force shifts down on the pad of the
side on which the peg stands. The policy then moves away from that rim.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import paxisim

from .env import InsertionEnv
from .evaluate import FIRST_SEED
from .run import Run
from .shell import command
from .trained import Trained

ON_RIM = 1.5e-3
"""So near to the base's upper face (m) is the lowest corner of a peg that stands on a rim; the rim is under the peg."""

PUSHED = 1.0
"""Least change (N) of the vertical force on both pads together, since the episode began, that is a contact."""


@dataclass(frozen=True)
class Touch:
    """A step in which the peg stands on a rim of the groove.

    Attributes:
        aside: How far the peg is from the middle of the groove (m), along the axis that the policy moves along.
        turn: ``(pads,)`` torque of the change of shear about the middle of each pad (N mm), counterclockwise to who
            looks at the pad.
        shift: ``(pads,)`` how far the centre of the normal force has moved up on each pad (mm).
        action: The policy's action along that axis, in [-1, 1].
    """

    aside: float
    turn: NDArray[np.floating]
    shift: NDArray[np.floating]
    action: float


def interpret(run: Path, *, trials: int = 50, other_versions: bool = False) -> None:
    """Print what the pads feel on either rim of the groove, and what the policy does then.

    Args:
        run: Folder of a run on SX-2mm or SY-2mm.
        trials: Episodes, those of the evaluation.
        other_versions: Go on although the software's versions are not the run's.
    """
    if trials < 1:
        raise paxisim.InvalidValueError(f"expected at least one trial, got {trials}")
    this = Run.open(run, other_versions=other_versions)
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
    """The steps of an episode in which the peg stands on a rim."""
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
    assert env.scene.tactile is not None
    _, data = env.scene.model_and_data
    ups = data.xmat[env.scene.tactile.pads.bodies].reshape(-1, 3, 3)[:, 2]  # the world's z in the frame of each pad
    now, then = (force.reshape(len(ups), 3, -1) for force in (env.raw, before))
    change = now - then
    aside = float(position[axis] - env.scene.base[axis])
    stands = abs(lowest) < ON_RIM and abs(aside) < half and not env.scene.insertion.engaged
    if not stands or abs(np.einsum("pan,pa->", change, ups)) < PUSHED:
        return None
    x, y, _ = env.layout.positions.T
    turn = 1e3 * (y * change[:, 0] - x * change[:, 1]).sum(axis=-1)  # a pad's z points into it
    heights = ups @ env.layout.positions.T
    middles = [(force[:, 2] * heights).sum(axis=-1) / force[:, 2].sum(axis=-1) for force in (now, then)]
    return Touch(aside, turn, 1e3 * (middles[0] - middles[1]), action)


def _spread(values: NDArray[np.floating] | list[float]) -> str:
    return f"{np.mean(values):.2f} ± {np.std(values):.2f}"


if __name__ == "__main__":
    sys.exit(command(interpret))
