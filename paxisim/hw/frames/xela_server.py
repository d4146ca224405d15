"""Messages of XELA's server, which owns the sensors' bus and streams their taxels as JSON over a WebSocket. No I/O.

One message is one text, here a line. The first says ``{"message": "Welcome"}``. Each further one is a reading::

    {"message": 17, "type": "routine",
     "1": {"time": 1700000000.0, "sensor": "1", "model": "uSPa44", "taxels": 16,
           "data": "7F10,7C20,8A00,...", "calibrated": [0.01, -0.02, 0.3, ...]},
     "2": {...}}

A key of digits is a sensor. ``data`` holds x, y, z of each taxel as hexadecimal counts, row by row from the top left;
``calibrated`` the same as numbers, only of some models and where the server's settings say so. Sources: the ROS
packages of the vendor, github.com/mcsix/xela_server_ros2 (MIT). TCP carries the messages, so none is lost or damaged on
the way; what is not such a message is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from paxisim.hw.framing import Decoder

END = b"\n"
WELCOME = b'{"message": "Welcome"}' + END
MIDDLE = 2**15
"""Middle of the counts' 16 bits; public examples show about 32,000 at rest."""
LONGEST = 2**18
"""Bytes of a message at most; one of a hundred sensors of 16 taxels has 25,000."""


@dataclass(frozen=True, eq=False)
class SensorReading:
    """One sensor in one message.

    Attributes:
        model: As the server names it, e.g. ``"uSPa44"``.
        counts: ``(N, 3)`` float32, raw counts x, y, z of each taxel, whole numbers about `MIDDLE`.
        forces: ``(N, 3)`` float32, what the server makes of them; None where it does not.
    """

    model: str
    counts: NDArray[np.float32]
    forces: NDArray[np.float32] | None = None

    @property
    def taxels(self) -> int:
        """Number of taxels."""
        return len(self.counts)


@dataclass(frozen=True, eq=False)
class Routine:
    """One message with readings.

    Attributes:
        number: Counts the messages of the server.
        sensors: The readings by the sensor's number.
    """

    number: int
    sensors: Mapping[int, SensorReading]

    def encode(self, time: float) -> bytes:
        """As the server sends it, in a line.

        Args:
            time: What the sensors say of when they were read (s, Unix).
        """
        message: dict[str, Any] = {"message": self.number, "type": "routine"}
        for number, reading in self.sensors.items():
            message[str(number)] = {
                "time": time,
                "sensor": str(number),
                "model": reading.model,
                "taxels": reading.taxels,
                "data": ",".join(f"{count:04X}" for count in reading.counts.astype(int).ravel().tolist()),
            }
            if reading.forces is not None:
                message[str(number)]["calibrated"] = [round(value, 4) for value in reading.forces.ravel().tolist()]
        return orjson.dumps(message) + END


class RoutineDecoder(Decoder[Routine]):
    """A `Decoder` of lines of which each is a message. Welcomes are passed over; other lines count as skipped."""

    def _next(self, buffer: bytes, at: int, silent: bool) -> tuple[int, int, Routine | None]:
        begin = at
        while (end := buffer.find(END, at) + 1) > 0:
            line = buffer[at:end]
            message = _parse(line)
            if isinstance(message, Routine):
                return begin, end, message
            at = end
            if message is None:
                begin = end
        if len(buffer) - at > LONGEST:
            return len(buffer), len(buffer), None
        # a welcome goes with the message behind it
        return begin, begin, None


def says_no_reading(line: bytes) -> bool:
    """Whether a line is a message of the server that holds words alone, as its welcome does."""
    return isinstance(_parse(line), str)


def _parse(line: bytes) -> Routine | str | None:
    """The readings, the word of a message without any, or None: it is no message."""
    try:
        message = orjson.loads(line)
    except orjson.JSONDecodeError:
        return None
    if not isinstance(message, dict):
        return None
    number = message.get("message")
    if isinstance(number, str):
        return number
    if not isinstance(number, int) or message.get("type") != "routine":
        return None
    readings = {key: _sensor(value) for key, value in message.items() if key.isdecimal() and len(key) < 6}
    sensors = {int(key): reading for key, reading in readings.items() if reading is not None}
    # readings of which none can be read are those of something else
    return Routine(number, sensors) if sensors or not readings else None


def _sensor(value: Any) -> SensorReading | None:
    """One sensor's reading; None: it is none, or its numbers do not fit one another."""
    if not isinstance(value, dict):
        return None
    taxels, data, model = value.get("taxels"), value.get("data"), value.get("model", "")
    if not isinstance(data, str) or not isinstance(model, str):
        return None
    try:
        counts = np.array([int(word, 16) for word in data.split(",")], dtype=np.float32)
    except (ValueError, OverflowError):
        return None
    if len(counts) % 3 or taxels != len(counts) // 3 or not np.all((counts >= 0) & (counts < 2**24)):
        return None
    return SensorReading(model, counts.reshape(-1, 3), _forces(value.get("calibrated"), len(counts) // 3))


def _forces(values: Any, taxels: int) -> NDArray[np.float32] | None:
    """``(N, 3)`` calibrated values; None where there are none, or not as many numbers as there must be."""
    if not isinstance(values, list) or len(values) != 3 * taxels:
        return None
    if not all(isinstance(value, (int, float)) and abs(value) < 1e6 for value in values):
        return None
    return np.array(values, dtype=np.float32).reshape(-1, 3)
