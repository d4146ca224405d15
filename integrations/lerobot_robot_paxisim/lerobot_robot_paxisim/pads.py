"""The pads of one sensor as numbers with names, the only form in which LeRobot records what is not an image."""

from __future__ import annotations

import contextlib
import time

import numpy as np

from paxisim import Calibration, DeviceError, DeviceTimeoutError, Frame, Profile, TactileSensor, open_sensor

MAX_AGE = 0.1
"""Largest age (s) of a reading that is recorded."""
WAIT = 1.0
"""Longest wait (s) for a newer reading before reading fails."""

_LETTERS = {"N": "f", "uT": "b", "counts": "c"}


class Pads:
    """The pads of one sensor, read with paxisim's driver.

    Attributes:
        names: Name of each number, ``PREFIX.fK.pNN.fx`` (``fy``, ``fz``) for pad K and taxel NN in the vendor's order.
            The last part begins with ``f`` for newtons, ``b`` for microtesla and ``c`` for counts.
    """

    def __init__(self, prefix: str, port: str, profile: Profile, calibration: Calibration | None) -> None:
        """Prepare to read. No I/O.

        Args:
            prefix: What the names begin with.
            port: Port of the sensor, as for `paxisim.open_sensor`.
            profile: Profile of the sensor.
            calibration: Calibration to newtons of a sensor that measures something else.
        """
        self._prefix, self._port, self._profile, self._calibration = prefix, port, profile, calibration
        letter = _LETTERS[profile.unit if calibration is None else "N"]
        self.names = [
            f"{prefix}.f{pad}.p{taxel:02d}.{letter}{axis}"
            for pad in range(len(profile.slots))
            for taxel in range(profile.layout.taxels)
            for axis in "xyz"
        ]
        self._sensor: TactileSensor | None = None
        self._last: Frame | None = None

    @property
    def is_open(self) -> bool:
        """Whether the port is open."""
        return self._sensor is not None

    def open(self, zero: bool) -> None:
        """Open the port and wait for the first reading.

        Args:
            zero: Whether to make the present reading of the pads their zero.

        Raises:
            PortNotFoundError, PortAccessError, DeviceTimeoutError, ProtocolError, MissingExtraError: As
                `paxisim.open_sensor`.
        """
        # a port that went away may return with another zero: end the recording rather than go on
        self._sensor = open_sensor(self._port, self._profile, calibration=self._calibration, reconnect=0)
        try:
            if zero:
                self._sensor.zero()
            self.read()
        except BaseException:
            self.close()
            raise

    def read(self) -> dict[str, float]:
        """Return the newest reading by name. It is at most `MAX_AGE` old; otherwise wait for the next one.

        Raises:
            DeviceError: The board reports an error for a pad, or its readings are too old, for `WAIT`.
            DeviceTimeoutError: No reading arrived within `WAIT`.
            PortNotFoundError: The port went away.
        """
        if self._sensor is None:
            raise DeviceError(f"{self._port} is not open: connect the robot first")
        with contextlib.suppress(DeviceTimeoutError):
            self._take(self._sensor.latest(timeout=0))
        until = time.monotonic() + WAIT
        while self._last is None or time.monotonic() - self._last.time > MAX_AGE:
            newest = self._sensor.latest(WAIT)
            self._take(newest)
            if time.monotonic() > until:
                raise DeviceError(f"{self._prefix} on {self._port}: {self._why(newest)}, for {WAIT:g} s")
        values = self._profile.layout.to_flat(self._last.force)
        return dict(zip(self.names, np.ravel(values).tolist(), strict=True))

    def close(self) -> None:
        """Release the port. May be called twice."""
        if self._sensor is not None:
            self._sensor.close()
        self._sensor = self._last = None

    def _take(self, frame: Frame) -> None:
        """Keep a reading unless a pad is in error: the one before it serves until it is too old."""
        if not frame.pads_in_error:
            self._last = frame

    def _why(self, frame: Frame) -> str:
        if frame.pads_in_error:
            pads = ", ".join(self._profile.slots[pad].name for pad in frame.pads_in_error)
            return f"the board reports an error of pad {pads} (status {list(frame.status)})"
        return f"the newest reading is {time.monotonic() - frame.time:.2f} s old, expected at most {MAX_AGE:g} s"
