"""Round trips of `Recording.save` and `Recording.load`."""

import json
import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from log_files import LAYOUT, START, assert_equal, counts, recording, write_log

from paxisim.errors import InvalidValueError, UnknownNameError
from paxisim.logs.mcap_writer import LogWriter
from paxisim.recording import Recording


@pytest.mark.parametrize("suffix", [".mcap", ".npz", ".NPZ"])
def test_what_is_saved_comes_back(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    original = recording()
    original.save(path)
    original.save(path)  # overwrites the first file
    loaded = Recording.load(path)
    assert_equal(loaded, original)
    found = {name: value for name, value in loaded.metadata.items() if name != "paxisim"}
    assert found == original.metadata
    loaded.save(path)
    assert_equal(Recording.load(path), original)
    assert os.listdir(tmp_path) == [path.name]


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


@pytest.mark.parametrize("time", [[0, 1.7e12], [0, 1e10], [-1e300, 0], [-2e10, 0]])
def test_a_time_that_a_log_cannot_hold_is_refused(tmp_path, time):
    for start in (0.0, 1.7e9, 1e19):
        with pytest.raises(InvalidValueError, match="must end before 2262-04-11; they reach"):
            Recording(time, np.zeros((2, 1, 3, 1, 1)), metadata={"start": start}).save(tmp_path / "a.mcap")
    with pytest.raises(InvalidValueError, match="must end before 2262-04-11; they reach 1e"):
        Recording([0, 1], np.zeros((2, 1, 3, 1, 1)), metadata={"start": 1e19}).save(tmp_path / "a.mcap")
    assert not list(tmp_path.iterdir())


finite = st.floats(width=32, allow_infinity=False, allow_nan=True)


@given(arrays.arrays(np.float32, (2, 1, 3, 2, 2), elements=finite))
@settings(max_examples=60, deadline=None)
def test_every_float32_comes_back_to_the_bit(tmp_path_factory, force):
    path = tmp_path_factory.mktemp("bits") / "a.mcap"
    Recording(time=[0, 1], measured=force).save(path)
    loaded = Recording.load(path).measured
    known = ~np.isnan(force)
    np.testing.assert_array_equal(np.isnan(loaded), ~known)
    np.testing.assert_array_equal(loaded[known].view(np.uint32), force[known].view(np.uint32))


def test_the_number_that_would_be_rounded_twice_comes_back_too(tmp_path):
    force = np.array([7.038531e-26, -7.038531e-26, -0.0], np.float32).reshape(1, 1, 3, 1, 1)
    Recording(time=[0], measured=force).save(tmp_path / "a.mcap")
    loaded = Recording.load(tmp_path / "a.mcap").measured
    np.testing.assert_array_equal(loaded.view(np.uint32), force.view(np.uint32))


def test_a_live_recording_counts_time_from_its_first_sample(tmp_path):
    write_log(tmp_path / "a.mcap", counts(5))
    loaded = Recording.load(tmp_path / "a.mcap")
    assert loaded.time.tolist() == [0, 0.01, 0.02, 0.03, 0.04]
    assert loaded.metadata["start"] == START * 1e-9
    assert loaded.metadata["sensor"] == "a sensor"
    assert (loaded.layout, loaded.pads) == (LAYOUT, ("left", "right"))
    loaded.save(tmp_path / "b.mcap")
    assert_equal(Recording.load(tmp_path / "b.mcap"), loaded)


def test_pads_are_chosen_by_name(tmp_path):
    original = recording()
    for name in ("a.mcap", "a.npz"):
        original.save(tmp_path / name)
        loaded = Recording.load(tmp_path / name, pads=["right"])
        np.testing.assert_array_equal(loaded.measured, original.measured[:, 1:])
        np.testing.assert_array_equal(loaded.simulated, original.simulated[:, 1:])
        assert loaded.pads == ("right",)
        with pytest.raises(UnknownNameError, match="unknown pad 'rigth'; did you mean 'right'"):
            Recording.load(tmp_path / name, pads=["rigth"])


@pytest.mark.parametrize("name", ["a.mcap", "a.npz"])
def test_chosen_pads_keep_their_resultants(tmp_path, name):
    force = counts(5)
    Recording(np.arange(5), force, covariates={"resultant": force.sum((3, 4))}, pads=("left", "right")).save(
        tmp_path / name
    )
    for pads, index in ((["right"], [1]), (["right", "left"], [1, 0])):
        loaded = Recording.load(tmp_path / name, pads=pads)
        np.testing.assert_array_equal(loaded.covariates["resultant"], force.sum((3, 4))[:, index])


def test_another_suffix_names_those_there_are(tmp_path):
    with pytest.raises(InvalidValueError, match=r"saved as \.mcap or \.npz"):
        recording().save(tmp_path / "a.h5")
    with pytest.raises(InvalidValueError, match=r"\.csv, \.npz, \.parquet, \.hdf5 or \.mcap"):
        Recording.load(tmp_path / "a.txt")
    for name in ("a.mcap", "a.npz", "a.csv"):
        with pytest.raises(FileNotFoundError):
            Recording.load(tmp_path / name)


@pytest.mark.parametrize("name", ["a.mcap", "a.npz"])
def test_a_file_is_replaced_whole_or_not_at_all(tmp_path, name):
    path = tmp_path / name
    recording().save(path)
    before = path.read_bytes()
    with pytest.raises(InvalidValueError, match="JSON"):
        recording(metadata={"thing": object()}).save(path)
    force = counts(50)
    force[30, 0, 0, 0, 0] = np.inf
    with pytest.raises(InvalidValueError, match="infinite"):
        recording(measured=force).save(path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == [name]
    with pytest.raises(InvalidValueError, match="folder does not exist"):
        recording().save(tmp_path / "no" / name)
    (tmp_path / "folder.mcap").mkdir()
    with pytest.raises(InvalidValueError, match="is a folder"):
        recording().save(tmp_path / "folder.mcap")


def test_an_archive_made_by_hand(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, time=np.arange(3), measured=np.zeros((3, 1, 3, 2, 2)), **{"covariate/opening": np.arange(3)})
    loaded = Recording.load(path)
    assert loaded.covariates["opening"].tolist() == [0, 1, 2]
    np.savez(path, time=np.arange(3), forces=np.zeros(3))
    with pytest.raises(InvalidValueError, match="got time, forces"):
        Recording.load(path)


@pytest.mark.parametrize("name", ["a.mcap", "a.npz"])
def test_covariates_whose_names_are_alike_keep_their_values(tmp_path, name):
    covariates = {key: np.full(2, i) for i, key in enumerate(("x", "x.npy", "x.npy.npy", "npy", ".npy"))}
    Recording([0, 1], np.zeros((2, 1, 3, 1, 1)), covariates=covariates).save(tmp_path / name)
    loaded = Recording.load(tmp_path / name).covariates
    assert {key: values[0] for key, values in loaded.items()} == {key: values[0] for key, values in covariates.items()}


def test_a_damaged_archive_is_called_so(tmp_path):
    path = tmp_path / "a.npz"
    recording().save(path)
    data = path.read_bytes()
    pickled = tmp_path / "pickled.npz"
    np.savez(pickled, time=np.array([object()]), allow_pickle=True)
    for content in (b"", b"abc", data[:200], data[:-30], json.dumps({}).encode(), pickled.read_bytes()):
        path.write_bytes(content)
        with pytest.raises(InvalidValueError, match="not a complete npz file"):
            Recording.load(path)


@pytest.mark.parametrize("options", [{}, {"missing": "drop"}, {"pads": "pad0"}])
@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"measured": np.zeros(5)}, "measured must have shape"),
        ({"measured": np.float64(3)}, "measured must have shape"),
        ({"measured": np.full((5, 1, 3, 2, 2), "x")}, "measured must be an array of numbers"),
        ({"measured": np.full((5, 1, 3, 2, 2), np.inf)}, "'measured' holds an infinite value"),
        ({"time": np.arange(4.0)}, "measured has 5 samples, time has 4"),
        ({"time": np.full(5, np.nan)}, "time must be finite"),
        ({"simulated": np.zeros((5, 2, 3, 2, 2))}, "measured and simulated must have one shape"),
        ({"covariate/opening": np.zeros(3)}, "covariates.* must have shape .* to match time"),
        ({"covariate/resultant": np.float64(2)}, "covariates.* must have shape"),
        ({"about": np.array("[1]")}, "'about' must be a JSON object"),
        ({"about": np.array('{"pads": 3}')}, "'about' must be a JSON object"),
        ({"about": np.array('{"metadata": []}')}, "'about' must be a JSON object"),
        ({"about": np.array('{"layout": 3}')}, "'layout' in 'about': expected an object"),
        ({"about": np.array('{"layout": {"rows": 2}}')}, "'layout' in 'about': expected the fields"),
    ],
)
def test_an_archive_made_by_hand_wrongly_is_refused_by_name(tmp_path, changed, says, options):
    path = tmp_path / "a.npz"
    np.savez(path, **{"time": np.arange(5.0), "measured": np.zeros((5, 1, 3, 2, 2)), **changed})
    with pytest.raises(InvalidValueError, match=f"a.npz: {says}"):
        Recording.load(path, **options)


def test_a_log_without_tensors_does_not_load(tmp_path):
    with LogWriter(tmp_path / "a.mcap", {}) as log:
        log.write("covariate/opening", 1.0, 0.1)
    with pytest.raises(
        InvalidValueError, match="no tactile sample, neither measured nor simulated, only covariate/open"
    ):
        Recording.load(tmp_path / "a.mcap")
