"""Messages of XELA's server, which reads the sensor bus and streams the taxels as JSON over a WebSocket. No I/O.

Each message is one WebSocket text, represented here as a line. The first is ``{"message": "Welcome"}``; every further
one is a reading::

    {"message": 17, "type": "routine",
     "1": {"time": 1700000000.0, "sensor": "1", "model": "uSPa44", "taxels": 16,
           "data": "7F10,7C20,8A00,...", "calibrated": [0.01, -0.02, 0.3, ...]},
     "2": {...}}

A key of digits denotes a sensor. ``data`` holds x, y, z of each taxel as hexadecimal counts, row by row from the top
left. ``calibrated`` holds calibrated values in the same order, for some models and only if enabled in the server's
settings. Source: the vendor's ROS packages, github.com/mcsix/xela_server_ros2 (MIT). TCP carries the messages, so none
is lost or damaged in transit; anything that is not such a message is skipped.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import orjson
from numpy.typing import NDArray

from paxisim.hw.link.framing import Decoder

MESSAGE_END = b"\n"
WELCOME = b'{"message": "Welcome"}' + MESSAGE_END
COUNTS_MIDDLE = 2**15
"""Middle of the 16-bit range of counts; public examples show about 32,000 at rest."""
MAX_MESSAGE_BYTES = 2**18
"""Maximum number of bytes in a message; a message with a hundred sensors of 16 taxels has 25,000."""

_SENSOR = re.compile(r"0|[1-9][0-9]{0,4}")
_COUNT = re.compile(r"[0-9A-Fa-f]{1,4}")


@dataclass(frozen=True, eq=False)
class SensorReading:
    """Reading of one sensor in one message.

    Attributes:
        model: Model name that the server reports, e.g. ``"uSPa44"``.
        counts: ``(N, 3)`` float32, raw counts x, y, z of each taxel; integers around `COUNTS_MIDDLE`.
        forces: ``(N, 3)`` float32, the server's calibrated values; None if it sends none.
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
        number: The server's message counter.
        sensors: Readings by sensor number.
    """

    number: int
    sensors: Mapping[int, SensorReading]

    def encode(self, time: float) -> bytes:
        """Encode the message as the server sends it, followed by a newline.

        Args:
            time: Timestamp of all sensors' readings (s, Unix).
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
        return orjson.dumps(message) + MESSAGE_END


class RoutineDecoder(Decoder[Routine]):
    """A `Decoder` of lines with one message each. Ignores welcomes; counts lines that are not messages as skipped."""

    def _next(self, buffer: bytes, at: int, silent: bool) -> tuple[int, int, Routine | None]:
        begin = at
        while (end := buffer.find(MESSAGE_END, at) + 1) > 0:
            line = buffer[at:end]
            message = _parse(line)
            if isinstance(message, Routine):
                return begin, end, message
            at = end
            if message is None:
                begin = end
        if len(buffer) - at > MAX_MESSAGE_BYTES:
            return len(buffer), len(buffer), None
        # the bytes of a welcome are attributed to the message after it
        return begin, begin, None


def says_no_reading(line: bytes) -> bool:
    """Whether a line is a message of the server that holds only a word, such as its welcome."""
    return isinstance(_parse(line), str)


def _parse(line: bytes) -> Routine | str | None:
    """Return the readings, the word of a message without readings, or None if the line is not a message."""
    try:
        message = orjson.loads(line)
    except orjson.JSONDecodeError:
        return None
    if not isinstance(message, dict):
        return None
    number = message.get("message")
    if isinstance(number, str):
        return number
    if type(number) is not int or message.get("type") != "routine":
        return None
    readings = {key: _sensor(key, value) for key, value in message.items() if _SENSOR.fullmatch(key)}
    sensors = {int(key): reading for key, reading in readings.items() if reading is not None}
    # if none of the readings can be parsed, the message comes from something else
    return Routine(number, sensors) if sensors or not readings else None


def _sensor(key: str, value: Any) -> SensorReading | None:
    """Return one sensor's reading; None if the value is not a reading of it or its numbers are inconsistent."""
    if not isinstance(value, dict) or str(value.get("sensor", key)) != key:
        return None
    taxels, data, model = value.get("taxels"), value.get("data"), value.get("model", "")
    if not isinstance(data, str) or not isinstance(model, str):
        return None
    words = data.split(",")
    if len(words) % 3 or taxels != len(words) // 3 or not all(map(_COUNT.fullmatch, words)):
        return None
    counts = np.array([int(word, 16) for word in words], dtype=np.float32)
    return SensorReading(model, counts.reshape(-1, 3), _forces(value.get("calibrated"), len(counts) // 3))


def _forces(values: Any, taxels: int) -> NDArray[np.float32] | None:
    """Return the ``(N, 3)`` calibrated values; None if they are missing, invalid or of the wrong number."""
    if not isinstance(values, list) or len(values) != 3 * taxels:
        return None
    if not all(type(value) in (int, float) and abs(value) < 1e6 for value in values):
        return None
    return np.array(values, dtype=np.float32).reshape(-1, 3)
