"""Arm: what robosuite's Panda is to the thing that its fingertip pushes, as a few matrices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from .robosuite_scene import InsertionScene
from .tasks import TASKS, Parameters


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm in one pose, seen from its fingertip.

    Velocities of the fingertip are ``(6,)``, linear (m/s) and angular (rad/s), in the world.

    Attributes:
        inertia: ``(6, 6)`` operational-space inertia at the fingertip (kg, kg m, kg m^2), the gripper included.
        rates: ``(7, 6)`` speeds of the joints (rad/s) for a velocity of the fingertip, while the arm is pushed by
            nothing but the fingertip.
        friction: ``(7,)`` dry friction of the joints (N m).
        damping: ``(7,)`` viscous friction of the joints (N m s).
    """

    inertia: NDArray[np.floating]
    rates: NDArray[np.floating]
    friction: NDArray[np.floating]
    damping: NDArray[np.floating]

    @property
    def impedance(self) -> NDArray[np.floating]:
        """``(6, 6)`` the inertia that robosuite's controller multiplies errors by: position and rotation apart."""
        mobility, apart = np.linalg.inv(self.inertia), np.zeros((6, 6))
        for part in (slice(0, 3), slice(3, 6)):
            apart[part, part] = np.linalg.inv(mobility[part, part])
        return apart


@cache
def measure_arm(parameters: Parameters) -> Arm:
    """The Panda of robosuite with its gripper, the fingertip where an episode begins on average.

    Over the tasks' workspace an entry of its inertia changes by a few percent.
    """
    scene = InsertionScene(TASKS["SX-2mm"], parameters)
    scene.place(np.mean(parameters.start, axis=0))
    model, data = scene.model_and_data
    dofs = scene.arm_dofs
    mujoco.mj_forward(model, data)
    mass, jacobian = np.zeros((model.nv, model.nv)), np.zeros((6, model.nv))
    mujoco.mj_fullM(model, mass, data.qM)
    mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], scene._grip)
    give = np.linalg.solve(mass[np.ix_(dofs, dofs)], jacobian[:, dofs].T)
    inertia = np.linalg.inv(jacobian[:, dofs] @ give)
    return Arm(inertia, give @ inertia, model.dof_frictionloss[dofs].copy(), model.dof_damping[dofs].copy())
