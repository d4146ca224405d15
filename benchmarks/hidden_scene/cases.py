"""Cases: a random error of the scene, and the recording and scene that a diagnosis is given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import paxisim
from hidden_scene import bench, motion
from hidden_scene.bench import Truth

CAUSES = (
    "friction", "gel_stiffness", "grip_force", "mount_offset", "mount_tilt", "surface", "object_size", "object_pose",
    "joint_offset",
)  # fmt: skip
COUNT = 0.1  # N per count
NOISE = 0.03  # N, standard deviation before rounding


@dataclass(frozen=True)
class Case:
    """One recording to be diagnosed.

    Attributes:
        causes: True causes, in the scene and in the sensor.
        truth: True parameters of the bench.
        values: True values of the scene's numbers by name; empty for an uneven surface.
        recording: The recording.
        scene: The nominal scene, without the true errors.
    """

    causes: tuple[str, ...]
    truth: Truth
    values: dict[str, float]
    recording: paxisim.Recording
    scene: paxisim.Scene


def case(cause: str, seed: int, *, sensor: str = "chain", beside: str = "", episodes: int = motion.EPISODES) -> Case:
    """Draw a case.

    Args:
        cause: Cause in the scene; empty for none.
        seed: Random seed.
        sensor: Sensor that reads the forces: ``"chain"`` or ``"reference"``.
        beside: Additional cause in the sensor: ``"axis_gain"``, ``"latency"`` or ``"creep"``; empty for none.
        episodes: Number of episodes, of 6 s each.
    """
    rng = np.random.default_rng([seed, 7, CAUSES.index(cause) + 1 if cause else 0, len(beside)])
    truth, values = _wrong(cause, rng)
    by_force = cause == "grip_force"
    commands = motion.episodes(np.random.default_rng([seed % 4, 11, by_force]), by_force, episodes)
    time, force, streams, episode = bench.run(truth, commands, by_force, rng)
    extra = _sensor_fault(beside, rng)
    reading = _read(extra, force, time, episode, sensor, seed, rng)
    names = (*bench.JOINTS, "motor")
    covariates = {name: streams[:, k] for k, name in enumerate(names)}
    recording = paxisim.Recording(
        time, reading[:, None].astype(np.float32), covariates=covariates, episode=episode, layout=bench.LAYOUT,
        pads=("pad",),
    )  # fmt: skip
    return Case(tuple(c for c in (cause, beside) if c), truth, values, recording, scene(by_force))


def _wrong(cause: str, rng: np.random.Generator) -> tuple[Truth, dict[str, float]]:
    """Draw the bench, and return it with the true values of the scene's wrong numbers."""

    def either(low: float, high: float) -> float:
        return float(rng.choice([-1, 1]) * rng.uniform(low, high))

    def direction(size: float) -> np.ndarray:
        angle = rng.uniform(0, 2 * np.pi)
        return size * np.array([np.cos(angle), np.sin(angle)])

    factor = float(np.exp(either(0.2, 0.45)))
    if cause == "friction":
        return Truth(friction=factor), {"friction": factor}
    if cause == "gel_stiffness":
        return Truth(stiffness=factor), {"gel_stiffness": factor}
    if cause == "grip_force":
        return Truth(force=factor), {"grip_force": factor}
    if cause == "mount_offset":
        off = direction(rng.uniform(0.6e-3, 1.5e-3))
        return Truth(mount=(*off, 0, 0)), {"mount_offset_x": off[0], "mount_offset_y": off[1]}
    if cause == "mount_tilt":
        off = direction(np.radians(rng.uniform(1.0, 2.5)))
        return Truth(mount=(0, 0, *off)), {"mount_tilt_x": off[0], "mount_tilt_y": off[1]}
    if cause == "surface":
        bumps = [(*rng.uniform(-7e-3, 7e-3, 2), rng.uniform(3e-3, 5e-3), either(0.12e-3, 0.25e-3)) for _ in range(3)]
        return Truth(bumps=tuple(bumps)), {}
    if cause == "object_size":
        size = 1 + either(0.01, 0.025)  # of 18 mm: more would lift the tip off the pad, or never let it go
        return Truth(size=size), {"object_size": size}
    if cause == "object_pose":
        off = direction(rng.uniform(0.7e-3, 1.5e-3))
        turn = direction(np.radians(rng.uniform(1.0, 2.5)))
        values = {
            "object_pose_x": off[0], "object_pose_y": off[1], "object_turn_x": turn[0], "object_turn_y": turn[1],
        }  # fmt: skip
        return Truth(place=(*off, 0.0, *turn, 0.0)), values
    if cause == "joint_offset":
        zero = either(0.15e-3, 0.4e-3)
        return Truth(zero=zero), {"joint_offset_depth": zero}
    return Truth(), {}


def _sensor_fault(name: str, rng: np.random.Generator) -> list[paxisim.augment.Transform]:
    """Draw the fault of the sensor."""
    if name == "axis_gain":
        return [
            paxisim.augment.AxisGain(
                tuple(float(g) for g in np.exp(rng.choice([-1, 1], 3) * rng.uniform(0.1, 0.25, 3)))
            )
        ]
    if name == "latency":
        return [paxisim.augment.Latency(float(rng.uniform(0.04, 0.1)))]
    if name == "creep":
        return [paxisim.augment.Creep((float(rng.uniform(0.08, 0.2)),), (float(rng.uniform(0.4, 1.5)),))]
    return []


def _read(faults, force, time, episode, sensor: str, seed: int, rng: np.random.Generator) -> np.ndarray:
    """Return the sensor's readings (N), rounded to counts."""
    chain = paxisim.Chain(faults)
    parts = []
    for number in np.unique(episode):
        own = episode == number
        parts.append(np.asarray(chain.run(force[own][:, None], time[own]))[:, 0])
    reading = np.concatenate(parts)
    if sensor == "reference":
        reading = paxisim.MagneticPad.unit(bench.LAYOUT, seed).measure(reading, rng)
    else:
        reading = reading * rng.normal(1, 0.005, reading.shape[1:])
    return COUNT * np.rint((reading + rng.normal(0, NOISE, reading.shape)) / COUNT)


def scene(by_force: bool) -> paxisim.Scene:
    """Return the nominal scene: other solver settings than the bench, and a pad of four spheres per taxel."""
    motor = '<actuator><motor name="depth" joint="depth"/></actuator>' if by_force else ""
    text = f"""
    <mujoco model="stage">
      <option timestep="0.002" cone="elliptic" impratio="10"/>
      <worldbody>
        <light pos="0.1 -0.1 0.2" dir="-1 1 -2"/>
        <body name="plate"/>
        <body name="tip" pos="0 0 {bench.TIP[2]}" gravcomp="1">
          <joint name="x" type="slide" axis="1 0 0"/>
          <joint name="y" type="slide" axis="0 -1 0"/>
          <joint name="turn" type="hinge" axis="0 0 -1"/>
          <joint name="depth" type="slide" axis="0 0 -1" damping="{60 if by_force else 0}"/>
          <geom name="tip" type="ellipsoid" size="{bench.TIP[0]} {bench.TIP[1]} {bench.TIP[2]}" mass="0.5"/>
        </body>
      </worldbody>
      {motor}
    </mujoco>
    """
    mount = paxisim.Mount("plate", quat=(0.0, 1.0, 0.0, 0.0), name="pad")
    pad = paxisim.attach(text, paxisim.Pad(bench.SCENE, thickness=bench.BALL, taxels="spheres"), [mount])
    units = {"x": "m", "y": "m", "turn": "rad", "depth": "m"}
    drives = [
        paxisim.Drive(n, joint=n, unit=u, resolution=0.0) for n, u in units.items() if not by_force or n != "depth"
    ]
    if by_force:
        drives.append(paxisim.Drive("motor", actuator="depth", unit="N"))
    return paxisim.Scene(
        pad.to_xml(), tuple(drives), "force" if by_force else "kinematic", closing="" if by_force else "depth",
        gel=bench.GEL,
    )  # fmt: skip
