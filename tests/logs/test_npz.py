"""Archives of numpy: made by hand, made wrongly, and damaged."""

import numpy as np
import pytest
from log_files import recording

from paxisim.cli import main
from paxisim.errors import InvalidValueError
from paxisim.recording import Recording

GOOD = {"time": np.arange(5.0), "measured": np.zeros((5, 1, 3, 2, 2))}
WRONG = [
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
]


def test_an_archive_made_by_hand(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, **GOOD, **{"covariate/opening": np.arange(5)})
    assert Recording.load(path).covariates["opening"].tolist() == [0, 1, 2, 3, 4]
    np.savez(path, time=np.arange(3), forces=np.zeros(3))
    with pytest.raises(InvalidValueError, match="got time, forces"):
        Recording.load(path)


@pytest.mark.parametrize("options", [{}, {"missing": "drop"}, {"pads": "pad0"}])
def test_an_archive_made_by_hand_wrongly_is_refused_by_name(tmp_path, options):
    path = tmp_path / "a.npz"
    for changed, word in WRONG:
        np.savez(path, **{**GOOD, **changed})
        with pytest.raises(InvalidValueError, match=f"a.npz: {word}"):
            Recording.load(path, **options)


def test_a_damaged_archive_is_called_so(tmp_path):
    path = tmp_path / "a.npz"
    recording().save(path)
    data = path.read_bytes()
    pickled = tmp_path / "pickled.npz"
    np.savez(pickled, time=np.array([object()]), allow_pickle=True)
    for content in (b"", b"abc", data[:200], data[:-30], b"{}", pickled.read_bytes()):
        path.write_bytes(content)
        with pytest.raises(InvalidValueError, match="not a complete npz file"):
            Recording.load(path)


def test_an_archive_of_another_program(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    force = np.random.default_rng(0).normal(size=(20, 4, 5, 3)).astype(np.float32)
    np.savez("a.npz", t=np.arange(20) * 0.1, forces=force, width=np.arange(20.0), note=np.array("text"))
    words = ["convert", "a.npz", "b.npz", "--names", "measured=forces", "opening=width"]
    axes = ["--axes", "forces=rows,cols,xyz"]
    assert main([*words, "time=t", *axes]) == 0
    loaded = Recording.load("b.npz")
    np.testing.assert_array_equal(loaded.measured[:, 0], force.transpose(0, 3, 1, 2))
    np.testing.assert_array_equal(loaded.time, np.arange(20) * 0.1)
    np.testing.assert_array_equal(loaded.covariates["opening"], np.arange(20))
    assert main([*words, "--rate", "50", *axes, "--force"]) == 0
    np.testing.assert_allclose(Recording.load("b.npz").time, np.arange(20) / 50)
    capsys.readouterr()
    for more, word in (
        ([], "say which they are with names (paxisim convert --names measured=KEY)"),
        (["time=t", "--rate", "50"], "has times of its own, so it needs no rate"),
        (["time=stamps"], "unknown array 'stamps'"),
        (["time=t"], "a.npz: measured must have shape (T, pads, 3, rows, cols), got (20, 4, 5, 3)"),
        (["time=t", "--axes", "forces=rows,cols"], "the axes rows,cols do not fit forces"),
        (["time"], "--names must be NAME=KEY, e.g. measured=tactile, with different names"),
    ):
        assert main([*words, *more, "--force"]) == 2
        said = capsys.readouterr().err
        assert word in said
        assert said.count("\n") == 1
    (tmp_path / "a.csv").write_text("time\n")
    assert main(["convert", "a.csv", "b.npz", "--names", "time=t", "--force"]) == 2
    assert "names is for the arrays of an npz file" in capsys.readouterr().err
