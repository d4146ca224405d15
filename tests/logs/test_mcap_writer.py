"""Logs that are written: whole samples, whatever stops the writer, as Foxglove expects them."""

import json
import math
import signal
import time
from pathlib import Path

import numpy as np
import pytest
import zstandard
from log_files import LAYOUT, START, counts, full_disk, write_log
from mcap.reader import make_reader

from paxisim.errors import InvalidValueError, OutputExistsError
from paxisim.logs.mcap_reader import read_log
from paxisim.logs.mcap_writer import LogWriter
from paxisim.recording import Recording

FORCE = counts(40)


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


def test_samples_out_of_order_are_sorted(tmp_path):
    with LogWriter(tmp_path / "a.mcap", {}) as log:
        for i in (2, 0, 1):
            log.write_at("measured", START + i, FORCE[i], sequence=i)
    stream = read_log(tmp_path / "a.mcap").streams["measured"]
    np.testing.assert_array_equal(stream.values, FORCE[:3])
    assert stream.sequence.tolist() == [0, 1, 2]


@pytest.mark.parametrize(("options", "pause"), [({"flush_interval": 0.2}, 0.3), ({}, 0.6)])
def test_what_is_older_than_the_interval_is_in_the_file_before_it_is_closed(tmp_path, options, pause):
    with LogWriter(tmp_path / "a.mcap", {}, **options) as log:
        for i, seconds in enumerate((0, pause, 0)):
            time.sleep(seconds)
            log.write_at("measured", START + i, FORCE[i])
        found = read_log(tmp_path / "a.mcap")
        assert not found.complete
        assert found.streams["measured"].nanoseconds.tolist() == [START, START + 1]


def test_a_full_disk_is_reported_and_the_file_stays_valid(tmp_path):
    force, written = counts(1000), 0
    log = LogWriter(tmp_path / "a.mcap", {})

    def fill():
        nonlocal written
        for i in range(1000):
            log.write_at("measured", START + i, force[i])
            if i % 10 == 9:
                log.flush()
                written = i + 1

    with full_disk(20_000):
        with pytest.raises(OSError, match="File too large"), log:
            fill()
        for call in (log.flush, lambda: log.write("measured", 1.0, force[0])):
            with pytest.raises(OSError, match="File too large"):
                call()
    log.close()
    found = read_log(tmp_path / "a.mcap")
    assert found.complete  # it has the footer that other programs expect
    assert written > 10
    np.testing.assert_array_equal(found.streams["measured"].values, force[:written])


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
    found = {}
    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            found[channel.topic] = document = json.loads(message.data)
            described = json.loads(schema.data)
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            assert described["type"] == "object"
            assert document.keys() <= described["properties"].keys()
            assert described["title"] == schema.name
            assert message.log_time == message.publish_time == START + 5 * (channel.topic == "/tactile/measured")
    tactile = found["/tactile/measured"]
    total = tactile.pop("total")[1]
    assert (total["pad"], total["z"]) == ("right", pytest.approx(float(FORCE[0, 1, 2].sum()), rel=1e-5))
    assert tactile["timestamp"] == {"sec": 1_700_000_000, "nsec": 5}
    assert tactile["force"] == pytest.approx(FORCE[0].ravel().tolist())
    assert (tactile["shape"], tactile["status"]) == ([2, 3, 4, 3], [0, 7])
    assert "note" not in tactile
    assert found["/covariate/opening"]["value"] == 0.25
    assert found["/covariate/pose"]["value"] == [1, 0, 0, 1]
    assert found["/episode"]["episode"] == 2


CANNOT_BE_WRITTEN = [
    ("measured", FORCE[0, 0], r"must be \(pads, 3, rows, cols\)"),
    ("mesured", FORCE[0], "unknown stream 'mesured'"),
    ("covariate/", 1.0, "unknown stream"),
    ("simulated", FORCE[0, :, :, :2], "must keep the shape"),
    ("covariate/opening", math.inf, "infinite"),
    *(("episode", wrong, "an episode must be a whole number, got") for wrong in (0.5, math.nan, [1], 1e300)),
]


def test_samples_that_cannot_be_written_cost_nothing_else(tmp_path):
    with LogWriter(tmp_path / "a.mcap", {}) as log:
        log.write("simulated", 1.0, FORCE[0])
        log.write("episode", 1.0, 0)
        for stream, values, word in CANNOT_BE_WRITTEN:
            with pytest.raises(InvalidValueError, match=word):
                log.write(stream, 2.0, values)
        with pytest.raises(InvalidValueError, match=r"status must be .* \(2,\)"):
            log.write("measured", 1.0, FORCE[0], status=(0, 0, 0))
        for wrong in (math.nan, math.inf, -1.0, 1.7e12, 1.2e10, 1e300):  # the fourth is in milliseconds
            with pytest.raises(InvalidValueError, match="must be in seconds since 1970-01-01 UTC, up to 2262"):
                log.write("covariate/opening", wrong, 1.0)
            with pytest.raises(InvalidValueError, match="must be in nanoseconds since 1970-01-01 UTC"):
                log.write_at("measured", wrong * 1e9, FORCE[1])
        log.flush()
        log.write("simulated", 2.0, FORCE[1])
        log.write("episode", 3.0, 1)
    found = read_log(tmp_path / "a.mcap")
    assert found.complete
    np.testing.assert_array_equal(found.streams["simulated"].values, FORCE[:2])
    assert found.streams["episode"].values.tolist() == [0, 1]
    assert set(found.streams) == {"simulated", "episode"}


def test_nothing_is_written_over_a_recording_unasked_or_into_a_closed_one(tmp_path):
    path = tmp_path / "a.mcap"
    write_log(path, FORCE)
    before = path.read_bytes()
    with pytest.raises(OutputExistsError):
        LogWriter(path, {})
    assert path.read_bytes() == before
    write_log(path, FORCE[:2], overwrite=True)
    assert len(Recording.load(path)) == 2
    log = LogWriter(tmp_path / "b.mcap", {})
    log.close()
    log.close()
    with pytest.raises(InvalidValueError, match="was closed"):
        log.write("measured", 1.0, FORCE[0])
    for metadata in ({"a": object()}, {"scene": 3}):
        with pytest.raises(InvalidValueError, match=r"metadata\["):
            LogWriter(tmp_path / "c.mcap", metadata)
    assert not (tmp_path / "c.mcap").exists()
