"""The bench: the ground truth, a model that shares little with the scene given to the diagnosis.

A stage driven by servos with friction presses a round tip on a pad of nine spheres per taxel, where the scene has four.
Time step, solver and contact settings differ from the scene's. The pose of the tip in its holder varies between
episodes. The cone is elliptic as in the scene: under a pyramidal cone a held shear force slips away, so that shear
differs from the scene's by three times its size, which no gel does.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import paxisim

LAYOUT = paxisim.TaxelLayout(4, 4, (5e-3, 5e-3))  # the sensor
SCENE = paxisim.TaxelLayout(8, 8, (2.5e-3, 2.5e-3))  # the scene's pad
FINE = paxisim.TaxelLayout(12, 12, (5e-3 / 3, 5e-3 / 3))  # the bench's pad
BALL = 3.5e-3  # m, diameter of the spheres that carry the contacts
GEL = paxisim.Gel(modulus=400e3)
TIP = (27e-3, 21e-3, 18e-3)  # half axes (m) of the ellipsoid that presses
JOINTS = ("x", "y", "turn", "depth")
TIMESTEP = 1e-3
OPTION = 'cone="elliptic" impratio="12" iterations="30" ls_iterations="20" tolerance="1e-7"'
SETTLE = 0.2  # s
RATE = 50.0  # Hz
JITTER = 2e-3  # s
ENCODERS = (1e-6, 1e-6, 1e-5, 1e-6)  # encoder resolutions: m, m, rad, m


@dataclass(frozen=True)
class Truth:
    """True parameters of the bench; multiples are relative to the nominal value.

    Attributes:
        friction: Friction coefficient of the gel.
        stiffness: Stiffness of the gel, as a multiple.
        force: Force of the closing motor, as a multiple of its command.
        mount: Offset of the pad on its mount: x and y (m), and rotations about its x and y (rad).
        bumps: ``(bumps, 4)`` bumps on the pad: position x and y, width and height (m).
        size: Size of the tip, as a multiple.
        place: Mean pose of the tip in its holder: x, y, z (m) and rotations about them (rad).
        zero: Depth of the closing (m) beyond its encoder reading.
        spread: Standard deviations of the tip's pose between episodes: position (m) and rotation (rad).
    """

    friction: float = 1.0
    stiffness: float = 1.0
    force: float = 1.0
    mount: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    bumps: tuple[tuple[float, float, float, float], ...] = ()
    size: float = 1.0
    place: tuple[float, ...] = (0.0,) * 6
    zero: float = 0.0
    spread: tuple[float, float] = field(default=(0.2e-3, np.radians(0.5)))


def run(
    truth: Truth, commands: list[NDArray[np.float64]], by_force: bool, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Move the stage and read the pad.

    Args:
        truth: True parameters of the bench.
        commands: Commands of the joints in each episode, ``(steps, 4)``; the last one is a force (N) if `by_force`.
        by_force: Whether a motor drives the closing.
        rng: Random generator for the poses and the clock.

    Returns:
        Times ``(T,)`` in seconds, forces ``(T, 3, 4, 4)`` in newtons, the four encoders and the command of the closing
        ``(T, 5)``, and episode numbers ``(T,)``.
    """
    times, forces, streams, episodes = [], [], [], []
    begin = 0.0
    for number, command in enumerate(commands):
        pose = np.array(truth.place) + rng.normal(size=6) * np.repeat(truth.spread, 3)
        time, force, stream = _episode(truth, command, pose, by_force, rng)
        times.append(begin + time)
        forces.append(force)
        streams.append(stream)
        episodes.append(np.full(len(time), number))
        begin += time[-1] + 1.0
    return np.concatenate(times), np.concatenate(forces), np.concatenate(streams), np.concatenate(episodes)


def _episode(truth: Truth, command, pose, by_force: bool, rng: np.random.Generator):
    model = mujoco.MjModel.from_xml_string(_mjcf(truth, pose, by_force))
    pads = paxisim.find_pads(model)
    gel = paxisim.Gel(GEL.modulus * truth.stiffness, friction=truth.friction)
    gel.apply(model, pads)
    if truth.bumps:
        thickness = pads.thickness[0] + _heights(truth.bumps)
        paxisim.set_surface(model, pads, np.maximum(thickness, 1e-4))
    data, readout = mujoco.MjData(model), paxisim.TactileReadout(model, pads)
    data.qpos[:] = command[0]
    data.qpos[3] = -1.5e-3 if by_force else command[0, 3]
    data.qpos[3] += truth.zero
    wanted = command.copy()
    if by_force:
        wanted[:, 3] *= truth.force
    else:
        wanted[:, 3] += truth.zero
    data.ctrl[:] = wanted[0]
    mujoco.mj_step(model, data, round(SETTLE / TIMESTEP))
    every = 1 / RATE
    count = int(len(command) * TIMESTEP / every) - 1
    at = np.clip(every * np.arange(1, count) + rng.uniform(-JITTER, JITTER, count - 1), 0, None)
    samples = np.unique(np.round(at / TIMESTEP).astype(int))
    time, force, stream = [], [], []
    wanted_at = set(samples.tolist())
    for step, control in enumerate(wanted):
        data.ctrl[:] = control
        before = data.qpos.copy()
        mujoco.mj_step(model, data)
        if step in wanted_at:
            time.append(step * TIMESTEP)
            fine = readout.read(data)[0]
            force.append(fine.reshape(3, 4, 3, 4, 3).sum(axis=(2, 4)))
            said = before.copy()
            said[3] -= truth.zero
            said = np.round(said / ENCODERS) * ENCODERS
            stream.append(np.append(said, command[step, 3]))
    return np.array(time), np.array(force), np.array(stream)


def _heights(bumps) -> NDArray[np.float64]:
    x, y = FINE.positions[:, 0], FINE.positions[:, 1]
    total = np.zeros(len(x))
    for at_x, at_y, width, height in bumps:
        total += height * np.exp(-((x - at_x) ** 2 + (y - at_y) ** 2) / (2 * width**2))
    return (total - total.mean()).reshape(FINE.rows, FINE.cols)


def _mjcf(truth: Truth, pose, by_force: bool) -> str:
    half = np.array(TIP) * truth.size
    turn = Rotation.from_rotvec(pose[3:])
    quat = np.roll(turn.as_quat(), 1)
    where = f'pos="{pose[0]} {pose[1]} {pose[2]}" quat="{quat[0]} {quat[1]} {quat[2]} {quat[3]}"'
    closing = 'damping="60"' if by_force else 'frictionloss="0.3" damping="2"'
    last = (
        '<motor name="depth" joint="depth"/>'
        if by_force
        else '<position name="depth" joint="depth" kp="60000" kv="800"/>'
    )
    stage = f"""
    <mujoco model="bench">
      <option timestep="{TIMESTEP}" {OPTION}/>
      <worldbody>
        <body name="plate"/>
        <body name="stage" pos="0 0 {TIP[2]}" gravcomp="1">
          <joint name="x" type="slide" axis="1 0 0" frictionloss="0.3" damping="2"/>
          <joint name="y" type="slide" axis="0 -1 0" frictionloss="0.3" damping="2"/>
          <joint name="turn" type="hinge" axis="0 0 -1" frictionloss="0.002" damping="0.01" armature="1e-3"/>
          <joint name="depth" type="slide" axis="0 0 -1" {closing}/>
          <geom name="tip" type="ellipsoid" size="{half[0]} {half[1]} {half[2]}" {where} mass="0.5"/>
        </body>
      </worldbody>
      <actuator>
        <position name="x" joint="x" kp="60000" kv="800"/>
        <position name="y" joint="y" kp="60000" kv="800"/>
        <position name="turn" joint="turn" kp="60" kv="1"/>
        {last}
      </actuator>
    </mujoco>
    """
    tilt = Rotation.from_rotvec([truth.mount[2], truth.mount[3], 0.0])
    facing = Rotation.from_quat([1.0, 0.0, 0.0, 0.0])  # the pad faces up, so its z axis points down
    offset = facing.apply([truth.mount[0], truth.mount[1], 0.0])
    whole = np.roll((facing * tilt).as_quat(), 1)
    mount = paxisim.Mount("plate", tuple(offset), tuple(whole), name="pad")
    return paxisim.attach(stage, paxisim.Pad(FINE, thickness=BALL, taxels="spheres"), [mount]).to_xml()
