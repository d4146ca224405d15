"""``lerobot-record`` beside emulated sensors: what is recorded is what paxisim's driver returned."""

import json
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from paxisim import (
    DeviceError,
    DeviceTimeoutError,
    Emulator,
    Faults,
    InvalidValueError,
    PortNotFoundError,
    Recording,
    calibrate_sensor,
    load_profile,
    open_sensor,
)

PROFILES = ("gen2-box-120", "gen3-highspeed", "gen1-stream", "anyskin", "xela-uspa44")
FAST = "gen3-highspeed-mc-m2020"
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")


def signal_of(profile, steps=1, seconds=0.25):
    """A signal of whole counts that differ from taxel to taxel, and from step to step."""
    chosen = load_profile(profile)
    shape = (steps, len(chosen.slots), *chosen.wire_layout.shape)
    tensors = np.random.default_rng(0).integers(3, 100, shape) * chosen.resolution
    return lambda now: tensors[int(now / seconds) % steps]


def of_driver(board, steps=1, calibration=None):
    """Return the different tensors that paxisim's driver reads from a board."""
    found = []
    with open_sensor(board.port, board.profile, calibration=calibration) as sensor:
        while len(found) < steps:
            force = sensor.read().force
            found += [] if any(np.array_equal(force, old) for old in found) else [force]
    return found


def test_from_the_shell(tmp_path, arms):
    """Two sensors beside an arm, in two episodes; LeRobot and paxisim read the same numbers."""
    profile = tmp_path / "tips.toml"
    profile.write_text(
        'like = "gen3-highspeed"\nslots = [{ name = "thumb", index = 10 }, { name = "index", index = 18 }]\n'
    )
    folder = tmp_path / "set"
    with Emulator(profile, signal_of(profile, steps=4)) as tips, Emulator(FAST, signal_of(FAST)) as palm:
        words = [
            *("--robot.type=paxisim", f"--robot.robot={{type: so101_follower, port: {arms[0]}, id: tests}}"),
            f"--robot.sensors={{tips: {{port: {tips.port}, profile: {profile}}}, "
            f"palm: {{port: {palm.port}, profile: {FAST}}}}}",
            *("--teleop.type=so101_leader", f"--teleop.port={arms[1]}", "--teleop.id=tests"),
            *("--dataset.repo_id=me/set", f"--dataset.root={folder}", "--dataset.single_task=press"),
            *("--dataset.num_episodes=2", "--dataset.episode_time_s=2", "--dataset.reset_time_s=0"),
            *("--dataset.fps=20", "--dataset.push_to_hub=false", "--play_sounds=false"),
        ]
        program = Path(sys.executable).with_name("lerobot-record")
        done = subprocess.run([program, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-3000:]
        sent, (still,) = of_driver(tips, steps=4), of_driver(palm)
    found = Recording.load(folder, pads=["tips.f0", "tips.f1"], layout=load_profile(profile).layout)
    assert found.pads == ("tips.f0", "tips.f1")
    assert found.episode.tolist() == [0] * 40 + [1] * 40
    at = [[np.array_equal(force, one) for one in sent].index(True) for force in found.measured]
    assert set(at) == {0, 1, 2, 3}
    assert np.count_nonzero(np.diff(at)) <= 2 * 9  # steps of 0.25 s in 2 s: no reading is out of turn
    pressed = Recording.load(folder, pads="palm.f0", layout=load_profile(FAST).layout).measured
    np.testing.assert_array_equal(pressed, np.broadcast_to(still, pressed.shape))
    assert np.ptp(found.covariates["observation.state.elbow_flex.pos"]) > 20  # degrees, as the leader moves
    names = json.loads((folder / "meta/info.json").read_text())["features"]["observation.state"]["names"]
    assert names[:8] == [*(f"{joint}.pos" for joint in JOINTS), "tips.f0.p00.fx", "tips.f0.p00.fy"]

    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    state = LeRobotDataset("me/set", root=folder)[0]["observation.state"].numpy()
    flat = state[6 : 6 + 2 * 52 * 3].reshape(2, 52, 3).swapaxes(1, 2)
    np.testing.assert_array_equal(flat, found.measured[0, :, :, 0])


@pytest.mark.parametrize("profile", PROFILES)
def test_the_recorded_tensor_is_that_of_the_driver(record, beside, profile):
    with Emulator(profile, signal_of(profile)) as board:
        (force,) = of_driver(board)
        folder = record(beside(tips={"port": board.port, "profile": profile}))
    chosen = load_profile(profile)
    found = Recording.load(folder, layout=chosen.layout)
    np.testing.assert_array_equal(found.measured, np.broadcast_to(force, (20, *force.shape)))
    assert (found.unit, found.layout) == (chosen.unit, chosen.layout)


def test_a_calibrated_sensor_is_recorded_in_newtons(tmp_path, record, beside):
    rng = np.random.default_rng(0)
    time = np.arange(800) / 80
    load = 5 * np.sin(time) ** 2
    fields = load[:, None] * rng.normal(size=15) * 20 + rng.normal(size=(800, 15))
    fields = fields.reshape(-1, 1, 3, 1, 5).astype(np.float32)
    rig = Recording(time, fields, covariates={"Fz": load}, metadata={"unit": "uT"})
    calibration = calibrate_sensor(rig, {"Fz": "Fz"})
    calibration.save(tmp_path / "skin.json")
    with Emulator("anyskin", signal_of("anyskin")) as board:
        (force,) = of_driver(board, calibration=calibration)
        options = {"port": board.port, "profile": "anyskin", "calibration": str(tmp_path / "skin.json")}
        found = Recording.load(record(beside(skin=options)))
    np.testing.assert_array_equal(found.measured, np.broadcast_to(force, (20, *force.shape)))
    assert found.unit == "N"


def test_pads_zeroed_when_they_are_connected(record, beside):
    with Emulator(FAST, signal_of(FAST)) as board:
        folder = record(beside(tips={"port": board.port, "profile": FAST, "zero": True}))
    assert not Recording.load(folder).measured.any()


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"profile": "gen2-box-121"}, ValueError, "unknown profile 'gen2-box-121'; did you mean 'gen2-box-120'"),
        ({"calibration": "none.json"}, ValueError, "none.json"),
        ({}, PortNotFoundError, "no port '/dev/none'"),
    ],
)
def test_what_cannot_be_opened(record, beside, options, error, words):
    with pytest.raises(error, match=words):
        record(beside(tips={"port": "/dev/none", "profile": FAST, **options}))


def test_two_sensors_of_the_same_name():
    from lerobot_robot_paxisim import PaxisimRobot, PaxisimRobotConfig, PaxisimSensorConfig

    arm, tips = {"type": "so101_follower", "port": "/dev/none"}, {"port": "/dev/none", "profile": FAST}
    inner = {"type": "paxisim", "robot": arm, "sensors": {"tips": tips}}
    with pytest.raises(
        InvalidValueError, match=r"the robot already observes tips\.f0\.p00\.fx: give the sensor another"
    ):
        PaxisimRobot(PaxisimRobotConfig(robot=inner, sensors={"tips": PaxisimSensorConfig(**tips)}))


def test_a_sensor_that_goes_away_ends_the_recording_and_keeps_the_episodes_before(tmp_path, record, beside):
    about = tmp_path / "set/meta/info.json"

    def unplug():
        while not (about.exists() and '"total_episodes": 1' in about.read_text()):
            time.sleep(0.05)
        board.unplug()

    with Emulator(FAST, signal_of(FAST)) as board:
        (force,) = of_driver(board)
        puller = threading.Thread(target=unplug)
        puller.start()
        with pytest.raises(PortNotFoundError, match="went away"):
            record(beside(tips={"port": board.port, "profile": FAST}), episodes=2, seconds=2)
        puller.join()
    found = Recording.load(tmp_path / "set", layout=load_profile(FAST).layout)
    np.testing.assert_array_equal(found.measured, np.broadcast_to(force, (40, *force.shape)))


@pytest.fixture
def opened(beside):
    """Return a robot, connected with a sensor on a board."""
    robots = []

    def make(board):
        from lerobot_robot_paxisim import PaxisimRobot

        robots.append(PaxisimRobot(beside(tips={"port": board.port, "profile": board.profile.name})))
        robots[-1].connect()
        return robots[-1]

    yield make
    for robot in robots:
        if robot.is_connected:
            robot.disconnect()


def observe_for_ever(robot):
    """Read observations, each of which must be new."""
    changed, last = time.monotonic(), None
    while True:
        last, before = robot.get_observation(), last
        changed = time.monotonic() if last != before else changed
        assert time.monotonic() - changed < 0.3


def test_a_board_that_falls_silent_gives_no_old_reading(opened):
    silence = threading.Event()
    signal = signal_of(FAST, steps=1000, seconds=0.01)

    def until_silent(now):
        while silence.is_set():
            time.sleep(0.01)
        return signal(now)

    with Emulator(FAST, until_silent) as board:
        robot = opened(board)
        silence.set()
        began = time.monotonic()
        with pytest.raises(DeviceTimeoutError, match=r"no frame from .* within 1 s"):
            observe_for_ever(robot)
        assert time.monotonic() - began < 3
        silence.clear()


def test_a_pad_in_error_is_never_recorded_as_a_force(opened):
    profile = "gen1-stream"
    with Emulator(profile, signal_of(profile), faults=Faults(status=0.5)) as board:
        robot = opened(board)
        for _ in range(50):
            robot.get_observation()
    said = r"tips on .*: the board reports an error of pad pulp-1 \(status \[\d+, 0, 0, 0\]\), for 1 s"
    with (
        Emulator(profile, signal_of(profile), faults=Faults(status=1.0)) as board,
        pytest.raises(DeviceError, match=said),
    ):
        opened(board)
