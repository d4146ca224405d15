"""Randomly changed files of each format; each must load as a valid object or give a `PaxisimError`, in little memory.

``python test_mutants.py FORMAT COUNT SEED FOLDER`` runs as a separate process because the peak memory of a process can
be queried at no cost. Prints the number of readable and unreadable files, the growth of peak memory and the largest
file (bytes). At the first other error, it prints the number of the mutant and ends with a traceback.
"""

import io
import itertools
import json
import random
import re
import subprocess
import sys
import warnings
import zipfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_files import joint_state, write_ros2
from mcap.writer import CompressionType, Writer

import paxisim
import paxisim.diagnose
from paxisim.errors import PaxisimError
from paxisim.hw.profiles.load import load_profile
from paxisim.hw.profiles.profile import Profile
from paxisim.logs.csv_writer import write_csv
from paxisim.logs.lerobot_writer import write_lerobot
from paxisim.logs.mcap_reader import is_recording
from paxisim.logs.mcap_topics import read_topics
from paxisim.logs.parquet import write_parquet
from paxisim.logs.topic_streams import TopicStreams

TESTS = Path(__file__).parents[1]
sys.path += [str(TESTS), str(TESTS / "diagnose")]
TOKENS = [
    *(b"-1", b"0", b"1e999", b"1e308", b"-0.5", b"NaN", b"1" * 5000, b"9999999", b"4294967296", b"1000000"),
    *(b"-9223372036854775809", b"null", b"true", b"[]", b"{}", b'""', b"[" * 2000, b'{"a":' * 500, b'"x"'),
    *(b"[[1]]", b"5", b"\x1b[2J", b"\x00", b"\xff", b"\\ud800", "\u202e".encode(), b"\n", b",", b"#", b"'"),
    *(b"0_0.z", b"time", b"\r"),
]


def changed(data: bytes, rng: random.Random) -> bytes:
    """Apply one to four changes: flip bits, replace bytes or values, drop or repeat spans, or truncate."""
    mutant = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        at, kind = rng.randrange(len(mutant) + 1), rng.randrange(8)
        span = slice(at, at + rng.choice((1, 2, 4, 8, 40)))
        if kind == 0 and at < len(mutant):
            mutant[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            mutant[span] = bytes(rng.randrange(256) for _ in range(rng.randrange(9)))
        elif kind == 2:
            del mutant[span]
        elif kind == 3:
            mutant[at:at] = mutant[span] * rng.choice((1, 1, 50))
        elif kind == 4:
            mutant[span] = rng.choice(TOKENS)
        elif kind == 5 and rng.random() < 0.3:
            del mutant[at:]
        else:  # a whole number or word
            pattern = rng.choice((rb"\w+", rb"[-+.\w]+", rb"\[[^\[\]]*\]", rb'"[^"]*"'))
            words = list(re.finditer(pattern, mutant))
            if words:
                begin, end = rng.choice(words).span()
                mutant[begin:end] = rng.choice(TOKENS)
    return bytes(mutant)


def recording() -> paxisim.Recording:
    rng = np.random.default_rng(0)
    return paxisim.Recording(
        time=np.arange(4) * 0.01,
        measured=rng.normal(size=(4, 2, 3, 2, 1)),
        simulated=rng.normal(size=(4, 2, 3, 2, 1)),
        covariates={"opening": rng.normal(size=4), "pose": rng.normal(size=(4, 2))},
        episode=[0, 0, 1, 1],
        layout=paxisim.TaxelLayout(2, 1, 1e-3, vendor_order=(1, 0)),
        pads=("left", "right"),
        metadata={"start": 1.7e9, "sensor": "a"},
    )


TOUCH = {
    **{"shape": [1, 3, 1, 2], "force": [1, 2, 3, 4, None, 6], "sequence": 1},
    **{"status": [0], "resultant": [[1, 2, 3]]},
}
ARM = {"timestamp": {"sec": 3, "nsec": 4}, "name": ["a", "b"], "position": [1, 2.5], "velocity": [0, 1]}
ABOUT = {
    "layout": {"rows": 1, "cols": 2, "pitch": [1e-3, 1e-3]},
    **{"pads": ["a"], "time_zero_ns": [5], "episode_clocks": [[5, 5, 0]], "start": 1.5},
}
RECORDED = {"/tactile/measured": TOUCH, "/covariate/a": {"value": 3}, "/covariate/b": {"shape": [2], "value": [1, 2]}}
ROBOT = {"/joints": ARM, "/other": {"a": 3, "b": [1, 2], "time": 5.5}}


def mcap_bases(folder: Path) -> list[bytes]:
    recording().save(folder / "base.mcap")
    return [(folder / "base.mcap").read_bytes(), written({}), written({}, ROBOT, "robot")]


def written(mutants: dict[str, bytes], documents: dict[str, Any] = RECORDED, name: str = "paxisim") -> bytes:
    """Return an MCAP file in which some messages, by topic, or metadata entries are replaced by `mutants`."""
    file = io.BytesIO()
    writer = Writer(file, compression=CompressionType.NONE, enable_crcs=False, enable_data_crcs=False)
    writer.start()
    about = {k: mutants.get(k, json.dumps(v).encode()).decode(errors="replace") for k, v in ABOUT.items()}
    writer.add_metadata(name, {"format": "paxisim-recording/1", **about})
    for topic, document in documents.items():
        channel = writer.register_channel(topic, "json", 0)
        data = json.dumps(document).encode()
        for i in range(3):
            writer.add_message(channel, 10 + i, mutants.get(topic, data) if i != 1 else data, 10 + i)
    writer.finish()
    return file.getvalue()


def mcap_mutant(bases: list[bytes], rng: random.Random) -> bytes:
    """Change any byte of a file, or only the content of a message or metadata entry in a well-formed file."""
    if rng.random() < 0.3:
        return changed(rng.choice(bases), rng)
    documents, name = rng.choice(((RECORDED, "paxisim"), (RECORDED, "paxisim"), (ROBOT, "robot")))
    hit = rng.choice([*documents, *documents, *ABOUT])
    data = json.dumps({**documents, **ABOUT}[hit]).encode()
    return written({hit: changed(data, rng)}, documents, name)


def read_mcap(path: Path) -> object:
    """Load a file as a recording if it claims to be one, else as streams to add."""
    return paxisim.Recording.load(path) if is_recording(path) else read_topics(path)


def npz_bases(folder: Path) -> list[bytes]:
    recording().save(folder / "base.npz")
    return [(folder / "base.npz").read_bytes()]


def npz_mutant(bases: list[bytes], rng: random.Random) -> bytes:
    """Change the archive itself, or its members with new checksums, stored or compressed."""
    if rng.random() < 0.3:
        return changed(bases[0], rng)
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(bases[0])) as whole:
        hit = rng.choice(whole.namelist())
        how = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
        with zipfile.ZipFile(file, "w", how) as archive:
            for name in whole.namelist():
                data = whole.read(name)
                data = changed(data[:128], rng) + data[128:] if name == hit and rng.random() < 0.5 else data
                archive.writestr(name, changed(data, rng) if name == hit else data)
    return file.getvalue()


def csv_bases(folder: Path) -> list[bytes]:
    grid = ",".join(f"tactile.left.{row}_{col}.{axis}" for row in "01" for col in "01" for axis in "xyz")
    native = "timestamp_iso,timestamp_monotonic_s,a_pt000_fx_lsb,a_pt000_fy_lsb,a_pt000_fz_lsb,a_resultant_fx_lsb"
    host = "Timestamp,0-1-NxN-X[0],0-1-NxN-Y[0],0-1-NxN-Z[0],0-1-1x1-X,0-1-1x1-Y,0-1-1x1-Z"
    one = ",".join("123456789012")
    head = f"time,episode_index,{grid},opening,pose.0,pose.1"
    write_csv(folder / "ours.csv", recording().to_arrays())
    return [
        f'# {{"sensor": "a"}}\n{head}\n0,0,{one},,3,4\n1,1,{one},2,3,4\n'.encode(),
        f"{native}\n2026-01-01,0.5,1,2,3,4\n2026-01-01,0.6,1,2,3,4\n".encode(),
        f"{host}\n23:59:59.5,1,2,3,4,5,6\n00:00:00.1,1,2,,4,5,6\n".encode(),
        (folder / "ours.csv").read_bytes(),
    ]


def any_mutant(bases: list[bytes], rng: random.Random) -> bytes:
    return changed(rng.choice(bases), rng)


def toml_bases(folder: Path) -> list[bytes]:
    scene = paxisim.Scene(
        "a.xml",
        (paxisim.Drive("z", joint="z", unit="mm"), paxisim.Drive("pose", body="b", column=1)),
        pads=("left", "right"),
        closing="z",
    )
    scene.save(folder / "base.toml")
    profile = b"""name = "mine"\nfamily = "high-speed"\naxes = ["+x", "-y", "+z"]\npool = [1, 1]\nresolution = 0.1\n
[layout]\nrows = 1\ncols = 2\npitch = [0.001, 0.002]\nvendor_order = [1, 0]\n
[[slots]]\nname = "pad"\nindex = 1\n\n[settings]\n\n[sources]\nrate = "me"\n"""
    return [(folder / "base.toml").read_bytes(), b'like = "gen3-highspeed-mc-m2020"\nrate = 50.0\n', profile]


def read_toml(path: Path) -> object:
    return paxisim.Scene.load(path) if b"mjcf" in path.read_bytes() else load_profile(path)


def json_bases(folder: Path) -> list[bytes]:
    chain = paxisim.Chain(
        [paxisim.augment.Poisson(0.2, 0.3), paxisim.augment.Offset(np.ones((1, 3, 2, 1))), paxisim.augment.Latency(0.1)]
    )
    chain.save(folder / "base.json")
    protocol = {
        **{
            "format": "paxisim-protocol/1",
            "name": "a",
            "about": "b",
            "scene": "press",
            "frame": "f",
            "columns": ["time", "z"],
        },
        **{"max_speed": 0.1, "stop_at_normal_force_on_a_pad": 5, "record_at_least": 50},
        "segments": [{"episode": 0, "name": "a", "does": "b", "motions": ["probe"], "waypoints": [[0, 0], [1, 0.01]]}],
    }
    return [(folder / "base.json").read_bytes(), json.dumps(protocol).encode()]


def read_json(path: Path) -> object:
    data = path.read_bytes()
    if b"segments" in data:
        return paxisim.Protocol.load(path)
    return paxisim.Chain.load(path)


DATASET = ("data/chunk-000/file-000.parquet", "meta/info.json", "meta/paxisim.json", "meta/tasks.parquet")


def lerobot_bases(folder: Path) -> list[bytes]:
    """Return the files of a dataset, each prefixed with its number, which stays unchanged."""
    write_lerobot(folder / "dataset", recording().to_arrays(), task="press")
    return [bytes([i]) + (folder / "dataset" / name).read_bytes() for i, name in enumerate(DATASET)]


def lerobot_mutant(bases: list[bytes], rng: random.Random) -> bytes:
    base = rng.choice(bases)
    return base[:1] + changed(base[1:], rng)


def read_lerobot(path: Path) -> object:
    """Load the dataset with one of its files replaced."""
    data = path.read_bytes()
    file = path.parent / "dataset" / DATASET[data[0]]
    whole = file.read_bytes()
    file.write_bytes(data[1:])
    try:
        return paxisim.Recording.load(path.parent / "dataset")
    finally:
        file.write_bytes(whole)


def hdf5_bases(folder: Path) -> list[bytes]:
    import h5py

    with h5py.File(folder / "base.hdf5", "w") as file:
        file.create_group("data").attrs["env_args"] = '{"env_kwargs": {"control_freq": 20}}'
        for number in (0, 1):
            for name, shape in (("actions", (4, 2)), ("obs/opening", (4,)), ("obs/touch", (4, 1, 3, 2, 1))):
                file[f"data/demo_{number}/{name}"] = np.ones(shape, np.float32)
    return [(folder / "base.hdf5").read_bytes()]


def parquet_bases(folder: Path) -> list[bytes]:
    write_parquet(folder / "base.parquet", recording().to_arrays())
    return [(folder / "base.parquet").read_bytes()]


def bag_bases(folder: Path, kind: str) -> list[bytes]:
    """Return a bag of ROS with XELA's topic and joint states."""
    from bag_files import write_bag
    from test_ros_bags import path_of, xela

    path = write_bag(path_of(folder, kind), kind, lambda build: itertools.islice(xela()(build), 15))
    return [(next(path.glob("*.db3")) if path.is_dir() else path).read_bytes()]


def joint_bases(folder: Path) -> list[bytes]:
    """Return a ROS 2 recording of joint states in MCAP."""
    states = [(10**9 + i, joint_state(10**9 + i, ["a", "b"], [1.0, i], effort=[1.0, 2.0])) for i in range(4)]
    messages = [("/joints", at, state) for at, state in states]
    write_ros2(folder / "base.mcap", messages, compression=CompressionType.NONE, enable_crcs=False)
    return [(folder / "base.mcap").read_bytes()]


def calibration_bases(folder: Path) -> list[bytes]:
    from load_rig import NAMES, rig

    paxisim.calibrate_sensor(rig(seconds=20.0)[0], dict(zip(NAMES, NAMES, strict=True))).save(folder / "base.json")
    return [(folder / "base.json").read_bytes()]


def diagnosis_bases(folder: Path) -> list[bytes]:
    from hidden.cases import make
    from recorded import recording_of

    case = make(("axis_gain",), seed=3, rows=2, cols=2, duration=4.0, rate=20, strength=0.9)
    return [paxisim.diagnose(recording_of(case), ("axis_gain", "offset")).to_json().encode()]


def read_diagnosis(path: Path) -> object:
    found = paxisim.diagnose.Diagnosis.from_json(path.read_bytes().decode(errors="replace"))
    assert str(found)
    return found


FORMATS = {
    "hdf5": (hdf5_bases, any_mutant, paxisim.Recording.load, paxisim.Recording),
    "parquet": (parquet_bases, any_mutant, paxisim.Recording.load, paxisim.Recording),
    "joints": (joint_bases, any_mutant, read_topics, TopicStreams),
    "bag": (partial(bag_bases, kind="bag"), any_mutant, paxisim.Recording.load, paxisim.Recording),
    "db3": (partial(bag_bases, kind="sqlite"), any_mutant, paxisim.Recording.load, paxisim.Recording),
    "calibration": (calibration_bases, any_mutant, paxisim.Calibration.load, paxisim.Calibration),
    "diagnosis": (diagnosis_bases, any_mutant, read_diagnosis, paxisim.diagnose.Diagnosis),
    "mcap": (mcap_bases, mcap_mutant, read_mcap, (paxisim.Recording, TopicStreams)),
    "npz": (npz_bases, npz_mutant, paxisim.Recording.load, paxisim.Recording),
    "lerobot": (lerobot_bases, lerobot_mutant, read_lerobot, paxisim.Recording),
    "csv": (csv_bases, any_mutant, paxisim.Recording.load, paxisim.Recording),
    "toml": (toml_bases, any_mutant, read_toml, (paxisim.Scene, Profile)),
    "json": (json_bases, any_mutant, read_json, (paxisim.Chain, paxisim.Protocol)),
}


def peak() -> int:
    """Return the peak memory of this process (bytes)."""
    status = Path("/proc/self/status")
    return 1024 * int(status.read_text().split("VmHWM:")[1].split()[0]) if status.exists() else 0


def run(name: str, count: int, seed: int, folder: Path) -> dict[str, int]:
    """Load `count` changed files and return how many were good and bad, the growth of memory and the largest file."""
    bases_of, mutant_of, read, kinds = FORMATS[name]
    bases = bases_of(folder)
    path = folder / f"mutant.{name}"
    for base in bases:  # triggers all lazy imports
        path.write_bytes(base)
        assert isinstance(read(path), kinds), "an unchanged file should load"
    before, largest, good = peak(), 0, 0
    for number in range(count):
        data = mutant_of(bases, random.Random(f"{seed} {number}"))
        path.write_bytes(data)
        largest = max(largest, len(data))
        try:
            assert isinstance(read(path), kinds)
            good += 1
        except PaxisimError:
            pass
        except BaseException:
            print(f"mutant {number}", file=sys.stderr)
            raise
    return {"good": good, "bad": count - good, "grown": peak() - before, "largest": largest}


NEEDS = {
    "lerobot": "pyarrow.parquet",
    "parquet": "pyarrow.parquet",
    "hdf5": "h5py",
    "joints": "mcap_ros2",
    "bag": "rosbags",
    "db3": "rosbags",
}
SLOW_TO_READ = ("hdf5", "parquet", "joints", "bag", "db3", "calibration", "diagnosis")
MEBIBYTE = 1 << 20


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", FORMATS)
def test_a_changed_file_is_an_error_of_ours_or_a_valid_object(tmp_path, name):
    if name in NEEDS:
        pytest.importorskip(NEEDS[name], exc_type=ImportError)
    assert run(name, 40, 1, tmp_path)["bad"] > 4


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs Linux to measure memory")
@pytest.mark.parametrize("name", FORMATS)
def test_thousands_of_changed_files_need_little_memory(tmp_path, name):
    if name in NEEDS:
        pytest.importorskip(NEEDS[name], exc_type=ImportError)
    count = 1_000 if name in SLOW_TO_READ else 10_000
    words = [sys.executable, __file__, name, str(count), "0", str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert found["good"] > count / 100, "some changes should be harmless"
    assert found["bad"] > count / 10
    assert found["grown"] < 10 * found["largest"] + 64 * MEBIBYTE


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    print(json.dumps(run(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))))
