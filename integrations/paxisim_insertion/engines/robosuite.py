"""InsertionScene: a task as a robosuite environment, with a Panda that holds a peg above its base."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import OrderedDict
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from paxisim_robosuite import fast_controller, register
from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
from robosuite.models.arenas import TableArena
from robosuite.models.tasks import ManipulationTask

import paxisim

from ..geometry import TABLE_HEIGHT, TABLE_SIZE, add_objects
from ..tasks import Parameters, Task
from .pads import PAD, ScenePads
from .scene import HALF_OPEN, SIDES, Scene

GRIPPER = "PaxiInsertionGripper"
"""Name under which the Panda gripper with the pads is registered in robosuite."""

register(GRIPPER, "PandaGripper", PAD)


class InsertionScene(Scene, ManipulationEnv):
    """A Panda that holds a peg above its base, with robosuite's physics and controller but without its observables.

    An action is the goal of the fingertip in the world: position (m), rotation vector (rad) and 1, which keeps the
    gripper closed. `paxisim_insertion.env.InsertionEnv` turns the scene into the paper's task.
    """

    sim: Any  # robosuite has no types
    model_timestep: Any

    def __init__(self, task: Task, parameters: Parameters | None = None) -> None:
        """Build the scene.

        Args:
            task: The task.
            parameters: Values that the paper does not specify; default: ours.
        """
        self.task, self.parameters = task, parameters or Parameters()
        self.reward_scale = 1.0
        goals = {"input_type": "absolute", "input_ref_frame": "world", "kp": self.parameters.kp}
        super().__init__(
            robots="Panda",
            gripper_types=GRIPPER,
            controller_configs=fast_controller("Panda", **goals),
            initialization_noise=None,
            use_camera_obs=False,
            has_renderer=False,
            has_offscreen_renderer=False,
            control_freq=20,
            horizon=task.max_steps,
            ignore_done=True,
            hard_reset=False,
        )
        model, _ = self.model_and_data
        self._friction = model.dof_frictionloss[self.arm_dofs].copy()

    @property
    def model_and_data(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """MuJoCo's own model and data, which robosuite wraps."""
        return self.sim.model._model, self.sim.data._data

    def goal(self, position: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return the action that sends the fingertip to a position (m, world), pointing straight down."""
        return np.array([*position, *self._nominal_vector, 1.0])

    def move(self, position: NDArray[np.floating]) -> None:
        """See `Scene.move`."""
        self.step(self.goal(position))

    def tune(self, stiffness: float, friction: float) -> None:
        """See `Scene.tune`."""
        model, _ = self.model_and_data
        model.dof_frictionloss[self.arm_dofs] = friction * self._friction
        controller = self.robots[0].composite_controller.part_controllers["right"]
        controller.kp[:] = stiffness * self.parameters.kp
        controller.kd[:] = 2 * np.sqrt(controller.kp)

    def reach(self, goal: NDArray[np.floating]) -> NDArray[np.floating]:
        """Move the arm so that the grip site is at a position, pointing straight down; return the joint angles."""
        model, data = self.model_and_data
        data.qpos[self._arm] = self.robots[0].init_qpos
        jacobian = np.zeros((6, model.nv))
        error = np.zeros(6)
        quat, turn = np.zeros(4), np.zeros(3)
        for _ in range(50):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            position, rotation = self.fingertip
            mujoco.mju_mat2Quat(quat, (self.nominal @ rotation.T).reshape(-1))
            mujoco.mju_quat2Vel(turn, quat, 1.0)
            error[:3], error[3:] = goal - position, turn
            if np.abs(error).max() < 1e-6:
                break
            mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], self.grip_site)
            arm = jacobian[:, self.arm_dofs]
            data.qpos[self._arm] += arm.T @ np.linalg.solve(arm @ arm.T + 1e-6 * np.eye(6), error)
        return data.qpos[self._arm].copy()

    def _begin(self, grip: NDArray[np.floating]) -> None:
        self.reset()
        joints = self.reach(grip)
        arm = self.robots[0]
        arm.composite_controller.part_controllers["right"].update_initial_joints(joints)
        arm.gripper["right"].current_action = -SIDES

    def _settle(self, grip: NDArray[np.floating], seconds: float, pinned: bool) -> None:
        _, data = self.model_and_data
        home = data.qpos[self.peg_qpos].copy()
        goal = self.goal(grip)
        for step in range(round(seconds / self.model_timestep)):
            if pinned:
                data.qpos[self.peg_qpos], data.qvel[self.peg_dofs] = home, 0
            self.sim.step1()
            self._pre_action(goal, policy_step=step == 0)
            self.sim.step2()
        if pinned:
            data.qpos[self.peg_qpos], data.qvel[self.peg_dofs] = home, 0

    def _pre_action(self, action: NDArray[np.floating], policy_step: bool = False) -> None:
        """Apply an action as robosuite's robot does, without its records for observables."""
        robot = self.robots[0]
        controller = robot.composite_controller
        controller.update_state()
        if policy_step:
            controller.set_goal(action)
        _, data = self.model_and_data
        for part, command in controller.run_controller(robot._enabled_parts).items():
            actuators, low, high = self._actuators[part]
            data.ctrl[actuators] = np.minimum(np.maximum(command, low), high)

    def _post_action(self, action: NDArray[np.floating]) -> tuple[float, bool, dict[str, Any]]:
        # the action here is a goal in the world; InsertionEnv penalises the task's action
        return 0.0, False, {}

    def _check_success(self) -> bool:
        return self.insertion.success

    def _load_model(self) -> None:
        super()._load_model()
        robot = self.robots[0].robot_model
        robot.set_base_xpos(robot.base_xpos_offset["table"](TABLE_SIZE[0]))
        arena = TableArena(table_full_size=TABLE_SIZE, table_offset=(0, 0, TABLE_HEIGHT))
        arena.set_origin([0, 0, 0])
        self.model = ManipulationTask(mujoco_arena=arena, mujoco_robots=[robot], mujoco_objects=[])
        add_objects(self.model.worldbody, self.model.asset, self.task, self.parameters)

    def edit_model_xml(self, xml_str: str) -> str:
        """Set the arm's armature, and give visual geoms inertia: the peg's are such geoms, which robosuite excludes."""
        root = ET.fromstring(super().edit_model_xml(xml_str))
        compiler = root.find("compiler")
        assert compiler is not None
        compiler.set("inertiagrouprange", "0 1")
        joints = {joint.get("name"): joint for joint in root.iter("joint")}
        for index, name in enumerate(self.robots[0].robot_model.joints):
            joints[name].set("armature", str(self.parameters.armature / (index + 1)))
        return ET.tostring(root, encoding="unicode")

    def _setup_references(self) -> None:
        super()._setup_references()
        model, data = self.model_and_data
        robot = self.robots[0]
        gripper = robot.gripper["right"]
        self._find(gripper.important_sites["grip_site"], gripper.joints)
        self._actuators = {
            part: (np.asarray(ids), *model.actuator_ctrlrange[ids].T.copy())
            for part, ids in robot._ref_actuators_indexes_dict.items()
        }
        names = robot.robot_model.joints
        self._arm = np.array([int(model.joint(name).qposadr[0]) for name in names])
        self.arm_dofs = np.array([int(model.joint(name).dofadr[0]) for name in names])
        data.qpos[self._arm] = robot.init_qpos
        data.qpos[self.finger_qpos] = HALF_OPEN * SIDES
        mujoco.mj_kinematics(model, data)
        self._point_down()
        self._find_pads()
        self._set_grip(self._actuators["right_gripper"][0])

    def _point_down(self) -> None:
        """Set the nominal orientation: that of the arm's home position, aligned with the world's axes."""
        _, home = self.fingertip
        self.nominal = np.round(home)  # the home position is a few degrees off the world's axes
        quat, self._nominal_vector = np.zeros(4), np.zeros(3)
        mujoco.mju_mat2Quat(quat, self.nominal.reshape(-1))
        mujoco.mju_quat2Vel(self._nominal_vector, quat, 1.0)

    def _find_pads(self) -> None:
        if hasattr(self, "tactile"):  # a reset keeps the model and the values drawn for its pads
            return
        model, data = self.model_and_data
        prefix = self.robots[0].gripper["right"].naming_prefix
        self.tactile = ScenePads(model, data, paxisim.find_pads(model, prefix=prefix), self.parameters)
        self._find_fingertips(data.xpos[self.tactile.pads.bodies])

    def _setup_observables(self) -> OrderedDict:
        return OrderedDict()
