"""An arm of six STS3215 servos on a pseudo-terminal, for LeRobot's own SO-101 code."""

import contextlib
import json
import os
import pty
import select
import threading
import time
import tty

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
MODEL, LIMITS, GOAL, POSITION = 3, 9, 42, 56  # addresses of the servo
PING, READ, WRITE, SYNC_READ, SYNC_WRITE = 1, 2, 3, 0x82, 0x83
HEAD = b"\xff\xff"


class MotorBus:
    """Servos that are at once where they are told to be; a context manager.

    Attributes:
        port: Name of the pseudo-terminal.
    """

    def __init__(self, motion=None):
        """Start at the middle; `motion` gives the position (0 to 4095) of all joints at a time (s), as of a hand."""
        self._motion, self._servos = motion, {}
        for i in range(1, len(JOINTS) + 1):
            registers = self._servos[i] = bytearray(256)
            for address, value in ((MODEL, 777), (LIMITS + 2, 4095), (GOAL, 2048), (POSITION, 2048)):
                registers[address : address + 2] = value.to_bytes(2, "little")

    def __enter__(self):
        self._ours, self._theirs = pty.openpty()
        tty.setraw(self._theirs)
        self.port = os.ttyname(self._theirs)
        self._is_over = False
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *error):
        self._is_over = True
        self._thread.join()
        os.close(self._ours)
        os.close(self._theirs)

    def _serve(self):
        left = b""
        while not self._is_over:
            if select.select([self._ours], [], [], 0.05)[0]:
                left += os.read(self._ours, 4096)
            while (at := left.find(HEAD)) >= 0 and len(left) >= at + 4 and len(left) >= at + 4 + left[at + 3]:
                size = left[at + 3]
                servo, parameters = left[at + 2], left[at + 5 : at + 3 + size]
                with contextlib.suppress(KeyError):  # no such servo
                    os.write(self._ours, b"".join(self._answers(servo, left[at + 4], parameters)))
                left = left[at + 4 + size :]

    def _answers(self, servo, instruction, parameters):
        if self._motion:
            for registers in self._servos.values():
                registers[POSITION : POSITION + 2] = int(self._motion(time.monotonic())).to_bytes(2, "little")
        if instruction == SYNC_WRITE:
            address, size = parameters[:2]
            for at in range(2, len(parameters), size + 1):
                self._write(parameters[at], address, parameters[at + 1 : at + 1 + size])
        elif instruction == SYNC_READ:
            address, size, *servos = parameters
            for one in servos:
                yield _status(one, self._servos[one][address : address + size])
        elif instruction == READ:
            yield _status(servo, self._servos[servo][parameters[0] : sum(parameters[:2])])
        elif instruction in (PING, WRITE):
            self._write(servo, parameters[0], parameters[1:]) if instruction == WRITE else self._servos[servo]
            yield _status(servo, b"")

    def _write(self, servo, address, data):
        self._servos[servo][address : address + len(data)] = data
        self._servos[servo][POSITION : POSITION + 2] = self._servos[servo][GOAL : GOAL + 2]


def save_calibration(path):
    """Write the calibration file with which LeRobot takes the servos as calibrated."""
    path.parent.mkdir(parents=True)
    motor = {"drive_mode": 0, "homing_offset": 0, "range_min": 0, "range_max": 4095}
    path.write_text(json.dumps({joint: {"id": i, **motor} for i, joint in enumerate(JOINTS, 1)}))


def _status(servo, data):
    body = bytes([servo, len(data) + 2, 0]) + data
    return HEAD + body + bytes([~sum(body) & 0xFF])
