"""Arm: the dynamics of robosuite's Panda at its fingertip, as a few matrices."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

import paxisim

from ..tasks import PARAMETERS, TASKS, Parameters, Task
from .scene import Scene

MEASURED = Path(__file__).with_name("arm.json")
"""The arm as `measure_arm` found it with the default parameters, so that the native engine needs no robosuite."""

_CHANGE_THE_ARM = ("armature", "start", "floor", "hole_depth", "peg_length", "handle_height", "handle_size")


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
def find_arm(parameters: Parameters) -> Arm:
    """Return robosuite's Panda with its gripper, the fingertip at the mean start of an episode.

    It comes from `MEASURED` unless parameters that change or move the arm differ from the defaults.

    Raises:
        MissingExtraError: The arm has to be measured, and robosuite is not installed.
    """
    if any(getattr(parameters, name) != getattr(PARAMETERS, name) for name in _CHANGE_THE_ARM):
        return measure_arm(parameters)
    found = json.loads(MEASURED.read_text(encoding="utf-8"))
    return Arm(**{name: np.array(values) for name, values in found.items()})


def measure_arm(parameters: Parameters) -> Arm:
    """Measure robosuite's Panda with its gripper, the fingertip at the mean start of an episode.

    The entries of the inertia change by a few percent over the tasks' workspace.

    Raises:
        MissingExtraError: robosuite is not installed.
    """
    scene: Any = robosuite_scene(TASKS["SX-2mm"], parameters)
    scene.place(np.mean(parameters.start, axis=0))
    model, data = scene.model_and_data
    dofs = scene.arm_dofs
    mujoco.mj_forward(model, data)
    mass, jacobian = mass_matrix(model, data), np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], scene.grip_site)
    give = np.linalg.solve(mass[np.ix_(dofs, dofs)], jacobian[:, dofs].T)
    inertia = np.linalg.inv(jacobian[:, dofs] @ give)
    return Arm(inertia, give @ inertia, model.dof_frictionloss[dofs].copy(), model.dof_damping[dofs].copy())


def robosuite_scene(task: Task, parameters: Parameters) -> Scene:
    """Build the scene of robosuite's engine, which is imported only where it is used.

    Raises:
        MissingExtraError: robosuite is not installed.
    """
    try:
        from .robosuite import InsertionScene
    except ImportError as error:
        raise paxisim.MissingExtraError(error.name or "robosuite", "robosuite", "robosuite's engine") from error
    return InsertionScene(task, parameters)


def mass_matrix(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.floating]:
    """Return the ``(nv, nv)`` mass matrix at the data's positions; how MuJoCo stores it depends on the version."""
    columns = np.empty((model.nv, model.nv))
    for column, unit in zip(columns, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, column, unit)
    return columns
