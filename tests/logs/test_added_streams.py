"""Joint streams of other programs as covariates of a recording: ROS 2 MCAP, JSON MCAP and CSV."""

import json
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from log_files import METADATA, START, counts, write_log
from mcap.writer import Writer

from paxisim.cli import main
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.logs.mcap_writer import LogWriter
from paxisim.recording import Recording

MS = 1_000_000
JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


@pytest.fixture
def press(tmp_path):
    """A live recording of 50 samples at 100 Hz from `START`."""
    write_log(tmp_path / "press.mcap", counts(50))
    return tmp_path / "press.mcap"


def joint_state(at, names, position, velocity=(), effort=()):
    stamp = SimpleNamespace(sec=at // 10**9, nanosec=at % 10**9)
    return SimpleNamespace(
        header=SimpleNamespace(stamp=stamp, frame_id=""),
        name=names,
        position=position,
        velocity=velocity,
        effort=effort,
    )


def write_ros2(path, messages, schema="sensor_msgs/msg/JointState", definition=JOINT_STATE):
    """Write a file like ``ros2 bag record``, which logs each message 3 ms after its stamp."""
    writer_of = pytest.importorskip("mcap_ros2.writer").Writer
    with open(path, "wb") as file, writer_of(file) as writer:
        registered = writer.register_msgdef(schema, definition)
        for topic, at, message in messages:
            writer.write_message(topic, registered, message, log_time=at + 3 * MS)


def write_json(path, messages):
    """Write JSON ``messages``, given as (topic, log time, message)."""
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start()
        channels = {}
        for topic, at, message in messages:
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "json", 0)
            writer.add_message(channels[topic], at, json.dumps(message).encode(), at)
        writer.finish()


def ramp(i):
    """Return time (ns) and position (rad) of sample i at 200 Hz for a motion of 1 rad/s."""
    return START + i * 5 * MS, i * 0.005


def test_joint_states_of_ros_2_become_covariates(press, tmp_path):
    names = ["joint1", "finger"]
    messages = [
        ("/joint_states", at, joint_state(at, names, [x, -x], [1.0, -1.0], [0.5, 2 * x]))
        for at, x in map(ramp, range(-10, 120))
    ]
    write_ros2(tmp_path / "arm.mcap", messages)
    recording = Recording.load(press, streams=tmp_path / "arm.mcap")
    np.testing.assert_array_equal(recording.measured, counts(50))
    assert sorted(recording.covariates) == [
        f"{joint}{kind}" for joint in ("finger", "joint1") for kind in ("", ".effort", ".velocity")
    ]
    # at the stamps, not at the log times
    np.testing.assert_allclose(recording.covariates["joint1"], recording.time, atol=1e-6)
    np.testing.assert_allclose(recording.covariates["finger"], -recording.time, atol=1e-6)
    np.testing.assert_allclose(recording.covariates["finger.effort"], 2 * recording.time, atol=1e-6)
    assert np.unique(recording.covariates["joint1.velocity"]).tolist() == [1.0]


def test_topics_with_the_same_joint_and_messages_of_some_joints(press, tmp_path):
    messages = []
    for at, x in map(ramp, range(0, 110)):
        messages.append(("/left/joint_states", at, joint_state(at, ["joint1"], [x])))
        messages.append(("/right/joint_states", at, joint_state(0, ["joint1", "tool"], [-x, 7.0])))
    write_ros2(tmp_path / "arm.mcap", messages)
    recording = Recording.load(press, streams=[tmp_path / "arm.mcap"], align={"tool": "previous"})
    assert sorted(recording.covariates) == ["left/joint_states/joint1", "right/joint_states/joint1", "tool"]
    # without a stamp, the log time counts, 3 ms later
    np.testing.assert_allclose(
        recording.covariates["right/joint_states/joint1"][1:], 0.003 - recording.time[1:], atol=1e-6
    )
    assert np.isnan(recording.covariates["tool"][0])
    with pytest.raises(UnknownNameError, match="unknown stream to align 'tol'"):
        Recording.load(press, streams=tmp_path / "arm.mcap", align={"tol": "previous"})


def test_a_ros_2_file_that_is_cut_off_gives_what_is_whole(press, tmp_path):
    path = tmp_path / "arm.mcap"
    messages = [
        ("/joint_states", at, joint_state(at, [f"joint{j}" for j in range(7)], list(np.sin(x * np.arange(7)))))
        for at, x in map(ramp, range(0, 12000))
    ]
    write_ros2(path, messages)
    path.write_bytes(path.read_bytes()[: int(0.9 * path.stat().st_size)])
    with pytest.warns(UserWarning, match=r"arm.mcap: is cut off or damaged; the intact part was read") as warned:
        recording = Recording.load(press, streams=path)
    assert warned[0].filename == __file__
    np.testing.assert_allclose(recording.covariates["joint3"], np.sin(3 * recording.time), atol=1e-4)


def test_a_ros_2_file_without_joint_states_names_its_topics(press, tmp_path):
    text = SimpleNamespace(data="hello")
    write_ros2(tmp_path / "talk.mcap", [("/chatter", START, text)], "std_msgs/msg/String", "string data\n")
    with pytest.raises(InvalidValueError, match=r"no numeric stream.*/chatter \(std_msgs/msg/String\)"):
        Recording.load(press, streams=tmp_path / "talk.mcap")


def test_without_the_package_the_error_names_the_extra(press, tmp_path):
    at, x = ramp(0)
    write_ros2(tmp_path / "arm.mcap", [("/joint_states", at, joint_state(at, ["joint1"], [x]))])
    code = f"""
import sys
sys.modules["mcap_ros2"] = None  # as if it were not installed
from paxisim.cli import main
sys.exit(main(["convert", {str(press)!r}, {str(tmp_path / "out.npz")!r}, "--streams", {str(tmp_path / "arm.mcap")!r}]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "needs mcap_ros2, which is not installed: pip install 'paxisim[ros2]'" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out.npz").exists()


def test_json_topics(press, tmp_path):
    messages = []
    for at, x in map(ramp, range(0, 110)):
        sec, nsec = divmod(at, 10**9)
        stamp = {"sec": sec, "nsec": nsec}
        messages.append(("/joints", at + 50 * MS, {"timestamp": stamp, "name": ["a", "b"], "position": [x, 2 * x]}))
        pose = {"position": {"x": x, "y": 0}, "orientation": [1, 0, 0, None], "frame": "base", "time": at * 1e-9}
        messages.append(("/tool", at + 50 * MS, pose))
        messages.append(("/gripper", at, {"opening": 0.04 - x}))
    write_json(tmp_path / "arm.mcap", messages)
    covariates = Recording.load(press, streams=tmp_path / "arm.mcap").covariates
    assert sorted(covariates) == ["a", "b", "gripper/opening", "tool/orientation", "tool/position.x", "tool/position.y"]
    time = np.arange(50) * 0.01
    np.testing.assert_allclose(covariates["b"], 2 * time, atol=1e-6)
    np.testing.assert_allclose(covariates["tool/position.x"], time, atol=1e-5)  # a float holds Unix time to 0.2 us
    np.testing.assert_allclose(covariates["gripper/opening"], 0.04 - time, atol=1e-6)
    assert covariates["tool/orientation"].shape == (50, 4)
    np.testing.assert_array_equal(covariates["tool/orientation"][5], [1, 0, 0, np.nan])


def test_a_file_with_very_many_names_is_refused_and_warnings_are_one(press, tmp_path):
    path = tmp_path / "joints.mcap"
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/joints", "json", 0)
        for i in range(8):
            message = {f"joint{300 * i + k}": 1.0 for k in range(300)}
            writer.add_message(channel, START + i, json.dumps(message).encode(), START + i)
        writer.finish()
    with pytest.raises(InvalidValueError, match=r"joints.mcap has more than 2000 streams"):
        Recording.load(press, streams=path)
    with LogWriter(tmp_path / "a.mcap", METADATA) as log:
        for i, sample in enumerate(counts(50)):
            log.write_at("measured", START + i * 10 * MS, sample)
        for i in range(300):
            log.write_at(f"covariate/once{i}", START + 3 * MS, 1.0)
    with pytest.warns(UserWarning, match="once0 is not known .*the same holds for 299 more") as warned:
        Recording.load(tmp_path / "a.mcap")
    assert len(warned) == 1


def test_messages_that_cannot_be_read_are_left_out_and_counted(press, tmp_path):
    messages = [("/joints", at, {"name": ["a"], "position": [x]}) for at, x in map(ramp, range(0, 110))]
    messages[30] = ("/joints", ramp(30)[0], {"name": ["a"], "position": [1, 2]})
    messages[60] = ("/joints", ramp(60)[0], [1, 2])
    write_json(tmp_path / "arm.mcap", messages)
    with pytest.warns(UserWarning, match="2 messages that could not be read were skipped"):
        covariates = Recording.load(press, streams=tmp_path / "arm.mcap").covariates
    np.testing.assert_allclose(covariates["a"], np.arange(50) * 0.01, atol=1e-6)


def test_covariates_of_another_recording(press, tmp_path):
    other = Recording(np.arange(60) * 0.01, np.zeros((60, 1, 3, 1, 1)), covariates={"force": np.arange(60)})
    other.with_simulated(other.measured, start=START * 1e-9).save(tmp_path / "other.mcap")
    covariates = Recording.load(press, streams=tmp_path / "other.mcap").covariates
    np.testing.assert_allclose(covariates["force"], np.arange(50), atol=1e-4)


def test_convert_adds_streams(press, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_json(tmp_path / "arm.mcap", [("/arm", at, {"joint": x}) for at, x in map(ramp, range(0, 110))])
    other = Recording(np.arange(60) * 0.01, np.zeros((60, 1, 3, 1, 1)), metadata={"start": START * 1e-9})
    other.with_covariate("force", np.arange(60)).save("other.mcap")
    assert main(["convert", "press.mcap", "both.npz", "--streams", "arm.mcap", "other.mcap"]) == 0
    assert list(Recording.load("both.npz").covariates) == ["arm/joint", "force"]
    other.save("other.mcap")
    with pytest.raises(InvalidValueError, match=r"other.mcap is a recording without covariates"):
        Recording.load("press.mcap", streams="other.mcap")


def test_a_recording_that_is_wrong_is_named_first(tmp_path):
    np.savez(tmp_path / "a.npz", time=np.zeros((2, 2)), measured=np.zeros((2, 1, 3, 1, 1)))
    (tmp_path / "joints.csv").write_text("time,joint\n0,1\n1,2\n")
    with pytest.raises(InvalidValueError, match=r"a.npz: time must be \(T,\)"):
        Recording.load(tmp_path / "a.npz", streams=tmp_path / "joints.csv")


def test_csv_on_the_recordings_clock(press, tmp_path):
    lines = [f"{at * 1e-9:.6f},{x},{-x}" for at, x in map(ramp, range(0, 110))]
    (tmp_path / "joints.csv").write_text("\n".join(["time,joint.0,joint.1", *lines, ""]))
    joint = Recording.load(press, streams=tmp_path / "joints.csv").covariates["joint"]
    np.testing.assert_allclose(joint, np.outer(np.arange(50) * 0.01, [1, -1]), atol=1e-5)
    (tmp_path / "late.csv").write_text("time,joint\n0,1\n1,2\n")
    with pytest.raises(InvalidValueError, match=r"late.csv does not overlap the recording: it spans 0.000 s to"):
        Recording.load(press, streams=tmp_path / "late.csv")


def test_csv_that_counts_episodes(tmp_path):
    time = np.array([3.0, 3.1, 3.2, 9.0, 9.1])
    recording = Recording(time, np.zeros((5, 1, 3, 1, 1)), episode=[1, 1, 1, 4, 4])
    recording.save(tmp_path / "a.npz")
    rows = [(4, 0.0, 40), (4, 0.2, 42), (1, 7.0, 10), (1, 7.4, 14)]
    text = "\n".join(f"{episode},{at},{x}" for episode, at, x in rows)
    (tmp_path / "joints.csv").write_text(f"episode_index,timestamp,joint\n{text}\n")
    found = Recording.load(tmp_path / "a.npz", streams=tmp_path / "joints.csv").covariates["joint"]
    np.testing.assert_allclose(found, [10, 11, 12, 40, 41])
    (tmp_path / "other.csv").write_text("episode_index,timestamp,joint\n2,0,1\n3,0,1\n")
    with pytest.raises(
        InvalidValueError, match="none of the recording's episodes: it has episodes 2, 3, the recording has 1, 4"
    ):
        Recording.load(tmp_path / "a.npz", streams=tmp_path / "other.csv")
    (tmp_path / "one.csv").write_text("episode_index,timestamp,joint\n4,0,1\n4,1,2\n")
    with pytest.warns(UserWarning, match="one.csv has no episode 1; its streams are NaN there"):
        found = Recording.load(tmp_path / "a.npz", streams=tmp_path / "one.csv").covariates["joint"]
    np.testing.assert_allclose(found, [np.nan, np.nan, np.nan, 1, 1.1])


def test_numbered_episodes_on_the_recordings_own_clock(tmp_path):
    at = np.array([0.0, 0.5, 1.0, 5.0, 5.5, 6.0])
    recording = Recording(at, np.zeros((6, 1, 3, 1, 1)), episode=[1, 1, 1, 4, 4, 4], metadata={"start": 1000.0})
    recording.save(tmp_path / "a.npz")
    for zero in (0.0, 1000.0):  # the recording's time, and Unix time
        rows = "".join(f"{4 if t > 2 else 1},{zero + t},{10 * t}\n" for t in (0.5, 1.0, 5.0, 6.0))
        (tmp_path / "u.csv").write_text(f"episode_index,time,u\n{rows}")
        found = Recording.load(tmp_path / "a.npz", streams=tmp_path / "u.csv").covariates["u"]
        np.testing.assert_allclose(found, [np.nan, 5, 10, 50, 55, 60])
    (tmp_path / "u.csv").write_text("episode_index,time,u\n1,0.5,1\n1,1,2\n4,0,3\n")
    with pytest.warns(UserWarning, match="episode 4 shares no time with the recording's"):
        Recording.load(tmp_path / "a.npz", streams=tmp_path / "u.csv")
    (tmp_path / "u.csv").write_text("episode_index,time,u\n1,90,1\n1,91,1\n4,92,1\n")
    with pytest.raises(InvalidValueError, match="its episodes do not overlap those of the recording"):
        Recording.load(tmp_path / "a.npz", streams=tmp_path / "u.csv")


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "joint\n1\n", "a.csv: the table must have a column 'time' or 'timestamp'"),
        ("a.csv", "time\n1\n", "a.csv has no numeric stream besides its times"),
        ("a.csv", "time,joint\n1,2\n0,3\n", "a.csv: time must not decrease, but does after 1 s"),
        ("a.csv", "time,joint\n,2\n0,3\n", "a.csv: every row must have a time; row 0 has none"),
        ("a.csv", "time,joint\n0,idle\n", "line 2, column 'joint': 'idle' is not a number"),
        ("a.csv", "episode_index,time,j\n0,0,1\n1,0,1\n0,1,1\n", "the rows of an episode must be adjacent"),
        ("a.txt", "", "streams must come from"),
        ("a.mcap", "", "a.mcap is empty"),
    ],
)
def test_bad_files_are_named(press, tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InvalidValueError, match=words):
        Recording.load(press, streams=tmp_path / name)


def test_a_name_that_is_taken(press, tmp_path):
    (tmp_path / "a.csv").write_text(f"time,joint\n{START * 1e-9},1\n{START * 1e-9 + 1},2\n")
    with pytest.raises(InvalidValueError, match="the recording already has a covariate 'joint'"):
        Recording.load(press, streams=[tmp_path / "a.csv", tmp_path / "../" / tmp_path.name / "a.csv"])
