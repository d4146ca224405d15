"""Changed files of each format give a `PaxisimError` or a valid object, thousands of them in little memory."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from mutants import FORMATS, run

NEEDS = {"lerobot": "pyarrow.parquet", "parquet": "pyarrow.parquet", "hdf5": "h5py", "bag": "mcap_ros2"}
SLOW_TO_READ = ("hdf5", "parquet", "bag", "calibration", "diagnosis")
MEBIBYTE = 1 << 20
PROGRAM = Path(__file__).with_name("mutants.py")


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
    words = [sys.executable, str(PROGRAM), name, str(count), "0", str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads(done.stdout)
    assert found["good"] > count / 100, "some changes should be harmless"
    assert found["bad"] > count / 10
    assert found["grown"] < 10 * found["largest"] + 64 * MEBIBYTE
