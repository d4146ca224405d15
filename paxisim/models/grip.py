"""Grip: how one end effector of a robot closes, as `paxisim.attach` finds it and `paxisim.squeeze` repeats it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from paxisim.models.links import common_body

_ANGLE, _LENGTH = 0.01, 1e-4  # rad, m: smallest travel of a joint that closes


@dataclass(frozen=True, eq=False)
class Grip:
    """The closing of one end effector with pads; everything else of the robot is at rest.

    The controls and poses are those of the model compiled from the spec of the `paxisim.TactileGripper`.

    Attributes:
        pads: Indices of the end effector's pads on the ``pads`` axis.
        actuators: Ids of the actuators that close it.
        open_ctrl: ``(nu,)`` controls that open it.
        close_ctrl: ``(nu,)`` controls that close it.
        qpos: ``(frames, nq)`` poses of the whole robot from open to closed, without an object in between.
        partners: For each of `pads`, the indices on the ``pads`` axis of the pads that it closes against; empty if
            there are none.
    """

    pads: tuple[int, ...]
    actuators: tuple[int, ...]
    open_ctrl: NDArray[np.float64]
    close_ctrl: NDArray[np.float64]
    qpos: NDArray[np.float64]
    partners: tuple[tuple[int, ...], ...]

    def __repr__(self) -> str:
        """One line without the poses."""
        return f"Grip(pads={self.pads}, actuators={self.actuators}, {len(self.qpos)} poses)"

    def reordered(self, order: Sequence[int]) -> Grip:
        """Return the grip after the pads were put in another order; ``order[i]`` is the old index of pad i."""
        new = {old: i for i, old in enumerate(order)}
        partners = tuple(tuple(new[p] for p in some) for some in self.partners)
        return replace(self, pads=tuple(new[p] for p in self.pads), partners=partners)


def end_effector(model: mujoco.MjModel, grip: Grip) -> NDArray[np.bool_]:
    """Return which bodies hang on the palm: the lowest body that carries everything that the closing moves."""
    ends = np.append(model.jnt_qposadr, model.nq)
    travel = np.ptp(grip.qpos, axis=0)
    least = np.where(model.jnt_type == int(mujoco.mjtJoint.mjJNT_SLIDE), _LENGTH, _ANGLE)
    moved = [j for j in range(model.njnt) if np.any(travel[ends[j] : ends[j + 1]] > least[j])]
    palm = common_body(model, (int(model.jnt_bodyid[j]) for j in moved))
    hanging = below(model, palm)
    hanging[palm] = False
    return hanging


def below(model: mujoco.MjModel, root: int) -> NDArray[np.bool_]:
    """Return which bodies are `root` or hang on it."""
    found = np.zeros(model.nbody, dtype=bool)
    for body in range(root, model.nbody):
        found[body] = body == root or found[model.body_parentid[body]]
    return found
