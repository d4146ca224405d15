"""fast_controller: robosuite's operational space control with the same torques, in a fraction of the time.

In each substep robosuite computes six Jacobians where one suffices, three pseudo-inverses of invertible matrices, the
pose of a fixed base twice, the limits of the action, and gripper controls that are constant within a control step. All
of this runs in Python, whose instructions are evicted from the caches by the physics in between. The physics and the
control law are unchanged.
"""

from __future__ import annotations

import copy
from typing import Any

import mujoco
import numba  # a dependency of robosuite
import numpy as np
from numpy.typing import NDArray
from robosuite.controllers import load_composite_controller_config
from robosuite.controllers.composite import composite_controller
from robosuite.controllers.parts.arm import OperationalSpaceController
from robosuite.controllers.parts.gripper.simple_grip import SimpleGripController

from ._quiet import quietly

NAME = "PAXI_FAST"
_NULLSPACE_KP = 10.0  # robosuite's


def fast_controller(robot: str = "Panda", **arm: Any) -> dict[str, Any]:
    """Return robosuite's default controller configuration of a robot, to be run by `FastController`.

    Args:
        robot: robosuite's name of a robot with a fixed base whose default is ``OSC_POSE`` with fixed impedance.
        **arm: Settings of its arm controllers to change, e.g. ``kp=300`` or ``input_type="absolute"``.

    Returns:
        A configuration for ``controller_configs=`` of a robosuite environment.
    """
    with quietly():  # it logs which file it reads
        config: Any = copy.deepcopy(load_composite_controller_config(robot=robot))
    config["type"] = NAME
    for part in config["body_parts"].values():
        part.update(arm)
    return config


class FastOSC(OperationalSpaceController):
    """`OperationalSpaceController` of an arm on a fixed base, without interpolation."""

    origin_pos: Any  # robosuite has no types
    origin_ori: Any
    goal_pos: Any
    goal_ori: Any
    _jacobian: NDArray[np.floating] | None = None

    def run_controller(self) -> NDArray[np.floating]:
        """Compute the torques (N m) towards the goal."""
        if self._jacobian is None:
            self._model, self._data = self.sim.model._model, self.sim.data._data
            self._site = self.sim.model.site_name2id(self.ref_name)
            self._jacobian, self._mass = np.zeros((6, self._model.nv)), np.zeros((self._model.nv, self._model.nv))
            self._positional, self._rotational = self._jacobian[:3], self._jacobian[3:]
            self._dofs, self._joints = np.asarray(self.qvel_index), np.asarray(self.qpos_index)
        data = self._data
        mujoco.mj_jacSite(self._model, data, self._positional, self._rotational, self._site)
        mujoco.mj_fullM(self._model, self._mass, data.qM)
        goal_pos, goal_ori = self.goal_pos, self.goal_ori
        if self.input_ref_frame == "base":
            goal_pos, goal_ori = self.origin_pos + self.origin_ori @ goal_pos, self.origin_ori @ goal_ori
        self.torques = _torques(
            self._mass,
            self._jacobian,
            self._dofs,
            self._joints,
            np.ascontiguousarray(goal_pos),
            np.ascontiguousarray(goal_ori),
            data.site_xpos[self._site],
            data.site_xmat[self._site],
            data.qpos,
            data.qvel,
            np.asarray(self.initial_joint),
            data.qfrc_bias,
            self.kp,
            self.kd,
            self.uncoupling,
        )
        self.new_update = True
        return self.torques


@numba.njit(cache=True)
def _torques(
    full_mass, full_jacobian, dofs, joints, goal, goal_axes, at, axes, qpos, qvel, posture, bias, kp, kd, uncoupled
):  # pragma: no cover - compiled
    """Compute the control law of `OperationalSpaceController`, with solves instead of inverses."""
    count = len(dofs)
    mass, jacobian = np.empty((count, count)), np.empty((6, count))
    velocity, towards = np.empty(count), np.empty(count)
    for i in range(count):
        velocity[i] = qvel[dofs[i]]
        apart = posture[i] - qpos[joints[i]]
        towards[i] = _NULLSPACE_KP * apart - 2 * np.sqrt(_NULLSPACE_KP) * velocity[i]
        for j in range(count):
            mass[i, j] = full_mass[dofs[i], dofs[j]]
        for j in range(6):
            jacobian[j, i] = full_jacobian[j, dofs[i]]
    error = np.zeros(6)
    error[:3] = goal - at
    for column in range(3):  # half the sum of the cross products of the axes
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            error[3 + i] += 0.5 * (
                axes[3 * j + column] * goal_axes[k, column] - axes[3 * k + column] * goal_axes[j, column]
            )
    wanted = kp * error - kd * (jacobian @ velocity)
    transposed = np.ascontiguousarray(jacobian.T)
    mobility = jacobian @ np.linalg.solve(mass, transposed)
    wrench = np.empty(6)
    if uncoupled:
        wrench[:3] = np.linalg.solve(np.ascontiguousarray(mobility[:3, :3]), wanted[:3])
        wrench[3:] = np.linalg.solve(np.ascontiguousarray(mobility[3:, 3:]), wanted[3:])
    else:
        wrench[:] = np.linalg.solve(mobility, wanted)
    wrench -= np.linalg.solve(mobility, jacobian @ towards)
    torques = transposed @ wrench + mass @ towards
    for i in range(count):
        torques[i] += bias[dofs[i]]
    return torques


@composite_controller.register_composite_controller
class FastController(composite_controller.CompositeController):
    """robosuite's ``BASIC`` controller for a robot on a fixed base."""

    name = NAME

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Build the controller as robosuite does."""
        super().__init__(*args, **kwargs)
        self.part_controller_config: Any = None
        self._limits: Any = None
        self._origin_is_known = False
        self._is_new = True

    def _init_controllers(self) -> None:
        super()._init_controllers()
        for part, params in self.part_controller_config.items():
            controller = self.part_controllers[part]
            plain = type(controller) is OperationalSpaceController and controller.impedance_mode == "fixed"
            if plain and controller.interpolator_pos is None:
                settings = {k: v for k, v in params.items() if k not in ("control_ori", "interpolation")}
                self.part_controllers[part] = FastOSC(control_ori=controller.use_ori, **settings)

    def update_state(self) -> None:
        """Read the pose of the base once."""
        if not self._origin_is_known:
            super().update_state()
            self._origin_is_known = True

    def set_goal(self, all_action: NDArray[np.floating]) -> None:
        """Give every part its goal for this control step."""
        super().set_goal(all_action)
        self._is_new = True

    def run_controller(self, enabled_parts: dict[str, bool]) -> dict[str, Any]:
        """Compute the controls of this substep; parts whose controls are constant until the next goal are omitted."""
        self._applied_action_dict.clear()
        for part, controller in self.part_controllers.items():
            holds = type(controller) is SimpleGripController and controller.interpolator is None
            if enabled_parts.get(part, False) and (self._is_new or not holds):
                self._applied_action_dict[part] = controller.run_controller()
        self._is_new = False
        return self._applied_action_dict

    @property
    def action_limits(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Lower and upper limits of the action."""
        if self._limits is None:
            self._limits = super().action_limits
        return self._limits
