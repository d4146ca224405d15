"""LeRobot plugin: the robot type ``paxisim`` adds tactile sensors to any other robot of LeRobot."""

from lerobot_robot_paxisim.robot import PaxisimRobot as PaxisimRobot
from lerobot_robot_paxisim.robot import PaxisimRobotConfig as PaxisimRobotConfig
from lerobot_robot_paxisim.robot import PaxisimSensorConfig as PaxisimSensorConfig
