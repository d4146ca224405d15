"""``paxisim info`` and ``paxisim convert``."""

import numpy as np
import pytest

from paxisim import Recording, TaxelLayout
from paxisim.cli import main
from paxisim.logs.mcap_writer import LogWriter

START = 1_700_000_000_000_000_000


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def info(capsys):
    """Return a function that returns what ``paxisim info`` prints of a file, within the width of a terminal."""

    def run(path):
        assert main(["info", path]) == 0
        out = capsys.readouterr().out
        assert max(map(len, out.splitlines())) <= 80
        return out

    return run


def write(path, **metadata):
    """Write 1 s of two pads at 100 Hz with a pause and lost readings, and a temperature at 10 Hz."""
    layout = TaxelLayout(4, 3, (0.0022, 0.0023))
    with LogWriter(path, {"layout": layout, "pads": ["left", "right"], "profile": "a-profile", **metadata}) as log:
        for i in range(100):
            at = START + i * 10_000_000 + (i >= 60) * 300_000_000
            if i % 50 == 0:
                log.write_at("episode", at, i // 50)
            log.write_at("measured", at, np.full((2, 3, 4, 3), i * 0.1), sequence=i + (i >= 60) * 30)
            if i % 10 == 0:
                log.write_at("covariate/temperature", at, 20 + i * 0.01)


def test_info_says_what_is_there_and_whether_it_was_cut_off(info, folder):
    write("a.mcap", scene="<mujoco/>")
    out = info("a.mcap")
    for words in (
        "pads: left, right of 4x3 taxels, 2.2x2.3 mm",
        "start: 2023-11-14 22:13:20 UTC",
        "profile: a-profile",
        "scene: MJCF of 9 characters",
        "measured (N a taxel): x 0 to 9.9, y 0 to 9.9, z 0 to 9.9",
        "temperature: 20 to 20.9",
        "2 episodes",
        "  1: from 0.500 s, 50 samples",
    ):
        assert words in out
    row = next(line for line in out.splitlines() if line.startswith("measured "))
    assert row.split() == ["measured", "100", "1.3", "100.0", "1", "0.310", "30"]
    assert "CUT" not in out
    (folder / "a.mcap").write_bytes((folder / "a.mcap").read_bytes()[:-2000])
    assert "CUT OFF" in info("a.mcap")


def test_info_of_a_table_that_states_no_pitch(info, folder):
    (folder / "a.csv").write_text("time,tactile.left.0_0.x,tactile.left.0_0.y,tactile.left.0_0.z\n0,1,2,3\n0.1,1,2,3\n")
    out = " ".join(info("a.csv").split())
    assert "of 1x1 taxels, pitch unknown, drawn as 1x1 mm; state it with Recording.load(..., layout=...)" in out


def test_info_of_a_log_with_errors_bursts_or_nothing(info):
    with LogWriter("errors.mcap", {}) as log:
        for i in range(10):
            log.write_at("measured", START + i * 10_000_000, np.full((2, 3, 4, 3), i), status=(0, i // 7))
    lines = info("errors.mcap").splitlines()
    header, row = [line for line in lines if line.startswith(("stream", "measured "))][:2]
    assert row.split()[-2:] == ["0", "3"]
    assert len(row) == len(header)
    with LogWriter("bursts.mcap", {}) as log:
        for i in range(400):
            log.write_at("covariate/opening", START + i // 100 * 1_000_000_000 + i % 100 * 20_000, i)
    assert "opening came in bursts, 1 s apart" in info("bursts.mcap")
    with LogWriter("empty.mcap", {"note": "word " * 40}):
        pass
    assert "no samples" in info("empty.mcap")


def test_info_of_an_archive(info):
    force = np.zeros((20, 1, 3, 2, 2))
    force[3, 0, 2, 1, 1] = 7.5
    Recording(
        time=np.tile(np.arange(10) * 0.1, 2),
        simulated=force,
        episode=np.repeat([0, 1], 10),
        covariates={"an opening with a name that is longer than any column of the table": np.full(20, np.nan)},
    ).save("a.npz")
    out = info("a.npz")
    assert "simulated (N a taxel): x 0 to 0, y 0 to 0, z 0 to 7.5" in out
    assert "of the table: unknown; 20 samples with unknown values" in " ".join(out.split())
    assert "1: from 1.900 s, 10 samples" in out
    assert "start:" not in out  # the archive has no start time


def test_info_of_unknown_values_long_numbers_and_times_that_begin_late(info):
    force = np.zeros((3, 1, 3, 1, 1))
    force[1, 0, 2] = np.nan
    covariates = {"resultant": np.ones((3, 1, 3))}
    Recording(time=np.arange(3), measured=force, covariates=covariates, episode=[0, 0, 1]).save("a.npz")
    out = " ".join(info("a.npz").split())
    assert "measured (N a taxel): x 0 to 0, y 0 to 0, z 0 to 0; 1 sample with unknown values" in out
    assert "resultant (N): 1 to 1" in out
    assert out.endswith("s, 1 sample")
    force = np.random.default_rng(0).normal(size=(10, 1, 3, 2, 2)) * 1e-5
    Recording(time=np.arange(10) + 5, measured=force, covariates={"a-name" * 20: np.arange(10)}).save("a.npz")
    out = info("a.npz")
    z = force[:, :, 2].astype(np.float32)
    assert f"  z {z.min():.4g} to {z.max():.4g}" in out.splitlines()
    assert "start:" not in out


def test_convert_between_formats_and_onto_itself_if_asked(capsys):
    parquet = pytest.importorskip("pyarrow.parquet")
    write("a.mcap")
    assert main(["convert", "a.mcap", "b.npz", "--missing", "drop"]) == 0
    assert "b.npz: Recording(2 pads of 4x3 taxels" in capsys.readouterr().out
    for output in ("c.mcap", "c.parquet"):
        assert main(["convert", "b.npz", output, "--pads", "right"]) == 0
        loaded = Recording.load(output)
        assert loaded.pads == ("right",)
        np.testing.assert_array_equal(loaded.measured, Recording.load("b.npz").measured[:, 1:])
    table = parquet.read_table("c.parquet")
    assert table.column_names[:5] == ["timestamp", "time", "episode_index", "frame_index", "index"]
    assert table["episode_index"].to_pylist() == loaded.episode.tolist()
    first, second = np.bincount(loaded.episode)
    assert table["frame_index"].to_pylist() == [*range(first), *range(second)]
    assert str(table["tactile.right.3_1.z"].type) == "float"
    assert main(["convert", "a.mcap", "a.mcap", "--force"]) == 0
    assert len(Recording.load("a.mcap")) == 100
