"""Episodes in the HDF5 files of ACT: one a file, without times."""

import numpy as np
import pytest
from log_files import refused

from paxisim.cli import main
from paxisim.errors import UnknownNameError
from paxisim.layout import TaxelLayout
from paxisim.recording import Recording

h5py = pytest.importorskip("h5py")
QPOS = np.random.default_rng(0).normal(size=(30, 14))
TOUCH = np.random.default_rng(1).normal(size=(30, 3, 4, 5)).astype(np.float32)
IMAGE = np.zeros((30, 6, 8, 3), np.uint8)


def write(path, **datasets):
    """Write a file with an image, joint positions and actions, and more datasets, whose names have __ for /."""
    with h5py.File(path, "w") as file:
        file.attrs["sim"] = False
        for name, values in {"images/top": IMAGE, "qpos": QPOS, "qvel": QPOS * 2}.items():
            file[f"observations/{name}"] = values
        file["action"] = QPOS + 1
        for name, values in datasets.items():
            file[name.replace("__", "/")] = values
    return path


def test_an_episode_in_the_shell(tmp_path, capsys):
    tactile = {f"observations__tactile__{side}": values for side, values in (("left", TOUCH), ("right", TOUCH + 1))}
    path = write(tmp_path / "episode_0.hdf5", **tactile, observations__images__tactile_camera=IMAGE)
    assert main(["convert", str(path), str(tmp_path / "a.npz")]) == 2
    assert "episode_0.hdf5 has no times: state its samples per second with rate" in capsys.readouterr().err
    assert main(["convert", str(path), str(tmp_path / "a.npz"), "--rate", "50"]) == 0
    loaded = Recording.load(tmp_path / "a.npz")
    np.testing.assert_allclose(loaded.time, np.arange(30) / 50)
    assert loaded.pads == ("tactile/left", "tactile/right")
    np.testing.assert_array_equal(loaded.measured[:, 1], TOUCH + 1)
    assert sorted(loaded.covariates) == ["action", "qpos", "qvel"]
    np.testing.assert_array_equal(loaded.covariates["action"], QPOS + 1)


def test_axes_and_times(tmp_path):
    flat = np.arange(30 * 12.0).reshape(30, 12)
    path = write(tmp_path / "a.hdf5", observations__touch=flat, timestamp=0.1 * np.arange(30) + 5)
    layout = TaxelLayout(2, 2, (1e-3, 1e-3), vendor_order=(3, 2, 1, 0))
    loaded = Recording.load(path, axes={"touch": "taxels,xyz"}, layout=layout)
    np.testing.assert_allclose(loaded.time, 0.1 * np.arange(30) + 5)
    np.testing.assert_array_equal(layout.to_flat(loaded.measured[:, 0]), flat)
    with pytest.raises(UnknownNameError, match="unknown array 'tuch'"):
        Recording.load(path, axes={"tuch": "taxels,xyz"})
    refused(path, "so it needs no rate", axes={"touch": "taxels,xyz"}, rate=50.0)
    refused(path, r"a.hdf5 has no tensor: .* 'tactile' in its name")


@pytest.mark.parametrize(
    ("datasets", "word"),
    [
        ({"tactile": np.zeros((30, 3, 3))}, r"the axes of tactile, of shape \(3, 3\) per sample, .*--axes tactile="),
        ({"tactile": TOUCH, "tactile2": TOUCH[:, :, :2]}, "differ in their taxels: tactile has 4x5, tactile2 has 2x5"),
        ({"tactile": TOUCH[:20]}, "must have one number of samples: .*tactile has 20"),
        ({"tactile": h5py.ExternalLink("other.hdf5", "/secret")}, "observations/tactile is not in this file"),
    ],
)
def test_what_is_refused(tmp_path, datasets, word):
    path = write(tmp_path / "a.hdf5", **{f"observations__{name}": values for name, values in datasets.items()})
    refused(path, word, rate=50.0)


def test_values_that_are_not_stored(tmp_path):
    path = write(tmp_path / "a.hdf5")
    with h5py.File(path, "a") as file:
        file.create_dataset("observations/tactile", (30, 3, 1000, 1000), np.float32, chunks=(1, 3, 10, 10))
    refused(path, "its values are not stored", rate=50.0)
