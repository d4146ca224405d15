"""Robots of other people grasp a box: the truth of `robots.py`, another model than the scene given to the replay.

Each robot is a public hand on a lift, or a public arm with its gripper. Its actuators follow set-points: close, lift,
shake, lower, slide along the table, open, and grasp again a little further. The recording has what such a robot
reports: the position of each axis in steps of its encoder, and the opening of the gripper. It does not report where the
box is; its pose at the start of an episode is drawn. The truth has another time step and other contact settings, and
its pads have nine cubes for each taxel, where the owner's have four.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

import paxisim

SENSOR = paxisim.TaxelLayout(4, 3, (4e-3, 4e-3))
TRUE, OWNED = 3, 2  # cubes along each side of a taxel, in the true pads and in the owner's
GEL = paxisim.Gel(modulus=1e6)
BOX = "box:30x30x60mm:0.2kg"
RATE = 50  # Hz
TIMESTEP = 1e-3  # s, of the truth; the scene has that of the public model
NOISE, COUNT = 0.02, 0.1  # N, standard deviation before rounding, and step of the sensor
ENCODER = {"lift": 1e-5, "arm": 2 * np.pi / 2**17}  # m, rad
SPREAD = (4e-4, np.radians(0.5))  # standard deviations of the box's place (m) and turn (rad) on the table
LOWERED = 0.1  # m, position of the lift at the box
ABOVE = 0.04  # m, from the table's top to the middle of the pads
LIFT = """
<mujoco model="lift">
  <option timestep="0.002" cone="elliptic" impratio="10" integrator="implicitfast"/>
  <default>
    <geom contype="0" conaffinity="0" density="500"/>
    <joint type="slide" armature="5"/>
    <position kp="20000" dampratio="1"/>
  </default>
  <worldbody>
    <light pos="0 -1 1" dir="0 1 -1"/>
    <body name="beam" pos="0 0 0.45">
      <joint name="lift_x" axis="1 0 0"/>
      <geom size="0.02"/>
      <body name="cart">
        <joint name="lift_y" axis="0 1 0"/>
        <geom size="0.02"/>
        <body name="flange" quat="0 1 0 0">
          <joint name="lift_z" axis="0 0 1"/>
          <geom size="0.02"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="lift_x" joint="lift_x"/>
    <position name="lift_y" joint="lift_y"/>
    <position name="lift_z" joint="lift_z"/>
  </actuator>
</mujoco>
"""


@dataclass(frozen=True)
class Robot:
    """A robot.

    Attributes:
        arm: File of the arm in MuJoCo Menagerie; empty for the lift.
        hand: File of the hand; empty if the arm has one.
        axes: Joints of the arm.
        gripper: Actuator that closes the gripper.
        strength: Factor on its gains: it then grips with about 10 N.
        closed: Control that closes it; the other end of 0 to 255 opens it.
        width_step: Step of the opening that the gripper reports (m).
        middle: Middle of the pads (m) when they hold the box.
    """

    arm: str
    hand: str
    axes: tuple[str, ...]
    gripper: str
    strength: float
    closed: float
    width_step: float
    middle: tuple[float, float, float]


_LIFT_AXES = ("lift_x", "lift_y", "lift_z")
ROBOTS = {
    "panda": Robot(
        "", "franka_emika_panda/hand.xml", _LIFT_AXES, "actuator8", 20.0, 0.0, 1e-5, (0.0, 0.0, 0.2467)
    ),
    "2f85": Robot(
        "", "robotiq_2f85_v4/2f85.xml", _LIFT_AXES, "fingers_actuator", 0.3, 255.0, 0.085 / 255, (0.0, 0.0, 0.1957)
    ),
    "xarm7": Robot(
        "ufactory_xarm7/xarm7.xml", "", tuple(f"joint{i}" for i in range(1, 8)), "gripper", 0.3, 255.0, 1e-4,
        (0.3999, 0.0, 0.3575),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Truth:
    """The true world.

    Attributes:
        friction: Friction coefficient of the gel.
        offset: Shift of the first pad in its plane (m).
        sensor: Chain from forces to readings.
    """

    friction: float = 1.0
    offset: tuple[float, float] = (0.0, 0.0)
    sensor: paxisim.Chain = field(default_factory=paxisim.Chain)


def scene_model(
    robot: Robot, hands: Path, cubes: int, mounts: Sequence[paxisim.Mount] | None = None
) -> paxisim.TactileGripper:
    """Return the robot with table, box and pads, as its owner composes it, with some cubes along each taxel."""
    x, y, z = robot.middle
    composed = paxisim.compose_scene(
        hands / robot.arm if robot.arm else LIFT,
        hands / robot.hand if robot.hand else None,
        at="flange" if robot.hand else "",
        table=(x, y, z - ABOVE),
        objects=[f"{BOX}@{x},{y},{z - ABOVE + 0.03}"],
    )
    return paxisim.attach(composed.spec, paxisim.Pad(SENSOR.subdivide(cubes, cubes), gel=GEL), mounts)


def record(
    robot: Robot, hands: Path, mounts: Sequence[paxisim.Mount], truth: Truth, rng: np.random.Generator, episodes: int
) -> paxisim.Recording:
    """Return what the robot and its sensor record.

    Args:
        robot: The robot.
        hands: Folder of MuJoCo Menagerie.
        mounts: Mounts of the pads in the owner's model.
        truth: The true world.
        rng: Random generator of the motion, the box's poses and the noise.
        episodes: Number of episodes of about 14 s.
    """
    world = _World(robot, hands, mounts, truth)
    forces, streams, numbers = [], [], []
    for number in range(episodes):
        force, stream = world.episode(rng)
        forces.append(np.asarray(truth.sensor.run(force, np.arange(len(force)) / RATE)))
        streams.append(stream)
        numbers.append(np.full(len(force), number))
    reading = np.concatenate(forces)
    reading = COUNT * np.rint((reading + rng.normal(0, NOISE, reading.shape)) / COUNT)
    episode, values = np.concatenate(numbers), np.concatenate(streams)
    time = np.arange(len(episode)) / RATE + episode  # a pause of a second between two episodes
    covariates = dict(zip((*robot.axes, "gripper_width"), values.T, strict=True))
    return paxisim.Recording(
        time, reading.astype(np.float32), covariates=covariates, episode=episode, layout=SENSOR, pads=("left", "right")
    )


class _World:
    def __init__(self, robot: Robot, hands: Path, mounts: Sequence[paxisim.Mount], truth: Truth) -> None:
        tactile = scene_model(robot, hands, TRUE, (_shifted(mounts[0], truth.offset), *mounts[1:]))
        option = tactile.spec.option
        option.timestep, option.impratio, option.iterations = TIMESTEP, 20, 60
        self._robot, self._model = robot, tactile.compile()
        self._pads = tactile.bind(self._model)
        replace(GEL, friction=truth.friction).apply(self._model, self._pads)
        self._readout = paxisim.TactileReadout(self._model, self._pads)
        model, data = self._model, mujoco.MjData(self._model)
        self._hand = model.actuator(robot.gripper).id
        for table in (model.actuator_gainprm, model.actuator_biasprm, model.actuator_forcerange):
            table[self._hand] *= robot.strength
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        else:
            data.joint("lift_z").qpos[:] = data.actuator("lift_z").ctrl[:] = LOWERED
        data.ctrl[self._hand] = 255.0 - robot.closed
        free = int(np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE))[-1])
        self._box = slice(int(model.jnt_qposadr[free]), int(model.jnt_qposadr[free]) + 7)
        place = data.qpos[self._box].copy()
        for _ in range(round(1 / TIMESTEP)):  # the hand opens and the arm settles
            data.qpos[self._box] = place
            mujoco.mj_step(model, data)
        self._home, self._ctrl, self._data = data.qpos.copy(), data.ctrl.copy(), data
        self._axes = [int(model.jnt_qposadr[model.joint(name).id]) for name in robot.axes]
        moved = {int(model.actuator_trnid[i, 0]): i for i in range(model.nu) if model.actuator_trntype[i] == 0}
        self._drives = [moved[model.joint(name).id] for name in robot.axes]

    def episode(self, rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return forces ``(T, 2, 3, rows, cols)`` (N), and the axes and the opening ``(T, axes + 1)``."""
        robot, model, data = self._robot, self._model, self._data
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.ctrl[:] = self._home, self._ctrl
        turn = rng.normal(0, SPREAD[1])
        data.qpos[self._box] += [*rng.normal(0, SPREAD[0], 2), 0, np.cos(turn / 2) - 1, 0, 0, np.sin(turn / 2)]
        mujoco.mj_step(model, data, round(0.3 / TIMESTEP))
        across = data.xmat[self._pads.bodies[0]].reshape(3, 3)[:, 2]
        along = np.cross(across, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(across, [0.0, 0.0, 1.0]))
        shift, grip = _motion(along, rng)
        joints = self._reached(shift)
        step = ENCODER["arm" if robot.arm else "lift"]
        forces, streams = [], []
        for k in range(len(grip)):
            data.ctrl[self._drives] = self._ctrl[self._drives] + joints[k] - joints[0]
            data.ctrl[self._hand] = self._ctrl[self._hand] + (robot.closed - self._ctrl[self._hand]) * grip[k]
            mujoco.mj_step(model, data)
            if k % round(1 / RATE / TIMESTEP) == 0:
                fine = self._readout.read(data)
                forces.append(SENSOR.subdivide(TRUE, TRUE).pool_force(fine, TRUE, TRUE))
                apart = np.diff(data.xpos[self._pads.bodies], axis=0)[0]
                width = abs(apart @ data.xmat[self._pads.bodies[0]].reshape(3, 3)[:, 2])
                axes = step * np.round(data.qpos[self._axes] / step)
                streams.append([*axes, robot.width_step * np.round(width / robot.width_step)])
        return np.array(forces), np.array(streams)

    def _reached(self, shift: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the arm's joints ``(T, axes)`` that displace the hand by ``(T, 3)`` without turning it."""
        model, data = self._model, mujoco.MjData(self._model)
        data.qpos[:] = self._home
        mujoco.mj_kinematics(model, data)
        joint = model.joint(self._robot.axes[-1]).id
        body, dofs = int(model.jnt_bodyid[joint]), [int(model.joint(name).dofadr[0]) for name in self._robot.axes]
        origin, turn = data.xpos[body].copy(), data.xquat[body].copy()
        knots = np.append(np.arange(0, len(shift), 20), len(shift) - 1)
        found, jacobian = np.zeros((len(knots), len(dofs))), np.zeros((2, 3, model.nv))
        back, between, error = np.zeros(4), np.zeros(4), np.zeros(6)
        for n, knot in enumerate(knots):
            for _ in range(10):
                mujoco.mj_kinematics(model, data)
                mujoco.mj_comPos(model, data)
                mujoco.mj_jacBody(model, data, jacobian[0], jacobian[1], body)
                mujoco.mju_negQuat(back, data.xquat[body])
                mujoco.mju_mulQuat(between, turn, back)
                error[:3] = origin + shift[knot] - data.xpos[body]
                mujoco.mju_quat2Vel(error[3:], between, 1.0)
                if np.abs(error).max() < 1e-7:
                    break
                data.qpos[self._axes] += np.linalg.lstsq(jacobian.reshape(6, -1)[:, dofs], error, rcond=1e-6)[0]
            found[n] = data.qpos[self._axes]
        return np.column_stack([np.interp(np.arange(len(shift)), knots, column) for column in found.T])


def _shifted(mount: paxisim.Mount, offset: tuple[float, float]) -> paxisim.Mount:
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, np.array(mount.quat) / np.linalg.norm(mount.quat))
    x, y, z = np.array(mount.pos) + turn.reshape(3, 3) @ np.array([*offset, 0.0])
    return replace(mount, pos=(float(x), float(y), float(z)))


def _motion(along: NDArray[np.float64], rng: np.random.Generator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return set-points of an episode: displacements ``(T, 3)`` (m), and the grip ``(T,)`` from 0 to 1.

    There are two grasps, each with a lift and a shake. In the first, the box is pushed along the table.
    """
    up, place, time = np.array([0.0, 0.0, 1.0]), np.zeros(3), 0.0
    knots: list[tuple[float, NDArray[np.float64], float]] = [(0.0, place, 0.0)]

    def go(seconds: float, shift: NDArray[np.float64] | None = None, grip: float | None = None) -> None:
        nonlocal time
        time += seconds
        knots.append((time, knots[-1][1] if shift is None else shift, knots[-1][2] if grip is None else grip))

    for first in (True, False):
        go(0.4)
        go(rng.uniform(0.8, 1.2), grip=rng.uniform(0.8, 1.0))
        go(rng.uniform(0.4, 1.5))
        high = place + rng.uniform(0.01, 0.02) * up
        go(0.5, high)
        for phase in np.arange(1, 13) / 12:
            go(1 / 12, high + 6e-3 * np.sin(2 * np.pi * 3 * phase) * along)
        go(0.3, high)
        go(rng.uniform(0.2, 1.0))
        go(0.6, place + 5e-4 * up)
        if first:
            go(0.4, place - 1.5e-3 * up)
            go(0.8, place - 1.5e-3 * up + 12e-3 * along)
            place = place + 12e-3 * along
        go(0.4, place)
        go(0.4, grip=0.0)
        go(0.3)
        if first:
            place = place + rng.uniform(-3e-3, 3e-3) * along + rng.uniform(-3e-3, 3e-3) * up
            go(0.4, place)
    at, shifts, grips = (np.array(column) for column in zip(*knots, strict=True))
    steps = np.arange(0, time, TIMESTEP)
    path = np.column_stack([np.interp(steps, at, column) for column in shifts.T])
    rounding = np.hanning(round(0.08 / TIMESTEP) + 2)[1:-1]  # a robot's controller rounds corners
    rounded = [
        np.convolve(np.pad(column, len(rounding), mode="edge"), rounding / rounding.sum(), "same") for column in path.T
    ]
    return np.column_stack(rounded)[len(rounding) : -len(rounding)], np.interp(steps, at, grips)
