"""Thousands of changed files of each format give a `PaxisimError` or a valid object, in little memory."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

COUNTS = {
    **dict.fromkeys(["mcap", "npz", "lerobot", "csv", "toml", "json"], 10_000),
    **dict.fromkeys(["hdf5", "parquet", "bag", "calibration", "diagnosis"], 1_000),
}
NEEDS = {"lerobot": "pyarrow.parquet", "parquet": "pyarrow.parquet", "hdf5": "h5py", "bag": "mcap_ros2"}
SEED = 0
MEBIBYTE = 1 << 20
PROGRAM = Path(__file__).with_name("mutants.py")


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs Linux to measure memory")
@pytest.mark.parametrize("name", COUNTS)
def test_a_changed_file_is_an_error_of_ours_or_a_valid_object(tmp_path, name):
    if name in NEEDS:
        pytest.importorskip(NEEDS[name], exc_type=ImportError)
    count = COUNTS[name]
    words = [sys.executable, str(PROGRAM), name, str(count), str(SEED), str(tmp_path)]
    run = subprocess.run(words, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr[-3000:]
    found = json.loads(run.stdout)
    assert found["good"] > count / 100, "some changes should be harmless"
    assert found["bad"] > count / 10
    assert found["grown"] < 10 * found["largest"] + 64 * MEBIBYTE
