"""Joint streams of other programs as covariates of a recording: ROS 2 MCAP, JSON MCAP and CSV."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from log_files import (
    METADATA,
    MS,
    START,
    TRANSFORMS,
    counts,
    joint_state,
    refused,
    transforms,
    write_json,
    write_log,
    write_ros2,
)

from paxisim.cli import main
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.logs.mcap_writer import LogWriter
from paxisim.recording import Recording


@pytest.fixture
def press(tmp_path):
    """A live recording of 50 samples at 100 Hz from `START`."""
    write_log(tmp_path / "press.mcap", counts(50))
    return tmp_path / "press.mcap"


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


def test_ros_transforms_become_poses_in_the_root_of_their_frames(press, tmp_path):
    turned = (0, 0, np.sqrt(0.5), np.sqrt(0.5))  # 90 degrees about z
    messages = [("/tf_static", START, transforms(START, ("map", "base", (1, 2, 3), turned)))]
    for at, x in map(ramp, range(-10, 120)):
        frames = [("base", "/box", (x, 0, 0.5), (0, 0, 0, 1)), ("box", "lid", (0, 0, 1), (0, 0, 0, 1))]
        messages.append(("/tf", at, transforms(at, *frames)))
    write_ros2(tmp_path / "tf.mcap", messages, "tf2_msgs/msg/TFMessage", TRANSFORMS)
    with pytest.warns(UserWarning, match="tf.mcap: frames on others that move were left out: lid on box"):
        recording = Recording.load(press, streams=tmp_path / "tf.mcap")
    assert list(recording.covariates) == ["box"]
    poses = recording.covariates["box"].reshape(-1, 4, 4)
    np.testing.assert_allclose(poses[:, :3, 3], [[1, 2 + x, 3.5] for x in recording.time], atol=1e-6)
    np.testing.assert_allclose(poses[:, :3, :3] - [[0, -1, 0], [1, 0, 0], [0, 0, 1]], 0, atol=1e-9)


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
    names = [f"joint{j}" for j in range(7)]
    messages = [
        ("/joint_states", at, joint_state(at, names, list(np.sin(x * np.arange(7)))))
        for at, x in map(ramp, range(12000))
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


def test_without_the_package_the_error_names_the_extra(press, tmp_path, monkeypatch, capsys):
    at, x = ramp(0)
    write_ros2(tmp_path / "arm.mcap", [("/joint_states", at, joint_state(at, ["joint1"], [x]))])
    for name in [name for name in sys.modules if name.startswith("mcap_ros2")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "mcap_ros2", None)  # as if it were not installed
    words = ["convert", str(press), str(tmp_path / "out.npz"), "--streams", str(tmp_path / "arm.mcap")]
    assert main(words) == 2
    assert "needs mcap_ros2, which is not installed: pip install 'paxisim[ros]'" in capsys.readouterr().err
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


def test_very_many_names_are_refused_and_very_many_warnings_are_one(press, tmp_path):
    messages = [("/joints", START + i, {f"joint{300 * i + k}": 1.0 for k in range(300)}) for i in range(8)]
    write_json(tmp_path / "joints.mcap", messages)
    refused(press, r"joints.mcap has more than 2000 streams", streams=tmp_path / "joints.mcap")
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


def test_convert_adds_streams_and_covariates_of_another_recording(press, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_json(tmp_path / "arm.mcap", [("/arm", at, {"joint": x}) for at, x in map(ramp, range(0, 110))])
    other = Recording(np.arange(60) * 0.01, np.zeros((60, 1, 3, 1, 1)), metadata={"start": START * 1e-9})
    other.with_covariate("force", np.arange(60)).save("other.mcap")
    assert main(["convert", "press.mcap", "both.npz", "--streams", "arm.mcap", "other.mcap"]) == 0
    both = Recording.load("both.npz").covariates
    assert list(both) == ["arm/joint", "force"]
    np.testing.assert_allclose(both["force"], np.arange(50), atol=1e-4)
    other.save("other.mcap")
    refused(press, r"other.mcap is a recording without covariates", streams="other.mcap")


def test_csv_on_the_recordings_clock(press, tmp_path):
    lines = [f"{at * 1e-9:.6f},{x},{-x}" for at, x in map(ramp, range(0, 110))]
    (tmp_path / "joints.csv").write_text("\n".join(["time,joint.0,joint.1", *lines, ""]))
    joint = Recording.load(press, streams=tmp_path / "joints.csv").covariates["joint"]
    np.testing.assert_allclose(joint, np.outer(np.arange(50) * 0.01, [1, -1]), atol=1e-5)
    twice = [tmp_path / "joints.csv", tmp_path / ".." / tmp_path.name / "joints.csv"]
    refused(press, "already has a covariate 'joint'", streams=twice)
    np.savez(tmp_path / "a.npz", time=np.zeros((2, 2)), measured=np.zeros((2, 1, 3, 1, 1)))
    refused(tmp_path / "a.npz", r"a.npz: time must be \(T,\)", streams=tmp_path / "joints.csv")


def test_csv_that_counts_episodes(tmp_path):
    """Episodes count from 0 or go on with the recording's clock or Unix time."""
    path, table = tmp_path / "a.npz", tmp_path / "u.csv"

    def added(rows, clock="time"):
        table.write_text(f"episode_index,{clock},u\n" + "".join(f"{e},{at},{x}\n" for e, at, x in rows))
        return Recording.load(path, streams=table).covariates["u"]

    time, episode = np.array([3.0, 3.1, 3.2, 9.0, 9.1]), [1, 1, 1, 4, 4]
    Recording(time, np.zeros((5, 1, 3, 1, 1)), episode=episode).save(path)
    rows = [(4, 0.0, 40), (4, 0.2, 42), (1, 7.0, 10), (1, 7.4, 14)]
    np.testing.assert_allclose(added(rows, "timestamp"), [10, 11, 12, 40, 41])
    with pytest.raises(InvalidValueError, match="it has episodes 2, 3, the recording has 1, 4"):
        added([(2, 0, 1), (3, 0, 1)], "timestamp")
    with pytest.warns(UserWarning, match="u.csv has no episode 1; its streams are NaN there"):
        found = added([(4, 0, 1), (4, 1, 2)], "timestamp")
    np.testing.assert_allclose(found, [np.nan, np.nan, np.nan, 1, 1.1])
    time, episode = np.array([0.0, 0.5, 1.0, 5.0, 5.5, 6.0]), [1, 1, 1, 4, 4, 4]
    Recording(time, np.zeros((6, 1, 3, 1, 1)), episode=episode, metadata={"start": 1000.0}).save(path)
    for zero in (0.0, 1000.0):  # the recording's time, and Unix time
        found = added([(4 if at > 2 else 1, zero + at, 10 * at) for at in (0.5, 1.0, 5.0, 6.0)])
        np.testing.assert_allclose(found, [np.nan, 5, 10, 50, 55, 60])
    with pytest.warns(UserWarning, match="episode 4 shares no time with the recording's"):
        added([(1, 0.5, 1), (1, 1, 2), (4, 0, 3)])
    with pytest.raises(InvalidValueError, match="its episodes do not overlap those of the recording"):
        added([(1, 90, 1), (1, 91, 1), (4, 92, 1)])


BAD = [
    ("a.csv", "joint\n1\n", "a.csv: the table must have a column 'time' or 'timestamp'"),
    ("a.csv", "time\n1\n", "a.csv has no numeric stream besides its times"),
    (
        "a.csv",
        "time,joint\n1,2\n2,3\n3,4\n1,2\n2,3\n3,4\n",
        "a.csv: the clock starts anew: column 'time' goes from 3 s",
    ),
    ("a.csv", "time,joint\n,2\n0,3\n", "a.csv: every row must have a time; row 0 has none"),
    ("a.csv", "time,joint\n0,idle\n", "line 2, column 'joint': 'idle' is not a number"),
    ("a.csv", "time,joint\n0,1\n1,2\n", "a.csv does not overlap the recording: it spans 0.000 s to"),
    ("a.csv", "episode_index,time,j\n0,0,1\n1,0,1\n0,1,1\n", "the rows of an episode must be adjacent"),
    ("a.txt", "", "streams must come from"),
    ("a.mcap", "", "a.mcap is empty"),
]


def test_bad_files_are_named(press, tmp_path):
    for name, text, word in BAD:
        (tmp_path / name).write_text(text)
        refused(press, word, streams=tmp_path / name)
