"""Errors of an environment without MuJoCo Warp, or with one that does not go with its MuJoCo."""

import os
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

import paxisim
from paxisim.errors import UnsupportedError
from paxisim.warp.versions import check_versions


def last_line(code, *folders):
    """Run Python in another process, with folders in front of its packages, and return the last line of its errors."""
    path = [*map(str, folders), str(Path(paxisim.__file__).parents[1]), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, path))},
        capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    return (done.stderr.strip().splitlines() or [""])[-1]


def test_the_package_and_its_names_need_nothing():
    assert set(paxisim.warp.__all__) == {
        "RenewPads", "TactileSensor", "TactileSensorCfg", "WarpTactileReadout", "apply_gel", "check_gel",
        "check_overflow", "fit_simulation", "put_worlds", "set_surface", "sizes",
    }  # fmt: skip


def test_a_missing_package_is_named_with_the_extra():
    code = "import sys; sys.modules['mujoco_warp'] = None\nimport paxisim\npaxisim.warp.put_worlds"
    message = "MissingExtraError: paxisim.warp needs mujoco-warp, which is not installed: pip install 'paxisim[warp]'"
    assert last_line(code).replace("mujoco_warp", "mujoco-warp").endswith(message)


@pytest.mark.parametrize("name", ["RenewPads", "TactileSensor", "TactileSensorCfg", "fit_simulation"])
def test_without_mjlab_its_extra_is_named(name):
    code = f"""
import importlib.metadata as metadata
found = metadata.version
def version(name):
    if name == "mjlab":
        raise metadata.PackageNotFoundError(name)
    return found(name)
metadata.version = version
import paxisim
paxisim.warp.{name}
"""
    message = "TactileSensor of paxisim.warp needs mjlab, which is not installed: pip install 'paxisim[mjlab]'"
    assert last_line(code).endswith(message)


def test_versions_that_do_not_go_together_are_named(tmp_path):
    (tmp_path / "mujoco_warp").mkdir()
    (tmp_path / "mujoco_warp" / "__init__.py").write_text("raise AttributeError('what a wrong mujoco lacks')\n")
    (tmp_path / "mujoco_warp-1.2.3.dist-info").mkdir()
    metadata = "Metadata-Version: 2.1\nName: mujoco-warp\nVersion: 1.2.3\n"
    (tmp_path / "mujoco_warp-1.2.3.dist-info" / "METADATA").write_text(metadata)
    assert last_line("import paxisim\npaxisim.warp.put_worlds", tmp_path).endswith(
        f"UnsupportedError: mujoco-warp 1.2.3 goes with mujoco 1.2, but mujoco {mujoco.__version__} is installed: "
        "pip install 'mujoco==1.2.*', or the mujoco-warp of the other"
    )


def test_which_versions_go_together():
    for versions in (("4.0.0", "4.0.0"), ("4.0.1", "4.0.0"), ("3.9.0", "3.9.0.1")):
        check_versions(*versions)
    for versions in (("4.0.0", "3.17.0"), ("3.9.1", "3.11.0"), ("4.1.0", "4.0.0")):
        with pytest.raises(UnsupportedError, match=f"mujoco-warp {versions[1]} goes with"):
            check_versions(*versions)
