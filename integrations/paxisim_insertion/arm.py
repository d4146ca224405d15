"""Arm: the dynamics of robosuite's Panda at its fingertip, as a few matrices."""

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
    """Dynamics of an arm in one pose, expressed at its fingertip.

    Fingertip velocities are ``(6,)``, linear (m/s) and angular (rad/s), in the world frame.

    Attributes:
        inertia: ``(6, 6)`` operational-space inertia at the fingertip (kg, kg m, kg m^2), including the gripper.
        rates: ``(7, 6)`` joint speeds (rad/s) per fingertip velocity, when nothing but the fingertip pushes the arm.
        friction: ``(7,)`` dry friction of the joints (N m).
        damping: ``(7,)`` viscous friction of the joints (N m s).
    """

    inertia: NDArray[np.floating]
    rates: NDArray[np.floating]
    friction: NDArray[np.floating]
    damping: NDArray[np.floating]

    @property
    def impedance(self) -> NDArray[np.floating]:
        """``(6, 6)`` inertia by which robosuite's controller multiplies errors: position and rotation decoupled."""
        mobility, apart = np.linalg.inv(self.inertia), np.zeros((6, 6))
        for part in (slice(0, 3), slice(3, 6)):
            apart[part, part] = np.linalg.inv(mobility[part, part])
        return apart


@cache
def measure_arm(parameters: Parameters) -> Arm:
    """Measure robosuite's Panda with its gripper, the fingertip at the mean start of an episode.

    The entries of the inertia change by a few percent over the tasks' workspace.
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
