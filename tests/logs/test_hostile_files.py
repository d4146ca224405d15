"""Malicious or damaged files give a `PaxisimError` and need little memory."""

import json
import os
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from log_files import START, refused, write_json

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
for path in sys.argv[1:]:
    try:
        print(str(paxisim.Recording.load(path)).splitlines()[0])
    except paxisim.InvalidValueError as error:
        print(error)
"""

pytestmark = [
    pytest.mark.skipif(not os.path.exists("/proc/self/statm"), reason="needs Linux to measure memory"),
    pytest.mark.filterwarnings("ignore:.*cut off or damaged:UserWarning"),
]


def message_file(path, *messages, metadata=None):
    """Write a recording with the given messages, measured ones or (topic, message)."""
    described = {"format": "paxisim-recording/1", **{k: json.dumps(v) for k, v in (metadata or {}).items()}}
    pairs = [one if isinstance(one, tuple) else ("/tactile/measured", one) for one in messages]
    timed = [(topic, START + i, message) for i, (topic, message) in enumerate(pairs)]
    write_json(path, timed, described)


def sample(**changes):
    return {"shape": [1, 3, 1, 1], "force": [1, 2, 3], **changes}


def test_what_claims_more_than_it_has_costs_no_more_than_it_has(tmp_path):
    names = ("shape.mcap", "alone.mcap", "empty.mcap", "frame.mcap", "a.npz", "wide.mcap")
    shape, alone, empty, frame, archive, wide = (tmp_path / name for name in names)
    message_file(shape, sample(), sample(shape=[1, 3, 1, 1_000_000]))
    message_file(alone, sample(shape=[1, 3, 1, 1_000_000]))
    nothing = [(f"/covariate/{i}", {"shape": [300_000_000, 0, i], "value": []}) for i in range(500)]
    message_file(empty, sample(), *nothing)
    message_file(frame, *[sample(force=[i, 0, 1]) for i in range(300)])
    broken = bytearray(frame.read_bytes())
    begin = broken.index(b"\x28\xb5\x2f\xfd")
    broken[begin + 5 : begin + 9] = b"\xff\xff\xff\x7f"  # the size that a zstd frame declares
    frame.write_bytes(broken)
    np.savez(tmp_path / "whole.npz", time=np.arange(3), measured=np.zeros((3, 1, 3, 1, 1), np.float32))
    with zipfile.ZipFile(tmp_path / "whole.npz") as whole, zipfile.ZipFile(archive, "w") as changed:
        for name in whole.namelist():
            data = whole.read(name).replace(b"(3, 1, 3, 1, 1), }       ", b"(3, 1, 3, 1, 9999999), } ")
            changed.writestr(name, data)
    said = in_little_memory(LOAD, shape, alone, empty, frame, archive).splitlines()
    assert "1 sample" in said[0]
    assert "is damaged: none of its samples can be read" in said[1]
    assert "1 sample" in said[2]
    assert "is not a complete npz file" in said[4]
    numbers = np.random.default_rng(0).integers(0, 10**6, 300).tolist()
    each = [(f"/covariate/{i}", {"shape": [300], "value": numbers[i % 7 :] + numbers[: i % 7]}) for i in range(500)]
    message_file(wide, sample(), *each)
    assert "1 sample" in in_little_memory(LOAD, wide, most=40 * MEBIBYTE)


def test_a_small_file_that_unpacks_to_very_much_is_refused_unless_asked_for(tmp_path, monkeypatch):
    log, archive = tmp_path / "a.mcap", tmp_path / "a.npz"
    message_file(log, b" " * (200 * MEBIBYTE) + b"{}")
    np.savez_compressed(archive, time=np.arange(3), measured=np.zeros((3, 1, 3, 1, 10_000_000), np.float32))
    assert max(log.stat().st_size, archive.stat().st_size) < MEBIBYTE
    assert in_little_memory(LOAD, log, archive).count("expected at most") == 2
    message_file(log, sample(), sample(note=" " * (20 * MEBIBYTE)))
    np.savez_compressed(archive, time=np.arange(20_000), measured=np.zeros((20_000, 2, 3, 4, 5), np.float32))
    for path in (log, archive):
        refused(path, f"if you trust it, set {VARIABLE}=\\d+ or higher")
    monkeypatch.setenv(VARIABLE, str(64 * MEBIBYTE))
    assert (len(Recording.load(log)), len(Recording.load(archive))) == (2, 20_000)
    monkeypatch.setenv(VARIABLE, "much")
    refused(log, f"{VARIABLE} must be a number of bytes, got 'much'")


def test_an_unloaded_hand_is_no_bomb(tmp_path):
    """The limit admits the most compressible real data: 28 pads of zeros."""
    path = tmp_path / "a.mcap"
    with LogWriter(path, {}, flush_interval=1e9) as log:
        for i in range(120):
            log.write_at("measured", START + i * 11_111_111, np.zeros((28, 3, 20, 12)), status=[0] * 28)
    assert len(Recording.load(path)) == 120


WRONG_METADATA = [
    ({"pads": 5}, "pads in its metadata must be a list of names, got 5"),
    ({"pads": [[1]]}, "pads in its metadata must be a list of names"),
    ({"layout": 5}, "layout in its metadata: expected an object"),
    ({"layout": {"rows": 1, "cols": 1, "pitch": 1, "vendor_order": ["x"]}}, "layout in its metadata"),
    ({"layout": {"rows": 10**6, "cols": 10**6, "pitch": 1}}, "layout in its metadata: a layout has at most"),
    ({"time_zero_ns": ["x"]}, "time_zero_ns in its metadata must be a list of times"),
    ({"start": "now"}, "start in its metadata must be Unix seconds"),
]


def test_metadata_of_another_kind(tmp_path):
    for metadata, word in WRONG_METADATA:
        message_file(tmp_path / "a.mcap", sample(), metadata=metadata)
        refused(tmp_path / "a.mcap", word)


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


def test_a_scene_with_a_value_of_another_kind(tmp_path):
    path = tmp_path / "a.toml"
    for line in ("pads = 5", "mjcf = 5", "drive = 5", "start = [5]", "gel = 5", "pads = [{}]"):
        path.write_text("mjcf = 'a.xml'\n" * (not line.startswith("mjcf")) + line + "\n")
        with pytest.raises(InvalidValueError, match=r"a\.toml: "):
            paxisim.Scene.load(path)
