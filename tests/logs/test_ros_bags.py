"""Bags of ROS 1 and ROS 2 as recordings, and as streams beside one."""

import sqlite3
import sys
from pathlib import Path

import numpy as np
import pytest
from log_files import METADATA, MS, START, counts, refused, write_log

from paxisim.cli import main
from paxisim.errors import UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.recording import Recording

pytest.importorskip("rosbags")
from bag_files import MSGS, write_bag

KINDS = ["bag", "bz2", "lz4", "sqlite", "mcap"]
FORCES = np.random.default_rng(0).normal(0, 1, (40, 2, 16, 3)).astype(np.float32)
COUNTS = np.random.default_rng(1).integers(0, 2**16, (40, 2, 16, 3))


def path_of(folder, kind, name="run"):
    return folder / (name if kind in ("sqlite", "mcap") else f"{name}.bag")


def arm(build, i):
    """Return the messages of a robot at 100 Hz, logged 3 ms after their stamps."""
    at = START + i * 10 * MS
    yield "/joint_states", at + 3 * MS, build.joints(at, ["a", "b"], [i * 0.01, -i])
    yield "/wrist", at + 3 * MS, build.wrench(at, [0.0, 1.0, float(i)])


def xela(has_forces=True, repeat=False):
    """Return a function that yields XELA's messages at 100 Hz: two sensors of 16 taxels, and the robot."""

    def messages(build):
        for i in range(40):
            at = START + i * 10 * MS
            sensors = [("uSPa44", 1 + pad, COUNTS[i, pad], FORCES[i, pad] if has_forces else None) for pad in range(2)]
            for _ in range(1 + repeat):
                yield "/xServTopic", at + 5 * MS, build.sensors(at, i, sensors)
            yield from arm(build, i)

    return messages


@pytest.mark.parametrize("kind", KINDS)
def test_xelas_topic_is_recognised_and_the_robot_becomes_covariates(tmp_path, kind):
    path = write_bag(path_of(tmp_path, kind), kind, xela(repeat=kind == "bag"))
    assert main(["convert", str(path), str(tmp_path / "a.npz")]) == 0
    loaded = Recording.load(tmp_path / "a.npz")
    assert loaded.pads == ("uSPa44_1", "uSPa44_2")
    assert (loaded.layout.rows, loaded.layout.cols, loaded.layout.pitch[0]) == (4, 4, pytest.approx(4.67e-3, abs=1e-5))
    np.testing.assert_array_equal(loaded.measured, FORCES.reshape(40, 2, 4, 4, 3).transpose(0, 1, 4, 2, 3))
    np.testing.assert_allclose(loaded.time, 0.01 * np.arange(40), atol=1e-6)
    assert loaded.metadata["start"] == pytest.approx(START * 1e-9, abs=1e-6)
    assert sorted(loaded.covariates) == ["a", "b", "wrist/force", "wrist/torque"]
    # the server's times are floats, so that the last sample may be 0.1 us after the robot's last
    np.testing.assert_allclose(loaded.covariates["b"][:-1], -np.arange(39.0), atol=1e-3)
    np.testing.assert_allclose(loaded.covariates["wrist/force"][:-1, 2], np.arange(39.0), atol=1e-3)


def test_without_forces_the_tensor_holds_counts(tmp_path):
    loaded = Recording.load(write_bag(tmp_path / "run", "sqlite", xela(has_forces=False)), pads=["uSPa44_2"])
    assert (loaded.pads, loaded.metadata["unit"]) == (("uSPa44_2",), "counts")
    np.testing.assert_array_equal(
        loaded.measured[:, 0], COUNTS[:, 1].reshape(40, 4, 4, 3).transpose(0, 3, 1, 2) - 2.0**15
    )


@pytest.mark.parametrize("kind", ["bag", "sqlite", "mcap"])
def test_a_bag_is_added_to_a_recording(tmp_path, kind):
    write_log(tmp_path / "press.mcap", counts(30))
    path = write_bag(path_of(tmp_path, kind), kind, lambda build: (m for i in range(40) for m in arm(build, i)))
    if kind == "sqlite":
        (path,) = path.glob("*.db3")
    loaded = Recording.load(tmp_path / "press.mcap", streams=path)
    assert loaded.pads == METADATA["pads"]
    np.testing.assert_allclose(loaded.covariates["a"], 0.01 * np.arange(30), atol=1e-6)


def fields(build):
    for i in range(20):
        at = START + i * 10 * MS
        for k in (10, 2, 1):
            yield f"/mag{k}", at, build.field(at, [k * 1e-6, i * 1e-6, 0.0])


def arrays(shape, topic="/tactile"):
    def messages(build):
        for i in range(20):
            yield (
                topic,
                START + i * 10 * MS,
                build.array(np.arange(np.prod(shape)) + i, shape if len(shape) > 1 else ()),
            )

    return messages


def test_fields_arrays_and_wrenches(tmp_path):
    loaded = Recording.load(write_bag(tmp_path / "mags", "sqlite", fields))
    assert (loaded.measured.shape, loaded.metadata["unit"]) == ((20, 1, 3, 1, 3), "uT")
    np.testing.assert_allclose(loaded.measured[7, 0, :2, 0], [[1, 2, 10], [7, 7, 7]], rtol=1e-6)
    loaded = Recording.load(write_bag(tmp_path / "grid", "sqlite", arrays((3, 4, 5))))
    assert loaded.pads == ("tactile",)
    np.testing.assert_array_equal(loaded.measured[2, 0], np.arange(60).reshape(3, 4, 5) + 2)
    path = write_bag(tmp_path / "flat", "sqlite", arrays((12,), "/skin"))
    loaded = Recording.load(path, topics="/skin", axes={"/skin": "taxels,xyz"})
    np.testing.assert_array_equal(loaded.measured[0, 0, :, 0], np.arange(12).reshape(4, 3).T)
    path = write_bag(tmp_path / "arm", "sqlite", lambda build: (m for i in range(9) for m in arm(build, i)))
    loaded = Recording.load(path, topics=["/wrist"])
    np.testing.assert_array_equal(loaded.measured[5, 0, :, 0, 0], [0, 1, 5])
    assert sorted(loaded.covariates) == ["a", "b"]


TENSOR = np.random.default_rng(2).normal(0, 1, (20, 2, 3, 1, 3)).astype(np.float32)
NORMALS = ((0.0, 0.0, 1.0), (0.0, 0.6, 0.8), (0.6, 0.0, 0.8))
CURVED = TaxelLayout(1, 3, (2e-3, 2e-3), ((0.0, 0.0, 0.0), (2e-3, 0.0, 1e-4), (4e-3, 0.0, 3e-4)), NORMALS)


def frames(layout=CURVED, pads=("left", "right"), unit="uT"):
    """Return a function that yields paxisim's own messages, in which one pad fails once."""

    def messages(build):
        if layout is not None:
            yield "/hand/skin_layout", START - 9 * 10**9, build.tactile_layout(pads, layout, unit)
        for i in range(20):
            at = START + i * 10 * MS
            yield "/hand/skin", at + 3 * MS, build.tactile_frame(at, TENSOR[i], (128, 1) if i == 7 else ())
            yield from arm(build, i)

    return messages


@pytest.mark.parametrize("kind", ["bag", "sqlite", "mcap"])
def test_frames_are_described_by_their_layout_which_was_published_once(tmp_path, kind):
    loaded = Recording.load(write_bag(path_of(tmp_path, kind), kind, frames()))
    assert loaded.pads == ("left", "right")
    assert loaded.unit == "uT"
    assert loaded.layout == CURVED
    expected = TENSOR.copy()
    expected[7, 1] = np.nan
    np.testing.assert_array_equal(loaded.measured, expected)
    np.testing.assert_allclose(loaded.time, 0.01 * np.arange(20), atol=1e-9)
    assert "b" in loaded.covariates
    bare = Recording.load(write_bag(path_of(tmp_path, kind, "bare"), kind, frames(None)))
    assert (bare.pads, bare.unit) == (("hand/skin0", "hand/skin1"), "N")


def test_the_page_shows_the_messages_as_they_are():
    page = (Path(__file__).parents[2] / "docs" / "formats" / "mcap.md").read_text()
    for path in MSGS.glob("*.msg"):
        fields = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
        assert "\n".join(fields) in page


def both(build):
    yield from fields(build)
    yield from arrays((4, 3))(build)


def uneven(build):
    for i in range(4):
        sensors = [("uSPa44", 1, COUNTS[i, 0], None), ("uSPr2F", 2, COUNTS[i, 0, :7], None)]
        yield "/xServTopic", START, build.sensors(START, i, sensors)


UNCLEAR = [  # messages, options, words of the error
    (
        lambda build: arm(build, 0),
        {},
        r"no topic that is tactile beyond doubt: .* /joint_states \(sensor_msgs",
    ),
    (lambda build: [("/imu/mag", START, build.field(START, [1e-5] * 3))], {}, "no topic that is tactile beyond doubt"),
    (both, {}, "several kinds of tactile topics: choose with topics"),
    (both, {"topics": ["/mag1", "/tactile"]}, "differ in their taxels: magnetometers has 1x1, tactile has 1x4"),
    (arrays((12,)), {}, r"the axes of topic /tactile, of shape \(12,\), cannot be told; .*--axes /tactile=taxels,xyz"),
    (arrays((12,)), {"axes": {"/tactile": "rows,xyz"}}, "the axes of /tactile must be"),
    (lambda build: arm(build, 0), {"topics": ["/joint_states"]}, "cannot be a tactile sensor: choose others"),
    (uneven, {}, "differ in their taxels: uSPa44_1 has 4x4, uSPr2F_2 has 1x7; choose with pads"),
    (frames(pads=("left",)), {}, "/hand/skin_layout names 1 pads, its frames have 2"),
    (frames(TaxelLayout(2, 3, (2e-3, 2e-3))), {}, r"the frames of topic /hand/skin must be pads of \(3, 2, 3\)"),
    (lambda build: [], {}, "no numeric stream: expected sensor_msgs/JointState, .*topics are: none"),
]


@pytest.mark.parametrize("case", range(len(UNCLEAR)))
def test_what_is_unclear_is_refused(tmp_path, case):
    messages, options, word = UNCLEAR[case]
    refused(write_bag(tmp_path / "run", "sqlite", messages), word, **options)


def test_names_that_do_not_exist_and_formats_without_topics(tmp_path):
    path = write_bag(tmp_path / "run.bag", "bag", xela())
    for options, word in (
        ({"topics": "/xServ"}, "unknown topic '/xServ'.*did you mean '/xServTopic'"),
        ({"axes": {"/skin": "taxels"}}, "unknown topic '/skin'"),
        ({"pads": ["uSPa44_3"]}, "unknown pad 'uSPa44_3'"),
    ):
        with pytest.raises(UnknownNameError, match=word):
            Recording.load(path, **options)
    (tmp_path / "a.csv").write_text("time\n")
    refused(tmp_path / "a.csv", "topics is for the topics of a bag of ROS", topics="/a")


def text(build):
    yield from arm(build, 0)
    yield "/text", START, build.make("std_msgs/msg/String", data="a" * 3_000_000)


@pytest.mark.parametrize("kind", ["bag", "bz2", "lz4"])
def test_a_chunk_that_unpacks_to_too_much_is_refused(tmp_path, monkeypatch, kind):
    path = write_bag(tmp_path / "run.bag", kind, text)
    Recording.load(path, topics="/wrist")
    monkeypatch.setenv("PAXISIM_MAX_UNPACKED", "1000000")
    refused(path, "run.bag unpacks to 1000001 bytes or more" if kind != "bag" else "unpacks to 30", topics="/wrist")


def test_damaged_and_hostile_bags(tmp_path, monkeypatch, capsys):
    whole = write_bag(tmp_path / "run.bag", "lz4", xela()).read_bytes()
    path = tmp_path / "cut.bag"
    for data, word in (
        (whole[: len(whole) // 2], "cut.bag is not a complete bag of ROS 1"),
        (b"", "cut.bag is not a complete bag of ROS 1"),
    ):
        path.write_bytes(data)
        refused(path, word)
        assert main(["convert", str(path), str(tmp_path / "a.npz")]) == 2
        assert capsys.readouterr().err.count("\n") == 1
    monkeypatch.setenv("PAXISIM_MAX_UNPACKED", "20000")
    refused(tmp_path / "run.bag", "run.bag unpacks to")
    monkeypatch.delenv("PAXISIM_MAX_UNPACKED")
    (base,) = write_bag(tmp_path / "run", "sqlite", xela()).glob("*.db3")
    with sqlite3.connect(base) as db:
        db.execute("ALTER TABLE messages RENAME TO real")
        db.execute("CREATE VIEW messages AS SELECT * FROM real")
    db.close()
    refused(base, "its table 'messages' is computed, not stored")
    base.write_bytes(b"not a base")
    refused(base, "is not a complete bag of ROS 2")
    base.rename(tmp_path / "run" / "run.db3.zstd")
    refused(tmp_path / "run", "is compressed: unpack its files with zstd -d")
    with pytest.raises(FileNotFoundError):
        Recording.load(tmp_path / "none.bag")


def test_without_the_package_the_error_names_the_extra(tmp_path, monkeypatch, capsys):
    path = write_bag(tmp_path / "run.bag", "bag", xela())
    for name in [name for name in sys.modules if name.startswith("rosbags")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "rosbags", None)  # as if it were not installed
    assert main(["convert", str(path), str(tmp_path / "a.npz")]) == 2
    assert "needs rosbags, which is not installed: pip install 'paxisim[ros]'" in capsys.readouterr().err
