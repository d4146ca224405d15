"""NativeScene: a task without robosuite, with a hand that moves as the arm would move it, in plain MuJoCo.

The hand slides along x, y and z and rotates about them. The arm's contribution is linear in the fingertip's velocity,
so fixed tendons represent it. The 6x6 inertia of the arm is the armature of six tendons along its eigenvectors. The
friction of the seven joints is the friction of seven more. The impedance of robosuite's controller, which acts on
position and rotation separately, is the force of actuators on another three and three. Everything else is the same as
in robosuite's scene: the gripper with its pads, the peg, its base and the table.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import mujoco
import numpy as np
from numpy.typing import NDArray

import paxisim

from ..geometry import TABLE_HEIGHT, TABLE_SIZE, add_objects, numbers
from ..tasks import Parameters, Task
from .arm import find_arm, mass_matrix
from .pads import PAD, ScenePads
from .scene import HALF_OPEN, SIDES, Scene

TIMESTEP = 5e-3
"""Physics time step (s); robosuite's is 2 ms."""

CONTROL_STEPS = round(0.05 / TIMESTEP)

_AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1", "roll": "1 0 0", "pitch": "0 1 0", "yaw": "0 0 1"}
_DOWN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # the fingertip's rotation
_GRIP = np.array([0.0, 0.0, 0.097])  # position of the grip site in the gripper's frame (m)
_PREFIX = "gripper/"  # of the gripper's names; MuJoCo 4 warns of an empty one
_FINGERS = ["finger_joint1", "finger_joint2"]


class NativeScene(Scene):
    """A hand with the arm's inertia, friction and controller that holds a peg above its base.

    Attributes:
        pull: ``(6, 6)`` coefficients of the hand's joints in the tendons of the controller, whose first three columns
            turn a target position into the actuators' controls.
    """

    def __init__(self, task: Task, parameters: Parameters | None = None) -> None:
        """Build the scene.

        Args:
            task: The task.
            parameters: Values that the paper does not specify; default: ours.
        """
        self.task, self.parameters = task, parameters or Parameters()
        self.nominal = _DOWN
        gripper = paxisim.attach(paxisim.robosuite_gripper_path("panda"), PAD)
        bare = self._spec(gripper, []).compile()
        arm = find_arm(self.parameters)
        # the arm's inertia includes the gripper, which the model has already
        values, vectors = np.linalg.eigh(arm.inertia - _inertia(bare))
        tendons = [(vector, {"armature": value}) for value, vector in zip(values, vectors.T, strict=True)]
        for row, friction, damping in zip(arm.rates, arm.friction, arm.damping, strict=True):
            tendons.append((row, {"frictionloss": friction, "damping": damping}))
        self._impedance, vectors = np.linalg.eigh(arm.impedance)
        tendons += [(vector, {}) for vector in vectors.T]
        self._friction = arm.friction
        self.pull = np.array([row for row, _ in tendons[-6:]])
        self._model = self._spec(gripper, tendons).compile()
        self._data = mujoco.MjData(self._model)
        self.tune(1.0, 1.0)
        self._find(f"{_PREFIX}grip_site", [_PREFIX + name for name in _FINGERS])
        self._measure(gripper.bind(self._model, _PREFIX))

    @property
    def model_and_data(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """MuJoCo's model and data."""
        return self._model, self._data

    def aim(self, position: NDArray[np.floating]) -> None:
        """Pull the fingertip towards a position (m, world), pointing straight down, from the next physics step on."""
        self._data.ctrl[:6] = self.pull[:, :3] @ (position - self.base)

    def advance(self) -> None:
        """Simulate 50 ms. Other Python threads can run in the meantime."""
        mujoco.mj_step(self._model, self._data, CONTROL_STEPS)

    def move(self, position: NDArray[np.floating]) -> None:
        """See `Scene.move`."""
        self.aim(position)
        self.advance()

    def _begin(self, grip: NDArray[np.floating]) -> None:
        mujoco.mj_resetData(self._model, self._data)
        self._data.qpos[:3] = grip - self.base

    def _settle(self, grip: NDArray[np.floating], seconds: float, pinned: bool) -> None:
        model, data = self._model, self._data
        self.aim(grip)
        steps = round(seconds / TIMESTEP)
        if not pinned:
            mujoco.mj_step(model, data, steps)
            return
        home = data.qpos[self.peg_qpos].copy()
        for _ in range(steps):
            mujoco.mj_step(model, data)
            data.qpos[self.peg_qpos], data.qvel[self.peg_dofs] = home, 0

    def tune(self, stiffness: float, friction: float) -> None:
        """See `Scene.tune`. The controller is a critically damped spring on each of the last six tendons."""
        model, kp = self._model, stiffness * self.parameters.kp
        model.tendon_frictionloss[6:13] = friction * self._friction
        model.actuator_gainprm[:6, 0] = kp * self._impedance
        model.actuator_biasprm[:6, 1] = -kp * self._impedance
        model.actuator_biasprm[:6, 2] = -2 * np.sqrt(kp) * self._impedance

    def _measure(self, pads: paxisim.Pads) -> None:
        model, data = self._model, self._data
        self._data.qpos[self.finger_qpos] = HALF_OPEN * SIDES
        mujoco.mj_kinematics(model, data)
        self.tactile = ScenePads(model, data, pads, self.parameters)
        self._find_fingertips(data.xpos[pads.bodies])
        self._set_grip([model.actuator(f"{_PREFIX}gripper_{name}").id for name in _FINGERS])

    def _spec(
        self,
        gripper: paxisim.TactileGripper,
        tendons: list[tuple[NDArray[np.floating], dict[str, float]]],
    ) -> mujoco.MjSpec:
        """Build the scene with tendons, each given by its coefficients on the hand's six joints and its attributes."""
        root = ET.Element("mujoco")
        ET.SubElement(root, "compiler", angle="radian")
        ET.SubElement(root, "option", timestep=str(TIMESTEP), cone="elliptic", impratio="20", tolerance="1e-8")
        assets, world = ET.SubElement(root, "asset"), ET.SubElement(root, "worldbody")
        half = np.array(TABLE_SIZE) / 2
        at = [0, 0, TABLE_HEIGHT - half[2]]
        ET.SubElement(world, "geom", name="table", type="box", size=numbers(half), pos=numbers(at), group="1")
        hand = ET.SubElement(world, "body", name="hand", pos=numbers(self.base), gravcomp="1")
        ET.SubElement(hand, "inertial", pos="0 0 0", mass="0.1", diaginertia="1e-3 1e-3 1e-3")
        for index, (name, axis) in enumerate(_AXES.items()):
            ET.SubElement(hand, "joint", name=name, type="slide" if index < 3 else "hinge", axis=axis)
        add_objects(world, assets, self.task, self.parameters)
        strings, actuators = ET.SubElement(root, "tendon"), ET.SubElement(root, "actuator")
        for index, (row, attributes) in enumerate(tendons):
            values = {name: f"{value:.9g}" for name, value in attributes.items()}
            fixed = ET.SubElement(strings, "fixed", {"name": f"arm_{index}", **values})
            for joint, coefficient in zip(_AXES, row, strict=True):
                ET.SubElement(fixed, "joint", joint=joint, coef=f"{coefficient:.9g}")
            if not attributes:
                ET.SubElement(actuators, "general", tendon=f"arm_{index}", biastype="affine")
        spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
        _add_gripper(spec, gripper.spec.copy())
        return spec


def _add_gripper(spec: mujoco.MjSpec, gripper: mujoco.MjSpec) -> None:
    """Attach the gripper to the hand, its grip site at the hand's joints, without weight or sensors."""
    own, quat = np.zeros(9), np.zeros(4)
    mujoco.mju_quat2Mat(own, gripper.body("right_gripper").quat)
    mujoco.mju_mat2Quat(quat, (_DOWN @ own.reshape(3, 3).T).reshape(-1))
    for sensor in gripper.sensors:
        gripper.delete(sensor)
    for body in gripper.bodies[1:]:
        body.gravcomp = 1
    spec.attach(gripper, frame=spec.body("hand").add_frame(pos=-_DOWN @ _GRIP, quat=quat), prefix=_PREFIX)


def _inertia(model: mujoco.MjModel) -> NDArray[np.floating]:
    """Return the ``(6, 6)`` inertia of the hand's six joints, which come first, with the fingers half open."""
    data = mujoco.MjData(model)
    for name, side in zip(_FINGERS, SIDES, strict=True):
        data.joint(_PREFIX + name).qpos = HALF_OPEN * side
    mujoco.mj_forward(model, data)
    first = int(model.joint("x").dofadr[0])
    return mass_matrix(model, data)[first : first + 6, first : first + 6]
