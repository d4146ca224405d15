"""fast_controller: robosuite's operational space control with the same torques, at a fraction of its time.

robosuite computes per substep what does not change within it, or not at all: six Jacobians where one will do, three
pseudo-inverses of matrices that are positive definite, the pose of a base that is bolted down (twice), the limits of
the action, and what the gripper was told when the control step began. The physics and the control law stay as they are.
"""

from __future__ import annotations

import copy
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from robosuite.controllers import load_composite_controller_config
from robosuite.controllers.composite import composite_controller
from robosuite.controllers.parts.arm import OperationalSpaceController
from robosuite.controllers.parts.gripper.simple_grip import SimpleGripController
from robosuite.utils.control_utils import orientation_error
from scipy.linalg import get_lapack_funcs

NAME = "PAXI_FAST"
_NULLSPACE_KP = 10.0  # robosuite's
(_posv,) = get_lapack_funcs(("posv",))  # solves with a positive definite matrix


def fast_controller(robot: str = "Panda", **arm: Any) -> dict[str, Any]:
    """A robot's default controller of robosuite, run by `FastController`.

    Args:
        robot: robosuite's name of a robot with a fixed base whose default is ``OSC_POSE`` with fixed impedance.
        **arm: Settings of its arm controllers to change, e.g. ``kp=300`` or ``input_type="absolute"``.

    Returns:
        For ``controller_configs=`` of a robosuite environment.
    """
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

    def update(self, force: bool = False) -> None:
        """Read the arm's state from the simulation."""
        if not (self.new_update or force):
            return
        if force or not self.lite_physics:
            self.sim.forward()
        model, data = self.sim.model._model, self.sim.data._data
        if self._jacobian is None:
            self._site = self.sim.model.site_name2id(self.ref_name)
            self._jacobian = np.zeros((6, model.nv))
            self._full_mass = np.zeros((model.nv, model.nv))
            self._dofs = np.asarray(self.qvel_index)
            self._block = np.ix_(self._dofs, self._dofs)
        mujoco.mj_jacSite(model, data, self._jacobian[:3], self._jacobian[3:], self._site)
        self.J_full = self._jacobian[:, self._dofs]
        self.J_pos, self.J_ori = self.J_full[:3], self.J_full[3:]
        velocity = self._jacobian @ data.qvel
        self.ref_pos_vel, self.ref_ori_vel = velocity[:3], velocity[3:]
        self.ref_pos = data.site_xpos[self._site].copy()
        self.ref_ori_mat = data.site_xmat[self._site].reshape(3, 3).copy()
        self.joint_pos = data.qpos[self.qpos_index]
        self.joint_vel = data.qvel[self._dofs]
        mujoco.mj_fullM(model, self._full_mass, data.qM)
        self.mass_matrix = self._full_mass[self._block]
        self.new_update = False

    def run_controller(self) -> NDArray[np.floating]:
        """Torques (N m) towards the goal."""
        self.update()
        in_world = self.input_ref_frame == "world"
        goal_pos = self.goal_pos if in_world else self.origin_pos + self.origin_ori @ self.goal_pos
        goal_ori = self.goal_ori if in_world else self.origin_ori @ self.goal_ori
        error = np.concatenate([goal_pos - self.ref_pos, orientation_error(goal_ori, self.ref_ori_mat)])
        velocity = np.concatenate([self.ref_pos_vel, self.ref_ori_vel])
        wanted = self.kp * error - self.kd * velocity
        jacobian = self.J_full
        _, to_joints, _ = _posv(self.mass_matrix, jacobian.T)
        inverse_inertia = jacobian @ to_joints
        if self.uncoupling:
            _, force, bad = _posv(inverse_inertia[:3, :3], wanted[:3])
            _, torque, bad_too = _posv(inverse_inertia[3:, 3:], wanted[3:])
            wrench = np.concatenate([force, torque])
        else:
            _, wrench, bad = _posv(inverse_inertia, wanted)
            bad_too = 0
        posture = _NULLSPACE_KP * (self.initial_joint - self.joint_pos) - 2 * np.sqrt(_NULLSPACE_KP) * self.joint_vel
        _, in_task, bad_as_well = _posv(inverse_inertia, jacobian @ posture)
        if bad or bad_too or bad_as_well:
            return super().run_controller()  # at a singularity robosuite's pseudo-inverses decide
        self.torques = jacobian.T @ (wrench - in_task) + self.mass_matrix @ posture + self.torque_compensation
        self.new_update = True
        return self.torques


@composite_controller.register_composite_controller
class FastController(composite_controller.CompositeController):
    """robosuite's ``BASIC`` controller for a robot on a fixed base."""

    name = NAME

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        """Build it as robosuite does."""
        super().__init__(*args, **kwargs)
        self.part_controller_config: Any = None
        self._limits: Any = None
        self._origin_is_known = False
        self._held: dict[str, Any] = {}

    def _init_controllers(self) -> None:
        super()._init_controllers()
        for part, params in self.part_controller_config.items():
            controller = self.part_controllers[part]
            plain = type(controller) is OperationalSpaceController and controller.impedance_mode == "fixed"
            if plain and controller.interpolator_pos is None:
                settings = {k: v for k, v in params.items() if k not in ("control_ori", "interpolation")}
                self.part_controllers[part] = FastOSC(control_ori=controller.use_ori, **settings)

    def update_state(self) -> None:
        """Read the pose of the base, once."""
        if not self._origin_is_known:
            super().update_state()
            self._origin_is_known = True

    def set_goal(self, all_action: NDArray[np.floating]) -> None:
        """Give every part its goal for this control step."""
        super().set_goal(all_action)
        self._held.clear()

    def run_controller(self, enabled_parts: dict[str, bool]) -> dict[str, Any]:
        """Controls of every part for this substep."""
        self._applied_action_dict.clear()
        for part, controller in self.part_controllers.items():
            if enabled_parts.get(part, False):
                if type(controller) is not SimpleGripController or controller.interpolator is not None:
                    self._applied_action_dict[part] = controller.run_controller()
                    continue
                if part not in self._held:
                    self._held[part] = controller.run_controller()
                self._applied_action_dict[part] = self._held[part]
        return self._applied_action_dict

    @property
    def action_limits(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Lower and upper limits of the action."""
        if self._limits is None:
            self._limits = super().action_limits
        return self._limits
