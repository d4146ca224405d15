"""Every format returns every odd recording as it was."""

import numpy as np
import pytest
from log_files import assert_equal

from paxisim.cli.convert import convert
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
    "negative time": {"time": TIME - 100},
    "unknown values": {
        "covariates": {"x.1": np.where(TIME > 1, of(), np.nan), "y": np.where(of(2) < 1, of(2), np.nan)}
    },
    "simulated only": {"measured": None, "simulated": np.zeros((N, 2, 3, 1, 2), np.float32)},
    "unit": {"metadata": {"unit": "uT", "note": '\u2028 "x" 力', "list": [{"a": None}]}},
}


@pytest.mark.filterwarnings("ignore:. of 8 frames hold NaN")
@pytest.mark.parametrize("kind", ["npz", "mcap", "parquet", "lerobot"])
@pytest.mark.parametrize("name", ODD)
def test_odd_recordings_come_back(tmp_path, name, kind):
    if kind in ("parquet", "lerobot"):
        pytest.importorskip("pyarrow")
    force = (np.arange(N * 2 * 3 * 2).reshape(N, 2, 3, 1, 2) / 4).astype(np.float32)
    original = Recording(**{"time": TIME, "measured": force, "pads": ("left", "right"), **ODD[name]})
    original.save(tmp_path / "a.npz")
    path = tmp_path / f"b.{kind}"
    if kind == "lerobot":
        convert(tmp_path / "a.npz", lerobot=path, fps=4)
    else:
        convert(tmp_path / "a.npz", path, force=True)
    loaded = Recording.load(path)
    assert_equal(loaded, original)
    assert {key: value for key, value in loaded.metadata.items() if key != "paxisim"} == original.metadata


def test_a_quoted_csv_header_with_a_line_separator(tmp_path):
    taxels = ",".join(f"tactile.pad.0_0.{axis}" for axis in "xyz")
    (tmp_path / "a.csv").write_text(f'time,{taxels},"a\u2028b"\n0,1,2,3,4\n1,1,2,3,5\n', encoding="utf-8")
    assert Recording.load(tmp_path / "a.csv").covariates["a\u2028b"].tolist() == [4, 5]
