"""Malicious or damaged files give a `PaxisimError` and need little memory."""

import json
import os
import subprocess
import sys
import zipfile

import numpy as np
import pytest
import zstandard
from log_files import START, counts, recording
from mcap.writer import CompressionType, Writer

import paxisim
from paxisim.errors import InvalidValueError
from paxisim.hw.profiles.load import load_profile
from paxisim.logs.limits import VARIABLE
from paxisim.logs.mcap_writer import LogWriter
from paxisim.recording import Recording

MEBIBYTE = 1 << 20


def in_little_memory(code, *words, most=64 * MEBIBYTE):
    """Return the output of a process that may use at most `most` more bytes after its imports."""
    before = f"""
import resource, sys
import numpy, orjson, zipfile, mcap.reader, zstandard, paxisim
import paxisim.logs.load, paxisim.logs.npz, paxisim.logs.mcap_reader, paxisim.logs.resample, paxisim.logs.csv
paxisim.Recording
with open("/proc/self/statm") as file:
    used = int(file.read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {most}, used + {most}))
"""
    run = subprocess.run([sys.executable, "-c", before + code, *words], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout


LOAD = """
try:
    print(paxisim.Recording.load(sys.argv[1]))
except paxisim.InvalidValueError as error:
    print(error)
"""

pytestmark = [
    pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="needs Linux to measure memory"),
    pytest.mark.filterwarnings("ignore:.*cut off or damaged:UserWarning"),
]


def message_file(path, *messages, metadata=None, topic="/tactile/measured"):
    """Write a recording with the given JSON messages."""
    with open(path, "wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start()
        described = {"format": "paxisim-recording/1", **{k: json.dumps(v) for k, v in (metadata or {}).items()}}
        writer.add_metadata("paxisim", described)
        channels = {}
        for i, message in enumerate(messages):
            name, document = message if isinstance(message, tuple) else (topic, message)
            if name not in channels:
                channels[name] = writer.register_channel(name, "json", 0)
            data = document if isinstance(document, bytes) else json.dumps(document).encode()
            writer.add_message(channels[name], START + i, data, START + i)
        writer.finish()


def sample(**changes):
    return {"shape": [1, 3, 1, 1], "force": [1, 2, 3], **changes}


def test_a_message_that_claims_more_than_it_has(tmp_path):
    path = tmp_path / "a.mcap"
    message_file(path, sample(), sample(shape=[1, 3, 1, 1_000_000]))
    assert "1 sample" in in_little_memory(LOAD, path)
    message_file(path, sample(shape=[1, 3, 1, 1_000_000]))
    assert "is damaged: none of its samples can be read" in in_little_memory(LOAD, path)


def test_many_topics_that_claim_much_and_hold_nothing(tmp_path):
    path = tmp_path / "a.mcap"
    empty = [(f"/covariate/{i}", {"shape": [300_000_000, 0, i], "value": []}) for i in range(500)]
    message_file(path, sample(), *empty)
    assert "1 sample" in in_little_memory(LOAD, path)


def test_many_topics_of_one_wide_sample_each_cost_no_more_than_they_hold(tmp_path):
    path = tmp_path / "a.mcap"
    numbers = np.random.default_rng(0).integers(0, 10**6, 300).tolist()
    wide = [(f"/covariate/{i}", {"shape": [300], "value": numbers[i % 7 :] + numbers[: i % 7]}) for i in range(500)]
    message_file(path, sample(), *wide)
    assert "1 sample" in in_little_memory(LOAD, path, most=40 * MEBIBYTE)


def test_a_chunk_that_unpacks_to_very_much(tmp_path, monkeypatch):
    path = tmp_path / "a.mcap"
    message_file(path, b" " * (200 * MEBIBYTE) + b"{}")
    assert path.stat().st_size < MEBIBYTE
    assert f"bytes or more, expected at most .* set {VARIABLE}=".split(" .* ")[0] in in_little_memory(LOAD, path)
    message_file(path, sample(), sample(note=" " * (20 * MEBIBYTE)))
    with pytest.raises(InvalidValueError, match=f"if you trust it, set {VARIABLE}=\\d+ or higher"):
        Recording.load(path)
    monkeypatch.setenv(VARIABLE, str(64 * MEBIBYTE))
    assert len(Recording.load(path)) == 2
    monkeypatch.setenv(VARIABLE, "much")
    with pytest.raises(InvalidValueError, match=f"{VARIABLE} must be a number of bytes, got 'much'"):
        Recording.load(path)


def test_a_chunk_whose_frame_claims_very_much(tmp_path):
    """No memory is allocated for the size that a zstd frame declares."""
    path = tmp_path / "a.mcap"
    message_file(path, *[sample(force=[i, 0, 1]) for i in range(300)])
    data = path.read_bytes()
    frame = data.index(zstandard.FRAME_HEADER[:4] if hasattr(zstandard, "FRAME_HEADER") else b"\x28\xb5\x2f\xfd")
    broken = bytearray(data)
    broken[frame + 5 : frame + 9] = b"\xff\xff\xff\x7f"
    path.write_bytes(broken)
    in_little_memory(LOAD, path)


def test_an_unloaded_hand_is_no_bomb(tmp_path):
    """The limit admits the most compressible real data: 28 pads of zeros."""
    path = tmp_path / "a.mcap"
    with LogWriter(path, {}, flush_interval=1e9) as log:
        for i in range(120):
            log.write_at("measured", START + i * 11_111_111, np.zeros((28, 3, 20, 12)), status=[0] * 28)
    assert len(Recording.load(path)) == 120


def test_an_archive_that_unpacks_to_very_much(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, time=np.arange(3), measured=np.zeros((3, 1, 3, 1, 10_000_000), np.float32))
    assert path.stat().st_size < MEBIBYTE
    assert "expected at most" in in_little_memory(LOAD, path)
    np.savez_compressed(path, time=np.arange(20_000), measured=np.zeros((20_000, 2, 3, 4, 5), np.float32))
    with pytest.raises(InvalidValueError, match=VARIABLE):
        Recording.load(path)
    monkeypatch.setenv(VARIABLE, str(64 * MEBIBYTE))
    assert len(Recording.load(path)) == 20_000


def test_an_array_that_claims_more_than_it_has(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, time=np.arange(3), measured=np.zeros((3, 1, 3, 1, 1), np.float32))
    with zipfile.ZipFile(path) as whole:
        members = {name: whole.read(name) for name in whole.namelist()}
    old = members["measured.npy"]
    members["measured.npy"] = old.replace(b"(3, 1, 3, 1, 1), } ", b"(3, 1, 3, 1, 99999999), } "[:19]).replace(
        b"(3, 1, 3, 1, 1), }       ", b"(3, 1, 3, 1, 9999999), } "
    )
    with zipfile.ZipFile(path, "w") as changed:
        for name, data in members.items():
            changed.writestr(name, data)
    assert "is not a complete npz file" in in_little_memory(LOAD, path)


@pytest.mark.parametrize(
    ("metadata", "says"),
    [
        ({"pads": 5}, "pads in its metadata must be a list of names, got 5"),
        ({"pads": [[1]]}, "pads in its metadata must be a list of names"),
        ({"layout": 5}, "layout in its metadata: expected an object"),
        ({"layout": {"rows": 1, "cols": 1, "pitch": 1, "vendor_order": ["x"]}}, "layout in its metadata"),
        ({"layout": {"rows": 10**6, "cols": 10**6, "pitch": 1}}, "layout in its metadata: a layout has at most"),
        ({"time_zero_ns": ["x"]}, "time_zero_ns in its metadata must be a list of times"),
        ({"start": "now"}, "start in its metadata must be Unix seconds"),
    ],
)
def test_metadata_of_another_kind(tmp_path, metadata, says):
    path = tmp_path / "a.mcap"
    message_file(path, sample(), metadata=metadata)
    with pytest.raises(InvalidValueError, match=says):
        Recording.load(path)


DEEP = "[" * 100_000 + "]" * 100_000
MANY_DIGITS = "9" * 5000


@pytest.mark.parametrize("text", [DEEP, MANY_DIGITS], ids=["deep", "digits"])
def test_json_and_toml_that_no_parser_likes(tmp_path, text):
    path = tmp_path / "a.json"
    path.write_text(text)
    for load in (paxisim.Chain.load, paxisim.Protocol.load, paxisim.diagnose.Diagnosis.from_json):
        with pytest.raises(InvalidValueError):
            load(text if load == paxisim.diagnose.Diagnosis.from_json else path)
    path = tmp_path / "a.toml"
    for key in ("mjcf", "name", "pads"):
        path.write_text(f"{key} = {text}\n")
        for load in (paxisim.Scene.load, load_profile):
            with pytest.raises(InvalidValueError):
                load(path)
    table = "time,tactile.left.0_0.x,tactile.left.0_0.y,tactile.left.0_0.z\n0,1,2,3\n"
    path = tmp_path / "a.csv"
    path.write_text(f"# {text}\n{table}")
    assert "comment" in Recording.load(path).metadata


@pytest.mark.parametrize("column", ["tactile.left.0_{}.x", "opening.{}", "0-1-NxN-X[{}]", "a_pt{}_fx_lsb"])
def test_an_index_of_five_thousand_digits(tmp_path, column):
    path = tmp_path / "a.csv"
    head = {"0": "Timestamp", "a": "timestamp_monotonic_s"}.get(column[0], "time")
    path.write_text(f"{head},{column.format(MANY_DIGITS)}\n0,1\n")
    with pytest.raises(InvalidValueError):
        Recording.load(path)
    plain = "time,tactile.left.0_0.x,tactile.left.0_0.y,tactile.left.0_0.z"
    path.write_text(f"{plain},{column.format(MANY_DIGITS)}\n0,1,2,3,4\n")
    assert np.all(Recording.load(path).measured == np.array([1, 2, 3]).reshape(1, 1, 3, 1, 1))


@pytest.mark.parametrize("line", ["pads = 5", "mjcf = 5", "drive = 5", "start = [5]", "gel = 5", "pads = [{}]"])
def test_a_scene_with_a_value_of_another_kind(tmp_path, line):
    path = tmp_path / "a.toml"
    path.write_text("mjcf = 'a.xml'\n" * (not line.startswith("mjcf")) + line + "\n")
    with pytest.raises(InvalidValueError, match=r"a\.toml: "):
        paxisim.Scene.load(path)


def test_what_is_written_still_comes_back(tmp_path):
    original = recording(measured=counts(50))
    for name in ("a.mcap", "a.npz"):
        original.save(tmp_path / name)
        assert len(Recording.load(tmp_path / name)) == 50
