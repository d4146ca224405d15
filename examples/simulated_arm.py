"""A simulated arm in place of a real one: its pad is an emulated sensor, its joint angles arrive over UDP.

A planar arm with three joints presses a pad onto a ball, drags it, and lifts it again, in real time. The forces on the
pad go to a pseudo-terminal, in the protocol of a PX6AX board (profile gen2-box-120), or to the port of another profile,
such as XELA's server (--profile xela-uspa44-calibrated). A magnetic skin (--profile anyskin, reskin or eflesh) reports
the field at its chips instead. The joint angles, in steps of an encoder, go to a UDP port as JSON, as a robot's own
program would send them; with a magnetic skin, also the force on the hand (N, axes of the pad). Record both from another
shell:

    python examples/simulated_arm.py --link my-arm --udp 5005
    paxisim record my-arm --profile gen2-box-120 --udp 5005 --seconds 10 -o press.mcap
"""

from __future__ import annotations

import json
import signal
import socket
import sys
import time
from contextlib import suppress
from pathlib import Path

import mujoco
import numpy as np
import tyro

import paxisim

UPPER, LOWER = 0.3, 0.25  # m, lengths of the links
ENCODER = 2 * np.pi / 2**16  # rad, step of the joint encoders
RATE = 500.0  # Hz, of the physics and the sensor: faster than a board is read, so that no reading repeats
EVERY = 5  # steps per message with the joint angles: 100 Hz
MODULUS = 2.4e6  # Pa, of the gel: firm, so that a taxel reads ten counts of 0.1 N
MOVE, REST = 0.5, 1.0  # s, duration of each move down or up, and pause between two presses
# m and s: depth and hold time of each press; short and long holds distinguish creep from a gain
PRESSES = ((1.2e-3, 2.5), (0.6e-3, 0.2), (1.6e-3, 0.2), (0.9e-3, 4.0), (1.4e-3, 1.0))
SKIN_THICKNESS = 0.01  # m, of a magnetic skin that would be pressed as deep; another is pressed in proportion
ENDS = np.cumsum([2 * MOVE + hold + REST for _, hold in PRESSES])
NOISE = 0.03  # N, standard deviation per taxel and reading
LOAD_NOISE = 0.02  # N, of the force sensor in the wrist
JOINTS = ("shoulder", "elbow", "wrist")

# the top of the ball is at z = 0.03 m; the arm lies in the plane y = 0, and its hand points down
ARM = f"""
<mujoco model="simulated_arm">
  <option timestep="0.002" cone="elliptic" impratio="10" integrator="implicitfast"/>
  <default>
    <joint type="hinge" axis="0 1 0" damping="2" armature="0.1"/>
    <geom contype="0" conaffinity="0" density="500"/>
    <position kp="40000" dampratio="1"/>
  </default>
  <worldbody>
    <light pos="0 -1 1" dir="0 1 -1"/>
    <geom name="ball" type="sphere" size="0.04" pos="0.35 0 -0.01" contype="1" conaffinity="1" friction="0.8"/>
    <body name="upper" pos="0 0 0.2">
      <joint name="shoulder"/>
      <geom type="capsule" fromto="0 0 0 {UPPER} 0 0" size="0.02"/>
      <body name="lower" pos="{UPPER} 0 0">
        <joint name="elbow"/>
        <geom type="capsule" fromto="0 0 0 {LOWER} 0 0" size="0.018"/>
        <body name="hand" pos="{LOWER} 0 0">
          <joint name="wrist"/>
          <geom type="box" size="0.02 0.02 0.015" pos="0 0 0.02"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder"/>
    <position name="elbow" joint="elbow"/>
    <position name="wrist" joint="wrist"/>
  </actuator>
</mujoco>
"""


def press_at(seconds: float) -> tuple[int, float]:
    """Return the number of the press at a time, and the time since its start (s)."""
    turns, rest = divmod(seconds, float(ENDS[-1]))
    number = int(np.searchsorted(ENDS, rest, side="right"))
    return int(turns) * len(PRESSES) + number, rest - (float(ENDS[number - 1]) if number else 0.0)


def tip(seconds: float, scale: float = 1.0) -> tuple[float, float]:
    """Return the target position of the hand, x and z (m): down, along the ball, and up again.

    Args:
        seconds: Time since the start.
        scale: Factor of the depths.
    """
    number, into = press_at(seconds)
    depth, hold = PRESSES[number % len(PRESSES)]
    down = np.clip(min(into, 2 * MOVE + hold - into) / MOVE, 0, 1)
    along = np.clip((into - MOVE) / hold, 0, 1)
    return 0.349 + 0.002 * along, 0.04 - (0.01 + scale * depth) * np.sin(np.pi / 2 * down) ** 2


def joint_angles(x: float, z: float) -> np.ndarray:
    """Return the joint angles (rad) for a position of the hand, with the pad level and the elbow up."""
    z = z - 0.2
    reach = x * x + z * z
    elbow = np.arccos((reach - UPPER**2 - LOWER**2) / (2 * UPPER * LOWER))
    shoulder = np.arctan2(-z, x) - np.arctan2(LOWER * np.sin(elbow), UPPER + LOWER * np.cos(elbow))
    return np.array([shoulder, elbow, -shoulder - elbow])


class Arm:
    """The arm in MuJoCo.

    Attributes:
        reading: Latest reading of the sensor, ``(1, 3, rows, cols)``: N, or uT of a magnetic skin.
        load: ``(3,)`` latest force on the hand, in the pad's axes (N).
    """

    def __init__(
        self, layout: paxisim.TaxelLayout, sensor: paxisim.Chain, skin: paxisim.MagneticSkin | None = None
    ) -> None:
        """Compile the arm with its pad, and move it to its start pose.

        Args:
            layout: Taxels of the pad, or contact cells of the skin.
            sensor: Chain that the contact forces pass on their way to the reading.
            skin: Magnetic skin whose chips are read; None for a sensor of forces.
        """
        gel = (
            paxisim.Gel(modulus=MODULUS) if skin is None else paxisim.Gel.of(skin.design.layer, layout, contact="flat")
        )
        tactile = paxisim.attach(ARM, paxisim.Pad(layout, gel=gel), [paxisim.Mount("hand", name="tip")])
        self.spec = tactile.spec
        self.model = tactile.compile()
        self._readout = paxisim.TactileReadout(self.model, tactile.bind(self.model))
        self.data = mujoco.MjData(self.model)
        self._scale = 1.0 if skin is None else skin.design.layer.thickness / SKIN_THICKNESS
        self.data.qpos[:] = self.data.ctrl[:] = joint_angles(*tip(0.0))
        mujoco.mj_forward(self.model, self.data)
        self._sensor, self._skin = sensor, skin
        self._state = sensor.initial_state(self._readout.read(self.data))
        self._rng = np.random.default_rng(0)
        self.run_until(0.0)

    def run_until(self, seconds: float) -> None:
        """Simulate up to a time, and read the sensors once."""
        before = self.data.time
        while self.data.time < seconds:
            self.data.ctrl[:] = joint_angles(*tip(self.data.time, self._scale))
            mujoco.mj_step(self.model, self.data)
        felt = self._readout.read(self.data)
        force, self._state = self._sensor.step(felt, self._state, self.data.time - before)
        self.load = felt.sum(axis=(0, 2, 3)) + self._rng.normal(0.0, LOAD_NOISE, 3)
        if self._skin is None:
            self.reading = force + self._rng.normal(0.0, NOISE, force.shape)
        else:
            self.reading = self._skin.measure(force, self._rng)

    def measured_joints(self) -> dict[str, float]:
        """Return the angle (rad) of each joint by name, in steps of its encoder."""
        return {name: float(np.round(self.data.joint(name).qpos[0] / ENCODER) * ENCODER) for name in JOINTS}


def main(
    udp: int,
    link: Path | None = None,
    profile: str = "gen2-box-120",
    seconds: float = float("inf"),
    scene: Path | None = None,
    sensor: Path | None = None,
) -> None:
    """Run the arm in real time; the first line of output is the port of the sensor.

    Args:
        udp: UDP port on 127.0.0.1 to which the joint angles are sent.
        link: Symbolic link to create to the port, if it is a serial one.
        profile: Profile of the sensor: one that reads newtons, or a magnetic skin.
        seconds: Duration in seconds; default: until Ctrl-C.
        scene: Output file for the MJCF of the arm with its pad, for a replay.
        sensor: Saved chain from forces to readings, for example a gain and creep for a diagnosis to find.
            Default: the sensor reads the forces unchanged.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    board = paxisim.load_profile(profile)
    skin = paxisim.MagneticSkin(profile) if board.family == "magnetometer-board" else None
    chain = paxisim.Chain() if sensor is None else paxisim.Chain.load(sensor)
    arm = Arm(board.layout if skin is None else skin.design.cells, chain, skin)
    # the exact field of a skin takes milliseconds, so it is computed at 50 Hz
    rate, every = (RATE, EVERY) if skin is None else (50.0, 1)
    if scene is not None:
        scene.write_text(arm.spec.to_xml(), encoding="utf-8")
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
        paxisim.Emulator(profile, lambda now: arm.reading, link=link) as emulator,
    ):
        print(emulator.port, flush=True)
        began = time.monotonic()
        for tick in range(sys.maxsize):
            due = tick / rate
            if due > seconds:
                break
            time.sleep(max(0.0, began + due - time.monotonic()))
            arm.run_until(due)
            if tick % every == 0:
                state = {"time": time.time(), **arm.measured_joints()}
                if skin is not None:  # calibrating it takes the load
                    state |= dict(zip(("Fx", "Fy", "Fz"), arm.load.tolist(), strict=True))
                sender.sendto(json.dumps(state).encode(), ("127.0.0.1", udp))


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        tyro.cli(main)
