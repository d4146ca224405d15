"""InsertionScene: one task as a robosuite environment: a Panda that holds a peg above its base."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import OrderedDict
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from paxisim_robosuite import TactileGripper, TactileSim, fast_controller
from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
from robosuite.models.arenas import TableArena
from robosuite.models.tasks import ManipulationTask

from .geometry import base_pieces, contact_attributes, peg_pieces, to_mjcf
from .reward import Insertion, insertion, reward_terms, weighted
from .tasks import Parameters, Task

TABLE_HEIGHT = 0.8
GRIPPERS = {True: "PaxiPandaGripper", False: "PandaGripper"}
_PINNED, _FREE = 0.1, 0.2  # seconds: the fingers close on a peg that is held in place, then it is let go
_OPEN = 0.5e-3  # m between handle and fingers before they close; a bump of the surface is up to 0.2 mm
_HALF_OPEN = 0.02  # m
_SIDES = np.array([1.0, -1.0])  # the joints of the two fingers open in opposite directions
_PEG_COLOUR, _BASE_COLOUR = "0.85 0.45 0.2 1", "0.3 0.45 0.65 1"


class InsertionScene(ManipulationEnv):
    """A Panda holds a peg above its base. robosuite's physics and controller, without its observables.

    An action is the goal of the fingertip in the world: position (m), rotation vector (rad) and 1, which keeps the
    gripper closed. `paxisim_insertion.env.InsertionEnv` makes the paper's task of it.

    Attributes:
        task: The task.
        parameters: Its geometry.
        tactile: The pads, None with the plain gripper.
        nominal: ``(3, 3)`` rotation of the fingertip that points straight down, its fingers closing along y.
    """

    sim: Any  # robosuite has no types
    model_timestep: Any

    def __init__(
        self,
        task: Task,
        parameters: Parameters | None = None,
        *,
        tactile: bool = True,
        controller: dict[str, Any] | None = None,
        seed: int | None = None,
    ) -> None:
        """Build the scene.

        Args:
            task: The task.
            parameters: What the paper leaves open.
            tactile: Give the gripper pads; else it is robosuite's plain one.
            controller: robosuite's configuration; default: `fast_controller`. It takes absolute goals in the world.
            seed: Of robosuite's own random numbers, which nothing here uses.
        """
        self.task, self.parameters = task, parameters or Parameters()
        self.tactile: TactileSim | None = None
        self.reward_scale = 1.0
        goals = {"input_type": "absolute", "input_ref_frame": "world", "kp": self.parameters.kp}
        super().__init__(
            robots="Panda",
            gripper_types=GRIPPERS[tactile],
            controller_configs=fast_controller("Panda", **goals) if controller is None else controller,
            initialization_noise=None,
            use_camera_obs=False,
            has_renderer=False,
            has_offscreen_renderer=False,
            control_freq=20,
            horizon=task.max_steps,
            ignore_done=True,
            hard_reset=False,
            seed=seed,
        )

    @property
    def model_and_data(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """MuJoCo's own model and data, which robosuite wraps."""
        return self.sim.model._model, self.sim.data._data

    def place(
        self,
        bottom: NDArray[np.floating],
        grasp: NDArray[np.floating],
        surface: NDArray[np.floating] | None = None,
    ) -> None:
        """Begin an episode: put the peg in its place and close the fingers on it.

        Args:
            bottom: ``(3,)`` the peg's bottom from the middle of the hole's upper edge (m).
            grasp: ``(2,)`` offset of the fingers from the middle of the handle, along x and z (m).
            surface: ``(pads, rows, cols)`` heights of the taxels (m); default: as they are.
        """
        self.reset()
        if self.tactile is not None and surface is not None:
            self.tactile.set_surface(surface)
        _, data = self.model_and_data
        peg = self.hole_top + bottom
        handle = self.parameters.peg_length + self.parameters.handle_height / 2
        grip = peg + [grasp[0], 0.0, handle + grasp[1]] - self._tip_to_grip
        joints = self._reach(grip)
        data.qpos[self._fingers] = (self._closed + self.parameters.handle_size / 2 + _OPEN) * _SIDES
        data.qpos[self._peg_qpos : self._peg_qpos + 7] = [*peg, 1, 0, 0, 0]
        data.qvel[:] = 0
        arm = self.robots[0]
        arm.composite_controller.part_controllers["right"].update_initial_joints(joints)
        arm.gripper["right"].current_action = -_SIDES
        goal = self.goal(self.fingertip[0])
        self._settle(goal, _PINNED, pinned=True)
        self._settle(goal, _FREE, pinned=False)

    def goal(self, position: NDArray[np.floating]) -> NDArray[np.floating]:
        """The action that sends the fingertip to a position (m, world), pointing straight down."""
        return np.array([*position, *self._nominal_vector, 1.0])

    @property
    def fingertip(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Position (m) and rotation of robosuite's grip site, in the world."""
        _, data = self.model_and_data
        return data.site_xpos[self._grip].copy(), data.site_xmat[self._grip].reshape(3, 3).copy()

    @property
    def peg(self) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
        """Position (m) and rotation of the peg, in the world."""
        _, data = self.model_and_data
        return data.xpos[self._peg].copy(), data.xmat[self._peg].reshape(3, 3).copy()

    @property
    def opening(self) -> float:
        """Distance (m) between the two fingers' faces."""
        _, data = self.model_and_data
        return float(np.sum(data.qpos[self._fingers] * _SIDES)) - 2 * self._closed

    @property
    def base(self) -> NDArray[np.floating]:
        """Position (m) of the base in the world, the middle of the hole's bottom; its axes are the world's."""
        return np.array([0.0, 0.0, TABLE_HEIGHT + self.parameters.floor])

    @property
    def hole_top(self) -> NDArray[np.floating]:
        """Position (m) of the middle of the hole's upper edge in the world."""
        return self.base + [0.0, 0.0, self.parameters.hole_depth]

    @property
    def insertion(self) -> Insertion:
        """How far the peg is in its hole."""
        position, rotation = self.peg
        return insertion(self.task, self.parameters, position - self.base, rotation)

    def reward(self, action: NDArray[np.floating] | None = None) -> float:
        """The reward of the state, for robosuite; without an action there is no penalty for it."""
        action = np.zeros(3) if action is None else action
        return weighted(reward_terms(self.insertion, action, self.parameters.epsilon))

    def _pre_action(self, action: NDArray[np.floating], policy_step: bool = False) -> None:
        """What robosuite's robot does with an action, without the records it keeps for its observables."""
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
        # the action here is a goal in the world: InsertionEnv has the task's action and its penalty
        return 0.0, False, {}

    def _check_success(self) -> bool:
        return self.insertion.success

    def _load_model(self) -> None:
        super()._load_model()
        robot = self.robots[0].robot_model
        size = (0.8, 0.8, 0.05)
        robot.set_base_xpos(robot.base_xpos_offset["table"](size[0]))
        arena = TableArena(table_full_size=size, table_offset=(0, 0, TABLE_HEIGHT))
        arena.set_origin([0, 0, 0])
        self.model = ManipulationTask(mujoco_arena=arena, mujoco_robots=[robot], mujoco_objects=[])
        touched = contact_attributes(self.parameters)
        base = ET.SubElement(self.model.worldbody, "body", {"name": "base", "pos": _text(self.base)})
        geoms, meshes = to_mjcf(base_pieces(self.task, self.parameters), "base", _BASE_COLOUR, **touched)
        base.extend(geoms)
        peg = ET.SubElement(self.model.worldbody, "body", {"name": "peg", "pos": _text(self.hole_top + [0, 0, 0.1])})
        ET.SubElement(peg, "freejoint", {"name": "peg"})
        density = str(self.parameters.density)
        geoms, more = to_mjcf(peg_pieces(self.task, self.parameters), "peg", _PEG_COLOUR, density=density, **touched)
        peg.extend(geoms)
        self.model.asset.extend(meshes + more)

    def edit_model_xml(self, xml_str: str) -> str:
        """Let the geoms that are drawn have inertia too, as the peg's are in that group; robosuite means the other."""
        root = ET.fromstring(super().edit_model_xml(xml_str))
        compiler = root.find("compiler")
        assert compiler is not None
        compiler.set("inertiagrouprange", "0 1")
        return ET.tostring(root, encoding="unicode")

    def _setup_references(self) -> None:
        super()._setup_references()
        model, data = self.model_and_data
        # one contact between a round handle and a taxel, as between a ball and it: four times as fast as several, and
        # the same totals. Between boxes MuJoCo makes four either way. Before it became a default there was no such bit
        several = int(getattr(mujoco.mjtDisableBit, "mjDSBL_MULTICCD", 0))
        # the trees of the bodies' geoms find the same contacts as testing all pairs, and here that is faster
        trees = int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
        model.opt.disableflags |= several | trees
        self._peg = model.body("peg").id
        joint = model.joint("peg")
        self._peg_qpos, self._peg_dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        robot = self.robots[0]
        gripper = robot.gripper["right"]
        self._grip = model.site(gripper.important_sites["grip_site"]).id
        fingers = [model.joint(name) for name in gripper.joints]
        self._fingers = np.array([int(finger.qposadr[0]) for finger in fingers])
        self._actuators = {
            part: (np.asarray(ids), *model.actuator_ctrlrange[ids].T.copy())
            for part, ids in robot._ref_actuators_indexes_dict.items()
        }
        names = robot.robot_model.joints
        self._arm = np.array([int(model.joint(name).qposadr[0]) for name in names])
        self._arm_dofs = np.array([int(model.joint(name).dofadr[0]) for name in names])
        data.qpos[self._arm] = robot.init_qpos
        data.qpos[self._fingers] = _HALF_OPEN * _SIDES
        mujoco.mj_kinematics(model, data)
        self._point_down()
        self._find_fingertips()
        self._set_grip()

    def _set_grip(self) -> None:
        """Let the fingers, which are springs drawn to where they meet, hold the handle with the force that is asked."""
        model, _ = self.model_and_data
        force = self.parameters.grip_force
        stiffness = force / (self._closed + self.parameters.handle_size / 2)
        fingers, _, _ = self._actuators["right_gripper"]
        model.actuator_gainprm[fingers, 0] = stiffness
        model.actuator_biasprm[fingers, 1] = -stiffness
        model.actuator_forcerange[fingers] = [-2 * force, 2 * force]

    def _point_down(self) -> None:
        """Straighten the orientation that the arm's home position has."""
        _, home = self.fingertip
        self.nominal = np.round(home)  # the home position is a few degrees off the world's axes
        quat, self._nominal_vector = np.zeros(4), np.zeros(3)
        mujoco.mju_mat2Quat(quat, self.nominal.reshape(-1))
        mujoco.mju_quat2Vel(self._nominal_vector, quat, 1.0)

    def _find_fingertips(self) -> None:
        """Where the fingers touch: the vector from the grip site to there, and their joints when they meet."""
        model, data = self.model_and_data
        gripper = self.robots[0].gripper["right"]
        position, rotation = self.fingertip
        if isinstance(gripper, TactileGripper):
            self.tactile = TactileSim(self.sim, gripper)
            faces, thickness = data.xpos[self.tactile.pads.bodies], 0.0
        else:
            named = gripper.important_geoms
            pads = [model.geom(named[f"{side}_fingerpad"][0]).id for side in ("left", "right")]
            faces, thickness = data.geom_xpos[pads], 2 * model.geom_size[pads[0], 1]
        apart = float(np.linalg.norm(faces[0] - faces[1])) - thickness
        self._closed = _HALF_OPEN - apart / 2
        height = float((faces.mean(axis=0) - position) @ rotation[:, 2])
        self._tip_to_grip = self.nominal @ [0.0, 0.0, height]

    def _reach(self, goal: NDArray[np.floating]) -> NDArray[np.floating]:
        """Joint angles that bring the grip site to a position, pointing straight down; the arm is put there."""
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
            mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], self._grip)
            arm = jacobian[:, self._arm_dofs]
            data.qpos[self._arm] += arm.T @ np.linalg.solve(arm @ arm.T + 1e-6 * np.eye(6), error)
        return data.qpos[self._arm].copy()

    def _settle(self, goal: NDArray[np.floating], seconds: float, pinned: bool) -> None:
        _, data = self.model_and_data
        where = slice(self._peg_qpos, self._peg_qpos + 7)
        dofs = slice(self._peg_dof, self._peg_dof + 6)
        home = data.qpos[where].copy()
        for step in range(round(seconds / self.model_timestep)):
            if pinned:
                data.qpos[where], data.qvel[dofs] = home, 0
            self.sim.step1()
            self._pre_action(goal, policy_step=step == 0)
            self.sim.step2()
        if pinned:
            data.qpos[where], data.qvel[dofs] = home, 0

    def _setup_observables(self) -> OrderedDict:
        return OrderedDict()


def _text(values: NDArray[np.floating]) -> str:
    return " ".join(f"{value:.9g}" for value in values)
