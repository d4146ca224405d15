"""Contract of the formats: every odd recording comes back as it was, whole or not at all, with the pads asked for."""

import os

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from log_files import LAYOUT, START, assert_equal, counts, recording, write_log

from paxisim.cli.convert import convert
from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.logs.mcap_writer import LogWriter
from paxisim.recording import Recording

N = 8


def of(*shape):
    """Return values that float32 holds."""
    return np.arange(N * int(np.prod(shape)), dtype=np.float64).reshape(N, *shape) / 8


TIME = np.arange(N) / 4
EPISODES = np.repeat([7, 3], N // 2)
ODD = {
    "numbered": {"covariates": {"joint.1": of(), "joint.2": of() + 1}},
    "beside its part": {"covariates": {"joint": of(), "joint.1": of() + 1}},
    "one of one": {"covariates": {"x.0": of()}},
    "one of one in a row": {"covariates": {"x": of(1)}},
    "index of a matrix": {"covariates": {"x.1_2": of(), "x.0": of(2)}},
    "named like a column": {"covariates": {"task_index": of(), "next.done": of()}},
    "named like a taxel": {"covariates": {"tactile.foo.0_0.z": of(), "simulated.left.9_9.x": of(3)}},
    "named like a feature": {"covariates": {"observation.state": of(3), "action": of(2)}},
    "parts of a feature": {"covariates": {"observation.state.a": of(), "action.b.0": of(2)}},
    "named like files": {
        "covariates": {"x": of(), "x.npy": of() + 1, "x.npy.npy": of() + 2, "npy": of(), ".npy": -of()}
    },
    "quotes": {"covariates": {'"a\', b"': of(), "a,b": of()}},
    "unicode": {"covariates": {"Öffnung µm": of(), "力": of(2)}, "pads": ("左", "a.0_0")},
    "line separator": {"covariates": {"a\u2028b": of(), "c\x85d": of(2)}},
    "slashes": {"covariates": {"arm/pose": of(2, 3), "/": of()}},
    "spaces": {"covariates": {" ": of(), " a ": of(2)}},
    "widths": {"covariates": {"w1": of(1), "w12": of(12), "w223": of(2, 2, 3), "w11": of(1, 1)}},
    "resultant": {"covariates": {"resultant": of(2, 3), "measured": of()}},
    "restarting clocks": {"time": np.tile(TIME[: N // 2], 2), "episode": EPISODES},
    "clocks that overlap": {"time": np.concatenate([TIME[:4], TIME[:4] - 0.5]), "episode": EPISODES},
    "a late clock": {"time": TIME + 1e9, "covariates": {"x": of()}},
    "Unix start": {"metadata": {"start": 1.7e9, "tasks": {"7": "pick", "3": "place"}}, "episode": EPISODES},
    "negative time": {"time": TIME - 100, "episode": EPISODES - 5},
    "unknown values": {
        "covariates": {"x.1": np.where(TIME > 1, of(), np.nan), "y": np.where(of(2) < 1, of(2), np.nan)}
    },
    "simulated only": {"measured": None, "simulated": np.zeros((N, 2, 3, 1, 2), np.float32)},
    "unit": {"metadata": {"unit": "uT", "note": '\u2028 "x" 力', "list": [{"a": None}]}},
}


def converted(path, original):
    """Write a recording in the format of the path's suffix with ``paxisim convert``, and load it."""
    original.save(path.parent / "a.npz")
    if path.suffix == ".lerobot":
        convert(path.parent / "a.npz", lerobot=path, fps=4)
    else:
        convert(path.parent / "a.npz", path, force=True)
    return Recording.load(path)


@pytest.mark.filterwarnings("ignore:. of 8 frames hold NaN")
@pytest.mark.parametrize("kind", ["npz", "mcap", "csv", "parquet", "lerobot"])
@pytest.mark.parametrize("name", ODD)
def test_odd_recordings_come_back(tmp_path, name, kind):
    if kind in ("parquet", "lerobot"):
        pytest.importorskip("pyarrow")
    force = (np.arange(N * 2 * 3 * 2).reshape(N, 2, 3, 1, 2) / 4).astype(np.float32)
    original = Recording(**{"time": TIME, "measured": force, "pads": ("left", "right"), **ODD[name]})
    loaded = converted(tmp_path / f"b.{kind}", original)
    assert_equal(loaded, original)
    assert {key: value for key, value in loaded.metadata.items() if key != "paxisim"} == original.metadata


@pytest.mark.parametrize("suffix", [".mcap", ".npz", ".NPZ", ".csv", ".parquet"])
def test_what_is_saved_comes_back_whole_or_with_the_pads_asked_for(tmp_path, suffix):
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    path = tmp_path / f"a{suffix}"
    original = recording(covariates={"resultant": counts(50).sum((3, 4)), "arm/pose": np.ones((50, 2, 3))})
    for _ in range(2):  # the second overwrites the first
        if suffix in (".csv", ".parquet"):
            loaded = converted(path, original)
        else:
            original.save(path)
            loaded = Recording.load(path)
        assert_equal(loaded, original)
        assert {name: value for name, value in loaded.metadata.items() if name != "paxisim"} == original.metadata
    assert set(os.listdir(tmp_path)) <= {path.name, "a.npz"}
    for pads, index in ((["right"], [1]), (["right", "left"], [1, 0])):
        loaded = Recording.load(path, pads=pads)
        assert loaded.pads == tuple(pads)
        np.testing.assert_array_equal(loaded.measured, original.measured[:, index])
        np.testing.assert_array_equal(loaded.simulated, original.simulated[:, index])
        np.testing.assert_allclose(loaded.covariates["resultant"], original.covariates["resultant"][:, index])
    with pytest.raises(UnknownNameError, match="unknown pad 'rigth'; did you mean 'right'"):
        Recording.load(path, pads=["rigth"])


@pytest.mark.parametrize("suffix", [".mcap", ".npz"])
def test_little_comes_back_as_well(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    for original in (
        Recording(time=[-3.0], simulated=np.full((1, 1, 3, 1, 1), np.nan)),
        Recording(time=[1.5, 1.5], measured=np.zeros((2, 1, 3, 1, 2)), episode=[0, 1]),
        Recording(time=[9, -5], measured=np.zeros((2, 1, 3, 1, 2)), episode=[0, 1]),
        Recording(time=[0, 1], measured=np.zeros((2, 1, 3, 1, 2)), covariates={"unknown": [np.nan, np.nan]}),
    ):
        original.save(path)
        assert_equal(Recording.load(path), original)


def test_the_time_of_a_long_recording_keeps_its_nanoseconds(tmp_path):
    time = np.cumsum(np.random.default_rng(0).integers(1, 10**12, 20)) * 1e-9
    original = Recording(time=time, measured=np.zeros((20, 1, 3, 1, 1)), metadata={"start": 1.7e9})
    original.save(tmp_path / "a.mcap")
    assert_equal(Recording.load(tmp_path / "a.mcap"), original)


def test_a_time_that_a_log_cannot_hold_is_refused(tmp_path):
    late = [([0, 1], 1e19)]
    late += [(time, start) for time in ([0, 1.7e12], [0, 1e10], [-1e300, 0], [-2e10, 0]) for start in (0.0, 1.7e9)]
    for time, start in late:
        with pytest.raises(InvalidValueError, match="must end before 2262-04-11; they reach"):
            Recording(time, np.zeros((2, 1, 3, 1, 1)), metadata={"start": start}).save(tmp_path / "a.mcap")
    assert not list(tmp_path.iterdir())


TWICE_ROUNDED = np.array([7.038531e-26, -7.038531e-26, -0.0], np.float32).reshape(1, 1, 3, 1, 1)
numbers = st.floats(width=32, allow_infinity=False, allow_nan=True)


@given(arrays.arrays(np.float32, (2, 1, 3, 2, 2), elements=numbers))
@example(TWICE_ROUNDED)
@settings(max_examples=25, deadline=None)
def test_every_float32_comes_back_to_the_bit(tmp_path_factory, force):
    path = tmp_path_factory.mktemp("bits") / "a.mcap"
    Recording(time=np.arange(len(force)), measured=force).save(path)
    loaded = Recording.load(path).measured
    known = ~np.isnan(force)
    np.testing.assert_array_equal(np.isnan(loaded), ~known)
    np.testing.assert_array_equal(loaded[known].view(np.uint32), force[known].view(np.uint32))


def test_a_live_recording_counts_time_from_its_first_sample(tmp_path):
    write_log(tmp_path / "a.mcap", counts(5))
    loaded = Recording.load(tmp_path / "a.mcap")
    assert loaded.time.tolist() == [0, 0.01, 0.02, 0.03, 0.04]
    assert loaded.metadata["start"] == START * 1e-9
    assert loaded.metadata["sensor"] == "a sensor"
    assert (loaded.layout, loaded.pads) == (LAYOUT, ("left", "right"))


@pytest.mark.parametrize("name", ["a.mcap", "a.npz"])
def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, name):
    path = tmp_path / name
    recording().save(path)
    before = path.read_bytes()
    force = counts(50)
    force[30, 0, 0, 0, 0] = np.inf
    for changes, word in (({"metadata": {"thing": object()}}, "JSON"), ({"measured": force}, "infinite")):
        with pytest.raises(InvalidValueError, match=word):
            recording(**changes).save(path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == [name]
    (tmp_path / "folder.mcap").mkdir()
    for wrong, word in ((tmp_path / "no" / name, "folder does not exist"), (tmp_path / "folder.mcap", "is a folder")):
        with pytest.raises(InvalidValueError, match=word):
            recording().save(wrong)


def test_a_suffix_or_file_that_is_none(tmp_path):
    with pytest.raises(InvalidValueError, match=r"saved as \.mcap or \.npz"):
        recording().save(tmp_path / "a.h5")
    with pytest.raises(InvalidValueError, match=r"\.csv, \.npz, \.parquet, \.hdf5 or \.mcap"):
        Recording.load(tmp_path / "a.doc")
    for name in ("a.mcap", "a.npz", "a.csv", "a.parquet"):
        with pytest.raises(FileNotFoundError):
            Recording.load(tmp_path / name)


def test_a_log_without_tensors_does_not_load(tmp_path):
    with LogWriter(tmp_path / "a.mcap", {}) as log:
        log.write("covariate/opening", 1.0, 0.1)
    with pytest.raises(InvalidValueError, match="neither measured nor simulated, only covariate/open"):
        Recording.load(tmp_path / "a.mcap")
