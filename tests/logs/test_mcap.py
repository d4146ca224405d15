"""`LogWriter` and `read_log`: complete files, and files cut off at any point."""

import json
import math
import random
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from log_files import LAYOUT, START, counts, write_log
from mcap.reader import make_reader
from mcap.writer import Writer

from paxisim.errors import InvalidValueError, OutputExistsError
from paxisim.logs import schemas
from paxisim.logs.mcap_reader import read_log
from paxisim.logs.mcap_writer import LogWriter
from paxisim.recording import Recording

FORCE = counts(40)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A log with ten chunks, and the minimum number of samples at each length of the file."""
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    lengths = []
    with LogWriter(path, {"layout": LAYOUT, "pads": ("left", "right"), "scene": "<mujoco/>"}) as log:
        log.write_at("episode", START, 3)
        for i, force in enumerate(FORCE):
            log.write_at("measured", START + i, force, sequence=10 + i, resultant=force.sum((2, 3)))
            log.write_at("covariate/opening", START + i, i * 0.1)
            if i % 4 == 3:
                log.flush()
                lengths.append((path.stat().st_size, i + 1))
    return path, lengths


def test_a_log_comes_back(whole):
    log = read_log(whole[0])
    assert log.complete
    assert list(log.streams) == ["episode", "measured", "covariate/resultant", "covariate/opening"]
    measured = log.streams["measured"]
    np.testing.assert_array_equal(measured.values, FORCE)
    assert measured.values.dtype == np.float32
    assert measured.nanoseconds.tolist() == list(range(START, START + 40))
    assert measured.time[0] == pytest.approx(1.7e9)
    assert measured.sequence.tolist() == list(range(10, 50))
    np.testing.assert_allclose(log.streams["covariate/resultant"].values, FORCE.sum((3, 4)), rtol=1e-6)
    assert log.streams["covariate/opening"].values.tolist() == [i * 0.1 for i in range(40)]
    assert log.streams["episode"].values.tolist() == [3]
    assert log.metadata["layout"] == LAYOUT.to_dict()
    assert log.metadata["pads"] == ["left", "right"]
    assert log.metadata["scene"] == "<mujoco/>"


def test_arrays_of_any_memory_order_are_written(tmp_path):
    columns = np.asfortranarray(FORCE[0])
    resultant = np.arange(6, dtype=np.float32).reshape(3, 2).T
    with LogWriter(tmp_path / "a.mcap", {"layout": LAYOUT, "pads": ("left", "right")}) as log:
        log.write_at("measured", START, columns, resultant=resultant)
        log.write_at("covariate/matrix", START, resultant)
    streams = read_log(tmp_path / "a.mcap").streams
    np.testing.assert_array_equal(streams["measured"].values, columns[None])
    np.testing.assert_array_equal(streams["covariate/resultant"].values, resultant[None])
    np.testing.assert_array_equal(streams["covariate/matrix"].values, resultant[None])


# a power failure may leave zeros
@given(part=st.floats(0, 1, exclude_max=True), zeros=st.sampled_from([0, 1, 500]))
@settings(max_examples=150, deadline=None)
def test_cut_anywhere_what_is_whole_is_read(tmp_path_factory, whole, part, zeros):
    content, lengths = whole[0].read_bytes(), whole[1]
    length = int(len(content) * part)
    path = tmp_path_factory.mktemp("cut") / "a.mcap"
    path.write_bytes(content[:length] + bytes(zeros))
    least = max((samples for at, samples in lengths if at <= length), default=0)
    try:
        log = read_log(path)
    except InvalidValueError:
        assert least == 0
        return
    assert not log.complete
    samples = log.streams["measured"].values if "measured" in log.streams else FORCE[:0]
    # the index after a chunk may be cut
    assert len(samples) in (least, least + 4)
    np.testing.assert_array_equal(samples, FORCE[: len(samples)])


def test_a_cut_file_keeps_the_times_and_numbers_of_its_episodes(tmp_path):
    at = np.concatenate([5 + np.arange(400) / 100, np.arange(400) / 100])  # the clock restarts
    force = np.random.default_rng(0).normal(size=(800, 1, 3, 12, 12))
    recording = Recording(at, force, episode=np.repeat([7, 3], 400), metadata={"start": 1.7e9})
    recording.save(tmp_path / "a.mcap")
    content = (tmp_path / "a.mcap").read_bytes()
    for part in (0.45, 0.9):
        (tmp_path / "cut.mcap").write_bytes(content[: int(part * len(content))])
        with pytest.warns(UserWarning, match="cut off or damaged"):
            cut = Recording.load(tmp_path / "cut.mcap")
        assert (len(cut) > 400) == (part == 0.9)
        np.testing.assert_allclose(cut.time, at[: len(cut)], atol=1e-9)
        np.testing.assert_array_equal(cut.episode, recording.episode[: len(cut)])
        assert cut.metadata["start"] == 1.7e9


@given(st.data())
@settings(max_examples=100, deadline=None)
def test_damaged_anywhere_no_wrong_sample_is_read(tmp_path_factory, whole, data):
    content = bytearray(whole[0].read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    content[at] ^= 1 << data.draw(st.integers(0, 7))
    path = tmp_path_factory.mktemp("damaged") / "a.mcap"
    path.write_bytes(content)
    try:
        log = read_log(path)
    except InvalidValueError:
        return
    if "measured" in log.streams:
        for nanoseconds, force in zip(log.streams["measured"].nanoseconds, log.streams["measured"].values, strict=True):
            np.testing.assert_array_equal(force, FORCE[nanoseconds - START])


def test_a_damaged_first_chunk_costs_its_own_samples_alone(tmp_path, whole):
    content = bytearray(whole[0].read_bytes())
    content[whole[1][0][0] - 300] ^= 1
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    log = read_log(path)
    assert not log.complete
    np.testing.assert_array_equal(log.streams["measured"].values, FORCE[4:])
    with pytest.warns(UserWarning, match=r"a\.mcap is cut off or damaged; .* 36 samples, the last at 0\.000 s"):
        assert len(Recording.load(path)) == 36
    path.write_bytes(content[:-10])  # without the footer, which repeats the channels
    with pytest.raises(InvalidValueError, match=r"a\.mcap is damaged: none of its samples can be read"):
        read_log(path)


@pytest.mark.parametrize("seed", [0, 1])
def test_killed_at_a_random_moment_the_last_second_is_missing_at_most(tmp_path, seed):
    path = tmp_path / "a.mcap"
    script = Path(__file__).with_name("killed_writer.py")
    with subprocess.Popen([sys.executable, script, path], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        written = [int(process.stdout.readline()) for _ in range(random.Random(seed).randint(1, 700))]
        process.kill()
        written += [int(line) for line in process.stdout.read().decode().splitlines(keepends=True) if line[-1] == "\n"]
    log = read_log(path)
    assert not log.complete
    found = log.streams["measured"].nanoseconds if log.streams else np.array([written[0]])
    assert written[-1] - found[-1] <= 1e9
    assert found.tolist() == written[: len(found)]


def test_what_a_pad_in_error_says_is_not_known(tmp_path):
    path = tmp_path / "a.mcap"
    statuses = [(0, 0), (0, 7), (254, 0), (0, 128)]  # the last status is not an error
    with LogWriter(path, {}) as log:
        for i, status in enumerate(statuses):
            log.write_at("measured", START + i, FORCE[i], status=status, resultant=FORCE[i].sum((2, 3)))
    measured = read_log(path).streams["measured"]
    wrong = (np.array(statuses) & ~schemas.NO_TAXELS) != 0
    assert measured.errors == 2
    np.testing.assert_array_equal(measured.values[~wrong], FORCE[:4][~wrong])
    assert np.isnan(measured.values[wrong]).all()
    loaded = Recording.load(path)
    np.testing.assert_array_equal(np.isnan(loaded.covariates["resultant"]), np.repeat(wrong[..., None], 3, axis=2))
    assert Recording.load(path, missing="drop").time.tolist() == [0, 3e-9]


def test_without_a_status_nothing_is_said_of_errors(whole):
    assert read_log(whole[0]).streams["measured"].errors is None


def test_a_full_disk_is_reported_and_the_file_stays_valid(tmp_path):
    resource = pytest.importorskip("resource")
    script = f"""
import errno, resource, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from log_files import START, counts
from paxisim.logs.mcap_writer import LogWriter
force = counts(1000)
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, resource.RLIM_INFINITY))
log = LogWriter("a.mcap", {{}})
try:
    with log:
        for i in range(1000):
            log.write_at("measured", START + i, force[i])
            if i % 10 == 9:
                log.flush()
except OSError as error:
    assert error.errno == errno.EFBIG, error
    print(i // 10 * 10)
for call in (log.flush, lambda: log.write("measured", 1.0, force[0])):
    try:
        call()
        print("no error")
    except OSError as error:
        pass
log.close()
"""
    assert resource.RLIMIT_FSIZE >= 0
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True)
    written = int(done.stdout)
    log = read_log(tmp_path / "a.mcap")
    assert log.complete  # it has the footer that other programs expect
    assert written > 10
    np.testing.assert_array_equal(log.streams["measured"].values, counts(1000)[:written])


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux only")
def test_a_disk_that_is_full_at_once():
    with pytest.raises(OSError, match="No space left"):
        LogWriter("/dev/full", {}, overwrite=True)


def test_ctrl_c_in_the_middle_of_a_chunk_costs_no_sample(tmp_path, monkeypatch):
    compress = zstandard.compress

    def pressed_meanwhile(data):
        signal.raise_signal(signal.SIGINT)
        return compress(data)

    monkeypatch.setattr(zstandard, "compress", pressed_meanwhile)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # as at a terminal
    try:
        for name in ("flush", "close"):
            log = LogWriter(tmp_path / f"{name}.mcap", {})
            log.write("measured", 1.0, FORCE[0])
            with pytest.raises(KeyboardInterrupt):
                getattr(log, name)()
            log.close()
            assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    for name in ("flush", "close"):
        found = read_log(tmp_path / f"{name}.mcap")
        assert found.complete
        np.testing.assert_array_equal(found.streams["measured"].values, FORCE[:1])


def test_foxglove_finds_what_it_needs(tmp_path):
    path = tmp_path / "a.mcap"
    with LogWriter(path, {"pads": ["left", "right"]}) as log:
        log.write_at("measured", START + 5, FORCE[0], status=(0, 7), resultant=FORCE[0].sum((2, 3)), note=None)
        log.write_at("covariate/opening", START, 0.25)
        log.write_at("covariate/pose", START, np.eye(2))
        log.write_at("episode", START, 2)
    with open(path, "rb") as file:
        messages = {
            channel.topic: (schema, channel, json.loads(message.data), message)
            for schema, channel, message in make_reader(file).iter_messages()
        }
    schema, channel, tactile, message = messages["/tactile/measured"]
    assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
    assert message.log_time == message.publish_time == START + 5
    assert tactile["timestamp"] == {"sec": 1_700_000_000, "nsec": 5}
    assert tactile["shape"] == [2, 3, 4, 3]
    assert tactile["force"] == pytest.approx(FORCE[0].ravel().tolist())
    assert tactile["total"][1]["pad"] == "right"
    assert tactile["total"][1]["z"] == pytest.approx(float(FORCE[0, 1, 2].sum()), rel=1e-5)
    assert tactile["status"] == [0, 7]
    assert "note" not in tactile
    for schema, _, document, _ in messages.values():
        described = json.loads(schema.data)
        assert described["type"] == "object"
        assert document.keys() <= described["properties"].keys()
        assert described["title"] == schema.name
    assert messages["/covariate/opening"][2]["value"] == 0.25
    assert messages["/covariate/pose"][2]["value"] == [1, 0, 0, 1]
    assert messages["/episode"][2]["episode"] == 2


@pytest.mark.parametrize(
    ("stream", "values", "words"),
    [
        ("measured", FORCE[0, 0], r"must be \(pads, 3, rows, cols\)"),
        ("mesured", FORCE[0], "unknown stream 'mesured'"),
        ("covariate/", 1.0, "unknown stream"),
        ("simulated", FORCE[0, :, :, :2], "must keep the shape"),
        ("covariate/opening", math.inf, "infinite"),
        ("episode", 0.5, "whole number"),
    ],
)
def test_samples_that_cannot_be_written(tmp_path, stream, values, words):
    with LogWriter(tmp_path / "a.mcap", {}) as log:
        log.write("simulated", 1.0, FORCE[0])
        with pytest.raises(InvalidValueError, match=words):
            log.write(stream, 1.0, values)
    assert read_log(tmp_path / "a.mcap").complete


@pytest.mark.parametrize("episode", [1.5, math.nan, [1], 1e300])
def test_each_episode_is_a_whole_number(tmp_path, episode):
    with LogWriter(tmp_path / "a.mcap", {}) as log:
        log.write("episode", 1.0, 0)
        with pytest.raises(InvalidValueError, match="an episode must be a whole number, got"):
            log.write("episode", 2.0, episode)
        log.write("episode", 3.0, 1)
    assert read_log(tmp_path / "a.mcap").streams["episode"].values.tolist() == [0, 1]


@pytest.mark.parametrize("time", [math.nan, math.inf, -1.0, 1.7e12, 1.2e10, 1e300])  # the fourth is in milliseconds
def test_a_time_that_cannot_be_costs_nothing_else(tmp_path, time):
    with LogWriter(tmp_path / "a.mcap", {}) as log:
        log.write("measured", 1.0, FORCE[0])
        with pytest.raises(InvalidValueError, match="must be in seconds since 1970-01-01 UTC, up to 2262"):
            log.write("covariate/opening", time, 1.0)
        with pytest.raises(InvalidValueError, match="must be in nanoseconds since 1970-01-01 UTC"):
            log.write_at("measured", time * 1e9, FORCE[1])
        log.flush()
        log.write("measured", 2.0, FORCE[1])
    found = read_log(tmp_path / "a.mcap")
    assert found.complete
    np.testing.assert_array_equal(found.streams["measured"].values, FORCE[:2])
    assert "covariate/opening" not in found.streams


def test_a_status_is_one_number_a_pad(tmp_path):
    with LogWriter(tmp_path / "a.mcap", {}) as log, pytest.raises(InvalidValueError, match=r"status must be .* \(2,\)"):
        log.write("measured", 1.0, FORCE[0], status=(0, 0, 0))


def test_nothing_is_written_over_a_recording_unasked(tmp_path):
    write_log(tmp_path / "a.mcap", FORCE)
    before = (tmp_path / "a.mcap").read_bytes()
    with pytest.raises(OutputExistsError):
        LogWriter(tmp_path / "a.mcap", {})
    assert (tmp_path / "a.mcap").read_bytes() == before
    write_log(tmp_path / "a.mcap", FORCE[:2], overwrite=True)
    assert len(Recording.load(tmp_path / "a.mcap")) == 2


def test_a_closed_log_takes_nothing_more(tmp_path):
    log = LogWriter(tmp_path / "a.mcap", {})
    log.close()
    log.close()
    with pytest.raises(InvalidValueError, match="was closed"):
        log.write("measured", 1.0, FORCE[0])


@pytest.mark.parametrize("metadata", [{"a": object()}, {"scene": 3}])
def test_metadata_that_cannot_be_written_makes_no_file(tmp_path, metadata):
    with pytest.raises(InvalidValueError, match=r"metadata\["):
        LogWriter(tmp_path / "a.mcap", metadata)
    assert not list(tmp_path.iterdir())


def test_samples_out_of_order_are_sorted(tmp_path):
    with LogWriter(tmp_path / "a.mcap", {}) as log:
        for i in (2, 0, 1):
            log.write_at("measured", START + i, FORCE[i], sequence=i)
    stream = read_log(tmp_path / "a.mcap").streams["measured"]
    np.testing.assert_array_equal(stream.values, FORCE[:3])
    assert stream.sequence.tolist() == [0, 1, 2]


def test_foreign_files_are_told_apart(tmp_path):
    path = tmp_path / "a.mcap"
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_message(writer.register_channel("/camera", "json", 0), 1, b"{}", 1)
        writer.finish()
    with pytest.raises(InvalidValueError, match=r"not a recording of paxisim.*\(its topics: /camera\)"):
        read_log(path)
    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_metadata("paxisim", {"format": "paxisim-recording/9"})
        writer.finish()
    with pytest.raises(InvalidValueError, match="of format 'paxisim-recording/9'"):
        read_log(path)
    for content, words in (
        (b"PK\3\4 and more", "but a zip"),
        (b"hello world", "begins with b'hello wo'"),
        (b"", "is empty"),
    ):
        path.write_bytes(content)
        with pytest.raises(InvalidValueError, match=words):
            read_log(path)
    with pytest.raises(FileNotFoundError):
        read_log(tmp_path / "none.mcap")
