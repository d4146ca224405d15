"""What the tests share: an arm and its leader on emulated motor buses, and LeRobot's recording."""

import importlib.util
import math
import os

import pytest

if importlib.util.find_spec("lerobot") is None:
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture(scope="session", autouse=True)
def home(tmp_path_factory):
    """Give LeRobot a folder with the calibrations of the arms; it reads the variable when it is imported."""
    from motor_bus import save_calibration

    folder = tmp_path_factory.mktemp("home")
    os.environ |= {"HF_HOME": str(folder), "HF_HUB_OFFLINE": "1"}
    for kind in ("robots/so_follower", "robots/so101_paxini", "teleoperators/so_leader"):
        save_calibration(folder / "lerobot/calibration" / kind / "tests.json")


@pytest.fixture
def arms():
    """Ports of two emulated arms: the robot, and the leader that moves its joints."""
    from motor_bus import MotorBus

    with MotorBus() as arm, MotorBus(lambda now: 2048 + 400 * math.sin(5 * now)) as leader:
        yield arm.port, leader.port


@pytest.fixture
def record(tmp_path, arms):
    """Record a robot with ``lerobot-record`` in this process, its joints moved by the leader; returns the folder."""

    def run(robot, episodes=1, seconds=1):
        from lerobot.scripts import lerobot_record
        from lerobot.teleoperators.so_leader import SO101LeaderConfig

        dataset = lerobot_record.DatasetRecordConfig(
            repo_id="me/set",
            root=tmp_path / "set",
            single_task="press",
            fps=20,
            num_episodes=episodes,
            episode_time_s=seconds,
            reset_time_s=0,
            push_to_hub=False,
        )
        leader = SO101LeaderConfig(port=arms[1], id="tests")
        lerobot_record.record(
            lerobot_record.RecordConfig(robot=robot, dataset=dataset, teleop=leader, play_sounds=False)
        )
        return tmp_path / "set"

    return run


@pytest.fixture
def beside(arms):
    """Return the configuration of the emulated arm with sensors; each is a dictionary of options."""

    def make(**sensors):
        from lerobot_robot_paxisim import PaxisimRobotConfig, PaxisimSensorConfig

        arm = {"type": "so101_follower", "port": arms[0], "id": "tests"}
        chosen = {name: PaxisimSensorConfig(**options) for name, options in sensors.items()}
        return PaxisimRobotConfig(robot=arm, sensors=chosen)

    return make
