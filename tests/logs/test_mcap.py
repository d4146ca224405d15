"""Logs that are read: complete ones, ones cut off or damaged at any point, and foreign ones."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_files import LAYOUT, MS, START, counts, refused, write_json
from mcap.reader import make_reader

from paxisim.errors import InvalidValueError
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
    assert measured.errors is None  # without a status nothing is said of errors


# a power failure may leave zeros
@given(part=st.floats(0, 1, exclude_max=True), zeros=st.sampled_from([0, 1, 500]))
@settings(max_examples=40, deadline=None)
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
@settings(max_examples=40, deadline=None)
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


def test_topics_alone_describe_a_recording_that_another_program_wrote(tmp_path, whole):
    with whole[0].open("rb") as file:
        found = [
            (schema.name, channel.topic, json.loads(m.data)) for schema, channel, m in make_reader(file).iter_messages()
        ]
    (described,) = [document for name, _, document in found if name == "paxisim.TactileLayout"]
    layout = {name: value for name, value in LAYOUT.to_dict().items() if name != "vendor_order"}
    assert described == {"timestamp": described["timestamp"], "pads": ["left", "right"], "unit": "N", **layout}
    assert found[0][0] != "paxisim.Tactile", "the layout comes before the first tensor"

    kinds = {"/tactile/measured": "paxisim.Tactile"}
    frames = [("/tactile/measured", START + i * MS, frame(FORCE[i])) for i in range(9)]
    first = "/tactile_layout", START, described | {"unit": "uT"}
    write_json(tmp_path / "a.mcap", [first, *frames], kinds=kinds)
    loaded = Recording.load(tmp_path / "a.mcap")
    np.testing.assert_array_equal(loaded.measured, FORCE[:9])
    assert (loaded.pads, loaded.unit, loaded.layout.to_dict()) == (("left", "right"), "uT", layout)
    write_json(tmp_path / "b.mcap", frames, kinds=kinds)
    refused(tmp_path / "b.mcap", "neither 'paxisim' metadata nor a message on /tactile_layout")


def frame(force):
    """Return a message with a tensor, without the fields that a program may leave out."""
    return {"timestamp": {"sec": 0, "nsec": 0}, "shape": force.shape, "force": force.ravel().tolist()}


def test_foreign_files_are_told_apart(tmp_path):
    path = tmp_path / "a.mcap"
    write_json(path, [("/camera", 1, {})])
    refused(path, r"has no numeric stream.*its topics are: /camera")
    write_json(path, [], {"format": "paxisim-recording/9"})
    refused(path, "of format 'paxisim-recording/9'")
    for content, word in (
        (b"PK\3\4 and more", "but a zip"),
        (b"hello world", "begins with b'hello wo'"),
        (b"", "is empty"),
    ):
        path.write_bytes(content)
        refused(path, word)
