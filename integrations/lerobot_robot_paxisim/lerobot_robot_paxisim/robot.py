"""The robot type ``paxisim``: another robot of LeRobot, with the taxels of tactile sensors in its observations."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import draccus
from lerobot.processor import RobotAction, RobotObservation
from lerobot.robots import Robot, RobotConfig, make_robot_from_config
from lerobot.utils.decorators import check_if_already_connected

from lerobot_robot_paxisim.pads import Pads
from paxisim import Calibration, InvalidValueError, load_profile


@dataclass
class PaxisimSensorConfig:
    """One tactile sensor.

    Attributes:
        port: Serial port, or address of a server, as for `paxisim.open_sensor`.
        profile: Name of a profile, or a profile file.
        calibration: Calibration file of ``paxisim calibrate``, for a sensor that does not measure newtons.
        zero: Whether connecting makes the present reading the pads' zero; leave them untouched meanwhile.
    """

    port: str
    profile: str
    calibration: str | None = None
    zero: bool = False


@RobotConfig.register_subclass("paxisim")
@dataclass(kw_only=True)
class PaxisimRobotConfig(RobotConfig):
    """Another robot, and sensors.

    Attributes:
        robot: The other robot, with the keys of its own configuration and its ``type``. LeRobot's command line cannot
            nest one robot's options in another's, hence the dictionary.
        sensors: Sensors by the prefix of the names of their numbers.
    """

    robot: dict[str, Any]
    sensors: dict[str, PaxisimSensorConfig] = field(default_factory=dict)


class PaxisimRobot(Robot):
    """Another robot whose observations also have one number for each axis of each taxel.

    Actions, cameras and calibration are those of the other robot.

    Attributes:
        robot: The other robot.
    """

    config_class = PaxisimRobotConfig
    name = "paxisim"

    def __init__(self, config: PaxisimRobotConfig) -> None:
        """Make the other robot and load the profiles. No I/O on ports.

        Raises:
            InvalidValueError: Two features have the same name, or a profile or calibration is malformed.
            UnknownNameError: There is no such profile.
        """
        super().__init__(config)
        self.config = config
        # draccus documents decode, but does not declare it as exported
        other = draccus.decode(RobotConfig, config.robot)  # pyright: ignore[reportPrivateImportUsage]
        self.robot = make_robot_from_config(other)
        self._pads = {prefix: _pads(prefix, sensor) for prefix, sensor in config.sensors.items()}
        names = [name for pads in self._pads.values() for name in pads.names]
        both = [name for name in names if name in self.robot.observation_features]
        if both:
            raise InvalidValueError(f"the robot already observes {both[0]}: give the sensor another name")
        self._tactile = dict.fromkeys(names, float)

    @property
    def cameras(self) -> dict[str, Any]:
        """Cameras of the other robot."""
        return getattr(self.robot, "cameras", {})

    @property
    def observation_features(self) -> dict[str, Any]:
        """Features of the other robot, then those of the sensors in the order of the configuration."""
        return {**self.robot.observation_features, **self._tactile}

    @property
    def action_features(self) -> dict[str, Any]:
        """Features of the other robot."""
        return self.robot.action_features

    @property
    def is_connected(self) -> bool:
        """Whether the other robot is connected and the sensors are open."""
        return self.robot.is_connected and all(pads.is_open for pads in self._pads.values())

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Open the sensors, then connect the other robot, which may start to move.

        Raises:
            DeviceError: A sensor cannot be opened; the message says why.
        """
        with ExitStack() as opened:
            for prefix, pads in self._pads.items():
                pads.open(self.config.sensors[prefix].zero)
                opened.callback(pads.close)
            self.robot.connect(calibrate)
            opened.pop_all()

    @property
    def is_calibrated(self) -> bool:
        """Whether the other robot is calibrated."""
        return self.robot.is_calibrated

    def calibrate(self) -> None:
        """Calibrate the other robot."""
        self.robot.calibrate()

    def configure(self) -> None:
        """Configure the other robot."""
        self.robot.configure()

    def get_observation(self) -> RobotObservation:
        """Return the observation of the other robot and the newest readings of the sensors.

        Raises:
            DeviceError: A sensor no longer gives readings: an old one is never returned in place of a new one.
        """
        found = self.robot.get_observation()
        for pads in self._pads.values():
            found |= pads.read()
        return found

    def send_action(self, action: RobotAction) -> RobotAction:
        """Send an action to the other robot and return what it sent."""
        return self.robot.send_action(action)

    def disconnect(self) -> None:
        """Disconnect the other robot and close the sensors."""
        with ExitStack() as opened:
            for pads in self._pads.values():
                opened.callback(pads.close)
            self.robot.disconnect()


def _pads(prefix: str, config: PaxisimSensorConfig) -> Pads:
    calibration = None if config.calibration is None else Calibration.load(config.calibration)
    return Pads(prefix, config.port, load_profile(config.profile), calibration)
